#pragma once
// How one map of a robot lies in another, from where the robot was in both at the same times.

#include <mapweave/core/geometry.h>

#include <optional>
#include <vector>

namespace mapweave::fusion {

struct PosePair {
  Pose3 in_a, in_b;
};

// How many times as long ways are in `a`; nullopt where the robot went less than half a metre there, or stood in `b`. In order of time.
std::optional<double> scale_of_ways(const std::vector<PosePair>& pairs);

// a_from_b with that scale. Headings count, so that one pair is enough. At least one.
Sim3 aligned(const std::vector<PosePair>& pairs, double scale);

}  // namespace mapweave::fusion
