#pragma once
// Where walls of two grids contradict each other: places that somebody can look at.

#include <mapweave/maps/judgement.h>
#include <mapweave/matching/wall_point.h>

#include <vector>

namespace mapweave::fusion {

// `walls`, of which each stands for sample_m, by what lies together; longest first, at most 20, none below 0.6 m.
std::vector<PairHypothesis::Place> places_of(const std::vector<matching::WallPoint>& walls, double sample_m);

}  // namespace mapweave::fusion
