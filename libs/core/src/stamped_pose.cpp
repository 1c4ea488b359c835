#include <mapweave/core/stamped_pose.h>

#include <algorithm>

namespace mapweave {

Pose3 interpolated(const Pose3& from, const Pose3& to, double share) {
  return {from.t + share * (to.t - from.t), from.q.slerp(share, to.q)};
}

std::optional<Pose3> pose_at(const std::vector<StampedPose>& poses, Stamp stamp, double longest_gap_s) {
  const auto later = std::lower_bound(poses.begin(), poses.end(), stamp,
                                      [](const StampedPose& pose, Stamp when) { return pose.stamp < when; });
  if (later == poses.end() || seconds_between(stamp, later->stamp) > longest_gap_s) return std::nullopt;
  if (later == poses.begin()) return later->stamp == stamp ? std::optional(later->map_from_robot) : std::nullopt;
  const auto earlier = later - 1;
  const double span = seconds_between(earlier->stamp, later->stamp);
  if (span > longest_gap_s) return later->stamp == stamp ? std::optional(later->map_from_robot) : std::nullopt;
  const double share = seconds_between(earlier->stamp, stamp) / span;
  return interpolated(earlier->map_from_robot, later->map_from_robot, share);
}

}  // namespace mapweave
