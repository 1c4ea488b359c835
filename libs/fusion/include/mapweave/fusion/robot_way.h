#pragma once
// The way of a robot with several cameras, by all of them (CVS III: clients' poses become one pose of the robot, with a policy for
// failures). Poses are those of the robot's base in one map.

#include <mapweave/core/stamped_pose.h>

#include <vector>

namespace mapweave::fusion {

struct RobotWayOptions {
  double longest_gap_s = 0.25;
  double hand_over_s = 1.0;
  double doubt_m = 0.1;
  double doubt_rad = 0.06;
  double odometry_s = 30.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("longest_gap_s", longest_gap_s, "between two frames of a camera, for it to speak between them");
    v.positive("hand_over_s", hand_over_s, "in which a camera that comes or goes gains or loses its weight");
    v.positive("doubt_m", doubt_m,
               "cameras farther apart than this do not both speak: those do that most agree with, else those nearest to odometry");
    v.positive("doubt_rad", doubt_rad, "the same in heading");
    v.positive("odometry_s", odometry_s, "since cameras agreed, for odometry to tell which of them to believe");
  }
};

// One camera's poses of its robot, by stamp.
struct SeenWay {
  std::vector<StampedPose> frames;
  double weight = 1.0;  // against the others': positive
};

// At every stamp of any of them: the weighted mean of those that speak. A camera is silent where it has no pose, and where it is far from
// its siblings and they, or else odometry (else the way so far), stand against it. Weights change slowly, so that nobody's coming or going
// makes the way jump. odometry: of the robot, in a frame of its own; may be empty.
std::vector<StampedPose> robot_way(const std::vector<SeenWay>& cameras, const std::vector<StampedPose>& odometry,
                                   const RobotWayOptions& options = {});

// A keyframe before and after its map was changed. `scale`: by which lengths around it grew, of the way of the camera that sits there.
struct MovedKeyframe {
  Stamp stamp;
  Pose3 before, after;
  double scale = 1.0;
  Pose3 robot_from_camera = {};
};
// Frames go with the keyframes around them (by stamp).
std::vector<StampedPose> carried_along(const std::vector<StampedPose>& frames, const std::vector<MovedKeyframe>& keyframes);

}  // namespace mapweave::fusion
