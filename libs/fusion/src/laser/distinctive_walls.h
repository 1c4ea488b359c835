#pragma once
// How unusual is what two sides have in common: buildings repeat themselves, and walls that fit at many places do not
// say that they are the same.

#include "region_comparison.h"

#include <array>

namespace mapweave::fusion {

// What both sides have in one region.
struct CommonWalls {
  double coinciding_m = 0.0;
  Eigen::Matrix2d normals = Eigen::Matrix2d::Zero();      // of the coinciding walls
  std::array<std::vector<matching::WallPoint>, 2> known;  // that the other side saw anything of
};

struct DistinctiveWalls {
  // Metres that coincide here and would not elsewhere: one side shifted by 0.75 to 6 m along the two directions in
  // which walls stand, or mirrored.
  double distinctive_m = 0.0;
  // Of these, what is not taken to coincide at the next rooms (2.5 to 6 m): what was not looked at there is taken to be
  // as the rest, where that is most of it.
  double unique_m = 0.0;
  bool repeats = false;  // nearly all is taken to coincide at one of the next rooms
};

// Of the fullest regions, which are enough. `with_mirror`: mirror images are asked.
// `common`: by the places of `comparison`, which is of the two `sides`.
DistinctiveWalls distinctive_walls(const std::map<std::size_t, CommonWalls>& common, const RegionComparison& comparison,
                                   bool with_mirror, const std::vector<std::vector<PlacedSubmap>>& sides,
                                   const SightOf& sight_of);

}  // namespace mapweave::fusion
