#pragma once
// One robot's path in stretches: visits, of which two may show the same place at different times.

#include "wall_agreement.h"

namespace mapweave::fusion {

// `path`: in the order in which it was driven. A stretch drifts less than a ghost is wide.
std::vector<std::vector<PlacedSubmap>> visits_of(const std::vector<PlacedSubmap>& path);
// Whether walls of two visits may be compared, a < b: neighbours share scans, and show what moved while the robot
// passed.
inline bool are_visits_apart(std::size_t a, std::size_t b) { return b - a > 1; }

}  // namespace mapweave::fusion
