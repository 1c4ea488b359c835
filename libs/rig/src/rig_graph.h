#pragma once
// The pose graph of a rig: covisibility constraints within each camera, extrinsic constraints between cameras.

#include "rig_parts.h"

namespace mapweave::rig {

// members: parts that are placed. The first one's first node does not move. Members of the result are all of them,
// wheel odometry too.
RigMap solve_rig_graph(const std::vector<RigPart>& parts, const std::vector<std::size_t>& members,
                       const std::vector<StampedPose>& odometry, const RigOptions& options);

}  // namespace mapweave::rig
