#pragma once
// Where a robot with several cameras is now, by all of them (CVS III: clients' poses become one pose of the robot, with a policy for
// failures): for its navigation while it maps. The policy is that of robot_way.h, with what is known by then.

#include <mapweave/core/ids.h>
#include <mapweave/fusion/robot_way.h>

#include <cstddef>
#include <memory>
#include <optional>

namespace mapweave::fusion {

struct RobotPoseAnswer {
  StampedPose pose;
  int cameras = 0;  // that it rests on; 0: odometry alone goes on from where they were last
};

// Fed poses as they come, stamped by one clock: of cameras in any order, of one camera and of odometry by stamp (older ones are ignored, as
// are such that are not finite). A camera without a pose at the newest stamp speaks up to longest_gap_s later, from where it was as
// odometry moved since, else as it moved itself; then it is silent. One that comes gains its weight within hand_over_s, and where one goes
// the answer goes over to the others within as long. Memory: a few poses of each camera that was there lately, odometry of twice
// odometry_s. Throws nothing but for lack of memory. Not thread-safe.
class RobotPose {
 public:
  explicit RobotPose(const RobotWayOptions& options = {});
  ~RobotPose();
  RobotPose(RobotPose&&) noexcept;
  RobotPose& operator=(RobotPose&&) noexcept;

  // pose: of the robot's base in the map that its cameras share. weight: against the others'; where it is not positive the pose is ignored.
  void add(SensorId camera, const StampedPose& pose, double weight = 1.0);
  // In a frame of its own.
  void add_odometry(const StampedPose& pose);

  // At the newest stamp of cameras, or of odometry where that has come further; nullopt before the first camera's pose, and once odometry
  // has gone on alone for odometry_s.
  std::optional<RobotPoseAnswer> now() const;
  std::size_t kept() const;  // poses in memory

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::fusion
