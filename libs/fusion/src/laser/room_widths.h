#pragma once
// Whether rooms are as wide in one map as in the other. A submap measures how far apart walls that face each other
// stand, whatever its map's drift: two buildings that are made alike differ in it before they differ in anything else.

#include "wall_agreement.h"

namespace mapweave::fusion {

struct WidthComparison {
  std::size_t count = 0;      // of pairs of submaps, one of each side, in which both have such walls
  double difference_m = 0.0;  // median: how much wider rooms of b are
  double deviation_m = 0.0;   // of that median
  // What of the difference is no chance, with its sign.
  double certain_m() const;
};

// Walls of each submap are compared with those of the nearest submap of the other side, where they coincide. Of the two
// directions in which walls stand: the one in which more of the difference is no chance.
// Antisymmetric in its arguments.
WidthComparison compare_widths(const std::vector<PlacedSubmap>& a, const std::vector<PlacedSubmap>& b);

}  // namespace mapweave::fusion
