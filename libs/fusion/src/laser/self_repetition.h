#pragma once
// Whether what two sides share stands more than once in one of them, as the rooms of a hotel do: then they may as well
// lie elsewhere.

#include "wall_agreement.h"

#include <vector>

namespace mapweave::fusion {

// A part of one side that the other one knows, laid elsewhere on that other one, where hardly any wall of it is
// contradicted.
struct Repetition {
  double shared_m = 0.0;    // walls of the part that coincide where it lies
  double repeated_m = 0.0;  // the same elsewhere: as much as the walls of a room at least, and a share of shared_m
  Pose2 b_moved;            // the motion of the team's plane by which b lies to a as the part does elsewhere
};

// Of either side's part, those that repeat most first, few: parts of which a third stands elsewhere, and seven tenths
// where they have more than 300 m of wall.
std::vector<Repetition> self_repetitions(const std::vector<PlacedSubmap>& a, const std::vector<PlacedSubmap>& b,
                                         const SightOf& sight_of);

// Whether walls of both sides would contradict each other if they lay so, as a building that only repeats in part has
// them.
bool is_contradicted(const WallAgreement& elsewhere, const WallAgreement& here);

}  // namespace mapweave::fusion
