#include <mapweave/evaluation/trajectory.h>

#include <algorithm>

namespace mapweave::evaluation {
namespace {

Trajectory::const_iterator first_not_before(const Trajectory& trajectory, Stamp stamp) {
  return std::lower_bound(trajectory.begin(), trajectory.end(), stamp,
                          [](const TrajectoryPoint& point, Stamp s) { return point.stamp < s; });
}

}  // namespace

const TrajectoryPoint* nearest_point(const Trajectory& trajectory, Stamp stamp, double tolerance_s) {
  const auto after = first_not_before(trajectory, stamp);
  const TrajectoryPoint* best = nullptr;
  if (after != trajectory.begin()) best = &*std::prev(after);
  if (after != trajectory.end() && (best == nullptr || after->stamp.ns - stamp.ns < stamp.ns - best->stamp.ns))
    best = &*after;
  return best != nullptr && std::abs(seconds_between(best->stamp, stamp)) <= tolerance_s ? best : nullptr;
}

std::optional<Pose3> interpolated_pose(const Trajectory& trajectory, Stamp stamp, double max_gap_s) {
  const auto after = first_not_before(trajectory, stamp);
  if (after == trajectory.end()) return std::nullopt;
  if (after->stamp == stamp) return after->pose;
  if (after == trajectory.begin()) return std::nullopt;
  const auto before = std::prev(after);
  const double gap_s = seconds_between(before->stamp, after->stamp);
  if (gap_s > max_gap_s) return std::nullopt;
  const double share = seconds_between(before->stamp, stamp) / gap_s;
  return Pose3{before->pose.t + share * (after->pose.t - before->pose.t),
               before->pose.q.slerp(share, after->pose.q).normalized()};
}

}  // namespace mapweave::evaluation
