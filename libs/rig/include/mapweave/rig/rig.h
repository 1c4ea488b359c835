#pragma once
// One map of several cameras on one robot (collaborative visual SLAM for service robots, III-D). Each camera is a client with maps of its
// own, one for each session. For each keyframe of one camera another camera gets a virtual keyframe at its stamp, interpolated between its
// own poses before and after; the two are constrained to each other rigidly. Nodes are poses of the robot's base, so such an extrinsic
// constraint says that the two are the same pose.

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
  double tie_m = 0.004, tie_rad = 0.002;
  double acceleration_m_per_s2 = 0.5, acceleration_rad_per_s2 = 1.0;
  double step_m = kCovisibleMotion.step_m, step_share = kCovisibleMotion.step_share, step_rad = kCovisibleMotion.step_rad;
  double step_scale = 0.05;
  double wheels_share = 0.02;
  int least_shared = kCovisibleMotion.least_shared;
  double wrong_m = 0.05, wrong_share = 0.12, wrong_rad = 0.05;
  double most_wrong = 0.5;
  RobotTrajectoryOptions way;
  template <class Visitor>
  void describe(Visitor& v) {
    v.flag("enabled", enabled, "merge the maps of the cameras of one robot; off: each camera has maps of its own");
    v.positive("longest_gap_s", longest_gap_s, "longest time between the two poses that a virtual keyframe is interpolated from");
    v.positive("least_common_s", least_common_s, "least time that a session and another camera's have in common to be merged");
    v.positive("threshold_m", threshold_m, "the rig's graph is solved where two of its cameras are farther apart than this");
    v.positive("threshold_rad", threshold_rad, "the rig's graph is solved where headings of two of its cameras differ by more than this");
    v.positive("tie_m", tie_m, "standard deviation of an extrinsic constraint between two cameras: errors of extrinsics and of stamps");
    v.positive("tie_rad", tie_rad, "standard deviation of the heading of an extrinsic constraint between two cameras");
    v.positive("acceleration_m_per_s2", acceleration_m_per_s2,
               "acceleration of the robot between the two poses that a virtual keyframe is interpolated from");
    v.positive("acceleration_rad_per_s2", acceleration_rad_per_s2,
               "angular acceleration of the robot between the two poses that a virtual keyframe is interpolated from");
    v.positive("step_m", step_m, "standard deviation of the motion between two covisible keyframes");
    v.non_negative("step_share", step_share, "standard deviation of the motion between two covisible keyframes, as a share of its length");
    v.positive("step_rad", step_rad, "standard deviation of the heading between two covisible keyframes");
    v.positive("step_scale", step_scale, "share by which the scale of a camera without depth drifts from one keyframe to the next");
    v.positive("wheels_share", wheels_share, "error of wheel odometry where it gives the scale, as a share of motion and of turns");
    v.integer("least_shared", least_shared, 1, 100000, "least number of landmarks that two covisible keyframes share");
    v.positive("wrong_m", wrong_m, "motions of two cameras at the same time that differ by more than this contradict each other");
    v.non_negative("wrong_share", wrong_share, "share of a motion's length that is added to wrong_m");
    v.positive("wrong_rad", wrong_rad, "motions of two cameras whose headings differ by more than this contradict each other");
    v.fraction("most_wrong", most_wrong, "share of motions that may contradict; more mean wrong extrinsics, and the maps stay apart");
    v.section("way", way, "the robot's trajectory by all of its cameras");
  }
};

// A session of a camera, in its own map's frame.
struct RigMember {
  std::string camera;               // its name; sessions of one camera are not constrained to each other
  Map map;                          // keyframes and landmarks
  std::vector<StampedPose> frames;  // by stamp; none: the keyframes are the trajectory
};

struct RigMap {
  Map map;                                       // with covisibility and extrinsic constraints; the id of the first member
  std::vector<std::size_t> members;              // numbers; the first one gave the frame, and its first node does not move
  std::vector<std::vector<StampedPose>> frames;  // of these members, in the map; of keyframes where they had none
  std::size_t extrinsic_constraints = 0;
  double apart_before_m = 0.0, apart_after_m = 0.0;  // root mean square error of the extrinsic constraints
  bool solved = false;                               // past the threshold
};

struct RigMerge {
  std::vector<RigMap> maps;        // the one with most frames first
  std::vector<std::string> notes;  // why cameras stayed apart, for people
};

// Members of one robot; those without nodes are left out. A camera with depth gives the scale to those without; where none has depth, wheel
// odometry does. odometry: of the robot, in a frame of its own; may be empty. Motions that odometry contradicts count less. Pure.
RigMerge merge_rig(const std::vector<RigMember>& members, const std::vector<StampedPose>& odometry, const RigOptions& options = {});

}  // namespace mapweave::rig
