#pragma once
// The graph of a rig: steps of each camera, and ties between siblings.

#include "rig_parts.h"

namespace mapweave::fusion {

// Of parts that are placed; the first one's first node stays. Members of the result are all of them, wheels too.
TiedMap tied_map(const std::vector<Part>& parts, const std::vector<std::size_t>& members, const std::vector<StampedPose>& odometry,
                 const RigOptions& options);

}  // namespace mapweave::fusion
