#pragma once
// Where a robot was at a time.

#include <mapweave/core/geometry.h>
#include <mapweave/core/stamp.h>

#include <optional>
#include <vector>

namespace mapweave {

struct StampedPose {
  Stamp stamp;
  Pose3 map_from_robot;
};

// Between two poses: straight ahead and evenly turning.
Pose3 interpolated(const Pose3& from, const Pose3& to, double share);

// Between two poses (by stamp), at most `longest_gap_s` apart; nullopt before the first, after the last and in longer
// gaps.
std::optional<Pose3> pose_at(const std::vector<StampedPose>&, Stamp, double longest_gap_s);

}  // namespace mapweave
