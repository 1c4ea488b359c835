#pragma once
// One map of several cameras on one robot (collaborative visual SLAM for service robots, III-D). Each camera is a
// client with maps of its own, one for each session. For each keyframe of one camera another camera gets a virtual
// keyframe at its stamp, interpolated between its own poses before and after; the two are constrained to each other
// rigidly. Nodes are poses of the robot's base, so such an extrinsic constraint says that the two are the same pose.

#include <mapweave/core/stamped_pose.h>
#include <mapweave/maps/map.h>
#include <mapweave/maps/map_noise.h>
#include <mapweave/rig/robot_trajectory.h>

#include <string>
#include <vector>

namespace mapweave::rig {

struct RigOptions {
  bool enabled = true;
  double longest_gap_s = 1.0;
  double least_common_s = 1.0;
  double threshold_m = 0.01, threshold_rad = 0.005;
  double extrinsic_sigma_m = 0.004, extrinsic_sigma_rad = 0.002;
  double acceleration_m_per_s2 = 0.5, acceleration_rad_per_s2 = 1.0;
  double covisibility_sigma_m = kCovisibleMotion.sigma_m, covisibility_sigma_per_m = kCovisibleMotion.sigma_per_m,
         covisibility_sigma_rad = kCovisibleMotion.sigma_rad;
  double covisibility_sigma_scale = 0.05;
  double wheels_share = 0.02;
  int least_shared = kCovisibleMotion.least_shared;
  double wrong_m = 0.05, wrong_share = 0.12, wrong_rad = 0.05;
  double most_wrong = 0.5;
  RobotTrajectoryOptions trajectory;
  template <class Visitor>
  void describe(Visitor& v) {
    v.flag("enabled", enabled,
           "merge the maps of the cameras of one robot by their extrinsics; false: each camera keeps a map of its own");
    v.positive("longest_gap_s", longest_gap_s,
               "longest time in seconds between the two poses that a virtual keyframe of another camera is "
               "interpolated from; larger values make more constraints between cameras, with larger errors");
    v.positive("least_common_s", least_common_s,
               "least time in seconds that sessions of two cameras must have in common to be merged; larger values "
               "leave more cameras apart");
    v.positive("threshold_m", threshold_m,
               "the rig's pose graph is optimised where two of its cameras disagree about the robot's position by more "
               "than this distance in metres; larger values optimise less often");
    v.positive("threshold_rad", threshold_rad,
               "the rig's pose graph is optimised where two of its cameras disagree about the robot's heading by more "
               "than this angle in radians; larger values optimise less often");
    v.positive("extrinsic_sigma_m", extrinsic_sigma_m,
               "standard deviation in metres of an extrinsic constraint between two cameras of a rig: errors of "
               "extrinsics and of stamps; larger values let the cameras move against each other more");
    v.positive("extrinsic_sigma_rad", extrinsic_sigma_rad,
               "standard deviation in radians of the heading of an extrinsic constraint between two cameras of a rig: "
               "errors of extrinsics and of stamps; larger values let the cameras turn against each other more");
    v.positive("acceleration_m_per_s2", acceleration_m_per_s2,
               "acceleration of the robot in metres per second squared between the two poses that a virtual keyframe "
               "is interpolated from; larger values trust interpolation less");
    v.positive("acceleration_rad_per_s2", acceleration_rad_per_s2,
               "angular acceleration of the robot in radians per second squared between the two poses that a virtual "
               "keyframe is "
               "interpolated from; larger "
               "values trust interpolation less");
    v.positive("covisibility_sigma_m", covisibility_sigma_m,
               "standard deviation in metres of the motion between two covisible keyframes of one camera; larger "
               "values let the rig's "
               "pose graph bend the camera's map more");
    v.non_negative(
        "covisibility_sigma_per_m", covisibility_sigma_per_m,
        "standard deviation of the motion between two covisible keyframes of one camera in metres per metre of it, "
        "added to covisibility_sigma_m; larger values let the rig's pose graph bend the camera's map more");
    v.positive("covisibility_sigma_rad", covisibility_sigma_rad,
               "standard deviation in radians of the rotation between two covisible keyframes of one camera; larger "
               "values let the rig's pose graph bend the camera's map more");
    v.positive("covisibility_sigma_scale", covisibility_sigma_scale,
               "standard deviation of the relative scale between two covisible keyframes of a monocular camera, whose "
               "scale drifts; larger values let the rig's pose graph change its scale more");
    v.positive("wheels_share", wheels_share,
               "error of wheel odometry as a share of motion and of turns, where it gives a rig of monocular cameras "
               "its scale; larger values trust wheels less");
    v.integer("least_shared", least_shared, 1, 100000,
              "least number of landmarks that two keyframes of one camera must share to be constrained to each other "
              "in the rig's pose graph; larger values make fewer constraints and let the map bend more");
    v.positive("wrong_m", wrong_m,
               "two cameras contradict each other where their motions over the same time differ by more than this "
               "distance in metres plus wrong_share of the motion; larger values accept worse extrinsics");
    v.non_negative("wrong_share", wrong_share,
                   "growth of wrong_m with the motion over which two cameras are compared, as a share of its length; "
                   "larger values accept worse extrinsics");
    v.positive("wrong_rad", wrong_rad,
               "two cameras contradict each other where their rotations over the same time differ by more than this "
               "angle in radians; larger values accept worse extrinsics");
    v.fraction("most_wrong", most_wrong,
               "largest share of contradicting motions at which the maps of two cameras are merged; a larger share "
               "means wrong extrinsics, and the maps stay apart; larger values merge more cameras");
    v.section("trajectory", trajectory, "the robot's trajectory averaged over its cameras");
  }
};

// A session of a camera, in its own map's frame.
struct RigMember {
  std::string camera;               // its name; sessions of one camera are not constrained to each other
  Map map;                          // keyframes and landmarks
  std::vector<StampedPose> frames;  // by stamp; none: the keyframes are the trajectory
};

struct RigMap {
  Map map;                           // with covisibility and extrinsic constraints; the id of the first member
  std::vector<std::size_t> members;  // numbers; the first one gave the frame, and its first node does not move
  std::vector<std::vector<StampedPose>> frames;  // of these members, in the map; of keyframes where they had none
  std::size_t extrinsic_constraints = 0;
  double apart_before_m = 0.0, apart_after_m = 0.0;  // root mean square error of the extrinsic constraints
  bool solved = false;                               // past the threshold
};

struct RigMerge {
  std::vector<RigMap> maps;        // the one with most frames first
  std::vector<std::string> notes;  // why cameras stayed apart, for people
};

// Members of one robot; those without nodes are left out. A camera with depth gives the scale to those without; where
// none has depth, wheel odometry does. odometry: of the robot, in a frame of its own; may be empty. Motions that
// odometry contradicts count less. Pure.
RigMerge merge_rig(const std::vector<RigMember>& members, const std::vector<StampedPose>& odometry,
                   const RigOptions& options = {});

}  // namespace mapweave::rig
