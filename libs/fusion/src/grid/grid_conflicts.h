#pragma once
// Where walls of two grids contradict each other: places that somebody can look at.

#include <mapweave/maps/judgement.h>
#include <mapweave/matching/wall_point.h>

#include <vector>

namespace mapweave::fusion {

constexpr std::size_t kMostPlaces = 20;  // that a hypothesis lists

// `walls`, of which each stands for sample_m, by what lies together; longest first, at most kMostPlaces, none below 0.6
// m.
std::vector<PairHypothesis::ContradictedWall> places_of(const std::vector<matching::WallPoint>& walls, double sample_m);

}  // namespace mapweave::fusion
