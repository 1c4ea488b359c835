#pragma once
// Where a robot was when: what a mapper answered, or what is known to be true.

#include <mapweave/core/geometry.h>
#include <mapweave/core/stamp.h>

#include <optional>
#include <vector>

namespace mapweave::evaluation {

struct TrajectoryPoint {
  Stamp stamp;
  Pose3 pose;  // world_from_body; which world and which body, the file's owner knows
};

// Stamps strictly increase.
using Trajectory = std::vector<TrajectoryPoint>;

// The point whose stamp is nearest (the earlier of two equally near), or nullptr where none is within `tolerance_s`.
const TrajectoryPoint* nearest_point(const Trajectory&, Stamp, double tolerance_s);

// The pose at a stamp: straight between the two points around it, rotation by slerp. nullopt outside of the trajectory,
// and where those two points are more than `max_gap_s` apart.
std::optional<Pose3> interpolated_pose(const Trajectory&, Stamp, double max_gap_s);

}  // namespace mapweave::evaluation
