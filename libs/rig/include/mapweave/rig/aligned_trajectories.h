#pragma once
// How one map of a robot lies in another: from the robot's poses in both at the same times.

#include <mapweave/core/geometry.h>

#include <optional>
#include <vector>

namespace mapweave::rig {

// One pose in two maps.
struct CommonPose {
  Pose3 in_a, in_b;
};

// The length of the trajectory in `a`, divided by its length in `b`. `pairs`: in order of time. nullopt where the
// trajectory in `a` is shorter than half a metre, or the poses in `b` do not move.
std::optional<double> scale_of_trajectories(const std::vector<CommonPose>& pairs);

// a_from_b of this scale, by least squares. Orientations count too, so one pair is enough. At least one.
Sim3 aligned(const std::vector<CommonPose>& pairs, double scale);

}  // namespace mapweave::rig
