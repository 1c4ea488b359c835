#pragma once
// Which of a robot's cameras are believed at a stamp: for its way afterwards (robot_way.h) and its pose at once (robot_pose.h).

#include <mapweave/fusion/robot_way.h>

#include <functional>
#include <optional>
#include <vector>

namespace mapweave::fusion {

struct Voice {
  std::size_t camera;
  Pose3 pose;
  double weight;
};

// By weight; of at least one.
Pose3 mean(const std::vector<Voice>& voices);

// A robot's odometry; nullopt where it has no pose.
using OdometryAt = std::function<std::optional<Pose3>(Stamp)>;

// Asked stamp by stamp, from the first to the last.
class WayPolicy {
 public:
  explicit WayPolicy(const RobotWayOptions& options) : options_(options) {}
  // Of those that have a pose at the stamp, at least one.
  std::vector<Voice> speak(Stamp stamp, const std::vector<Voice>& voices, const OdometryAt& odometry);

 private:
  double apart(const Pose3& a, const Pose3& b) const;  // above 1: in doubt
  std::vector<Voice> most(Stamp stamp, const std::vector<Voice>& voices, const OdometryAt& odometry) const;
  std::optional<Pose3> expected(Stamp stamp, const OdometryAt& odometry) const;

  RobotWayOptions options_;
  std::optional<StampedPose> agreed_, last_, before_last_;
};

}  // namespace mapweave::fusion
