#pragma once
// What odometry and gyroscopes say of a camera's motion between two frames.

#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/visual/frame.h>

#include <deque>

namespace mapweave::visual {

class MotionPrior {
 public:
  // Of one robot, in the order of stamps; whatever says nothing of motion is passed over.
  void add(const rawlog::Record& record);
  // Since the frame before, whose stamp it keeps. Odometry is preferred; its last motion is taken to go on until `now`.
  // nullopt at the first frame, and where nothing was received since the one before.
  std::optional<ExpectedMotion> at(Stamp now, const Pose3& robot_from_camera);
  // Where the camera is by odometry alone, at a moment near the latest; nullopt without odometry.
  std::optional<Pose3> odometry_from_camera(Stamp now, const Pose3& robot_from_camera) const;

 private:
  struct Odometry {
    Stamp stamp;
    Pose2 odometry_from_robot;
  };
  struct Turning {
    Stamp stamp;
    Eigen::Vector3d rad_per_s;  // in the robot's frame
  };
  std::optional<Pose2> odometry_at(Stamp when) const;
  std::optional<Eigen::Quaterniond> turned(Stamp from, Stamp to) const;  // robot at `from` from robot at `to`
  std::deque<Odometry> odometry_;
  std::deque<Turning> turning_;
  std::optional<Stamp> before_;
};

}  // namespace mapweave::visual
