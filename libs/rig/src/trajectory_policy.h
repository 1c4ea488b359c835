#pragma once
// Which of a robot's cameras are believed at a stamp: for its trajectory afterwards (robot_trajectory.h) and its
// current pose (robot_pose.h).

#include <mapweave/rig/robot_trajectory.h>

#include <functional>
#include <optional>
#include <vector>

namespace mapweave::rig {

struct CameraVote {
  std::size_t camera;
  Pose3 pose;
  double weight;
};

// By weight; of at least one.
Pose3 mean(const std::vector<CameraVote>& votes);

// A robot's odometry; nullopt where it has no pose.
using OdometryAt = std::function<std::optional<Pose3>(Stamp)>;

// Asked stamp by stamp, from the first to the last.
class TrajectoryPolicy {
 public:
  explicit TrajectoryPolicy(const RobotTrajectoryOptions& options) : options_(options) {}
  // votes: of the cameras that have a pose at the stamp, at least one.
  std::vector<CameraVote> believed(Stamp stamp, const std::vector<CameraVote>& votes, const OdometryAt& odometry);

 private:
  double apart(const Pose3& a, const Pose3& b) const;  // above 1: in doubt
  std::vector<CameraVote> majority(Stamp stamp, const std::vector<CameraVote>& votes, const OdometryAt& odometry) const;
  std::optional<Pose3> expected(Stamp stamp, const OdometryAt& odometry) const;

  RobotTrajectoryOptions options_;
  std::optional<StampedPose> agreed_, last_, before_last_;
};

}  // namespace mapweave::rig
