#pragma once
// The current pose of a robot with several cameras, by all of them (CVS III: clients' poses become one pose of the
// robot, with a policy for failures), for its navigation while it maps. The policy is that of robot_trajectory.h, with
// what is known by then.

#include <mapweave/core/ids.h>
#include <mapweave/rig/robot_trajectory.h>

#include <cstddef>
#include <memory>
#include <optional>

namespace mapweave::rig {

struct RobotPoseAnswer {
  StampedPose pose;
  int cameras = 0;  // that are believed; 0: odometry since the last of them
};

// Receives poses as they come, stamped by one clock: those of cameras in any order, those of one camera and of odometry
// by stamp (older and infinite ones are ignored). A camera without a pose at the newest stamp is extrapolated for
// longest_gap_s, by odometry, else by its own motion; then it is left out. A camera that comes gains its weight within
// hand_over_s; where one goes, the answer moves to the others within the same time. Memory: a few recent poses of each
// camera, odometry of twice odometry_s. Throws only for lack of memory. Not thread-safe.
class RobotPose {
 public:
  explicit RobotPose(const RobotTrajectoryOptions& options = {});
  ~RobotPose();
  RobotPose(RobotPose&&) noexcept;
  RobotPose& operator=(RobotPose&&) noexcept;

  // pose: of the robot's base in the map that its cameras share. weight: against the others'; where it is not positive
  // the pose is ignored.
  void add(SensorId camera, const StampedPose& pose, double weight = 1.0);
  // In a frame of its own.
  void add_odometry(const StampedPose& pose);

  // At the newest stamp of cameras, or of odometry where that is later. nullopt before the first camera's pose, and
  // once no camera's pose came for odometry_s.
  std::optional<RobotPoseAnswer> now() const;
  std::size_t kept() const;  // poses in memory

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::rig
