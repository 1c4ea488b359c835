#pragma once
// Trajectories by the cameras of a robot that drives half a metre a second along x, 10 frames a second.

#include <mapweave/rig/robot_trajectory.h>

#include <algorithm>

namespace mapweave::test {

inline Stamp at(double seconds) { return stamp_from_seconds(1000.0 + seconds); }

// Aside: of double(double seconds); by how many metres to the left.
template <class Aside>
rig::CameraTrajectory straight_trajectory(double begin_s, double end_s, Aside aside_m, double weight = 1.0) {
  rig::CameraTrajectory trajectory;
  trajectory.weight = weight;
  for (double t = begin_s; t < end_s - 1e-9; t += 0.1)
    trajectory.frames.push_back({at(t), {{0.5 * t, aside_m(t), 0.0}, Eigen::Quaterniond::Identity()}});
  return trajectory;
}

inline double longest_step_m(const std::vector<StampedPose>& trajectory) {  // in a tenth of a second
  double longest = 0.0;
  for (std::size_t i = 1; i < trajectory.size(); ++i) {
    const StampedPose &before = trajectory[i - 1], &after = trajectory[i];
    longest = std::max(longest, (after.map_from_robot.t - before.map_from_robot.t).norm() /
                                    (10.0 * seconds_between(before.stamp, after.stamp)));
  }
  return longest;
}

inline double aside_m(const std::vector<StampedPose>& trajectory, double seconds) {
  return pose_at(trajectory, at(seconds), 0.25)->t.y();
}

}  // namespace mapweave::test
