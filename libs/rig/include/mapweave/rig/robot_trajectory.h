#pragma once
// The trajectory of a robot with several cameras, by all of them (CVS III: clients' poses become one pose of the robot,
// with a policy for failures). Poses are those of the robot's base in one map.

#include <mapweave/core/stamped_pose.h>

#include <vector>

namespace mapweave::rig {

struct RobotTrajectoryOptions {
  double longest_gap_s = 0.25;
  double hand_over_s = 1.0;
  double doubt_m = 0.1;
  double doubt_rad = 0.06;
  double odometry_s = 30.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("longest_gap_s", longest_gap_s,
               "longest time in seconds between two frames of a camera for its pose to be interpolated between them; "
               "larger values bridge longer gaps, with larger errors");
    v.positive("hand_over_s", hand_over_s,
               "time in seconds over which a camera that appears or disappears gains or loses its weight in the "
               "robot's averaged "
               "trajectory; larger values are smoother");
    v.positive("doubt_m", doubt_m,
               "cameras of one robot that disagree by more than this distance in metres are not averaged; the majority "
               "is followed, or else those nearest to odometry; larger values average more often");
    v.positive("doubt_rad", doubt_rad,
               "cameras of one robot whose headings disagree by more than this angle in radians are not averaged; the "
               "majority is followed, or else those nearest to odometry; larger values average more often");
    v.positive("odometry_s", odometry_s,
               "longest time in seconds since the cameras last agreed for which odometry decides which of them to "
               "follow; larger values rely longer on odometry, which drifts");
  }
};

// One camera's poses of its robot, by stamp.
struct CameraTrajectory {
  std::vector<StampedPose> frames;
  double weight = 1.0;  // against the others': positive
};

// At every stamp of any camera: the weighted mean of the cameras that are believed. A camera without a pose there is
// left out, and one that contradicts the rig's other cameras where they, or else odometry (else the motion so far),
// stand against it. Weights change slowly, so that the trajectory does not jump where a camera comes or goes. odometry:
// of the robot, in a frame of its own; may be empty.
std::vector<StampedPose> robot_trajectory(const std::vector<CameraTrajectory>& cameras,
                                          const std::vector<StampedPose>& odometry,
                                          const RobotTrajectoryOptions& options = {});

// A keyframe before and after its map was changed. `scale`: by which the trajectory of its camera was rescaled around
// it.
struct MovedKeyframe {
  Stamp stamp;
  Pose3 before, after;
  double scale = 1.0;
  Pose3 robot_from_camera = {};
};
// Frames move with the keyframes around them (by stamp).
std::vector<StampedPose> moved_with_keyframes(const std::vector<StampedPose>& frames,
                                              const std::vector<MovedKeyframe>& keyframes);

}  // namespace mapweave::rig
