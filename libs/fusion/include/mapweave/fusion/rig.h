#pragma once
// One map of several cameras on one robot (collaborative visual SLAM for service robots, III-D). Each camera is a client with maps of its
// own, one for each session. For each keyframe of one camera another one gets a virtual keyframe at its stamp, interpolated between where
// it knows to have been before and after; the two are tied rigidly. Nodes are poses of the robot's base, so a tie says that they are the
// same.

#include <mapweave/core/stamped_pose.h>
#include <mapweave/fusion/robot_way.h>
#include <mapweave/maps/map.h>

#include <string>
#include <vector>

namespace mapweave::fusion {

struct RigOptions {
  bool enabled = true;
  double longest_gap_s = 1.0;
  double least_common_s = 1.0;
  double threshold_m = 0.01, threshold_rad = 0.005;
  double tie_m = 0.004, tie_rad = 0.002;
  double acceleration_m_per_s2 = 0.5, acceleration_rad_per_s2 = 1.0;
  double step_m = 0.006, step_share = 0.015, step_rad = 0.003;
  double step_scale = 0.05;
  double wheels_share = 0.02;
  int least_shared = 15;
  double wrong_m = 0.05, wrong_share = 0.12, wrong_rad = 0.05;
  double most_wrong = 0.5;
  RobotWayOptions way;
  template <class Visitor>
  void describe(Visitor& v) {
    v.flag("enabled", enabled, "tie cameras of one robot to each other; off: each has maps of its own");
    v.positive("longest_gap_s", longest_gap_s, "between the two poses of a camera around another one's keyframe, for the two to be tied");
    v.positive("least_common_s", least_common_s, "that a session must have in common with a sibling's to be put into its map");
    v.positive("threshold_m", threshold_m, "their graph is solved where siblings are farther apart than this somewhere");
    v.positive("threshold_rad", threshold_rad, "or than this in heading");
    v.positive("tie_m", tie_m, "error of a tie: of the mounting and of stamps");
    v.positive("tie_rad", tie_rad, "the same in heading");
    v.positive("acceleration_m_per_s2", acceleration_m_per_s2,
               "of the robot between the poses that a virtual keyframe is interpolated from");
    v.positive("acceleration_rad_per_s2", acceleration_rad_per_s2, "the same of turns");
    v.positive("step_m", step_m, "error of the way from one keyframe to another that sees the same");
    v.non_negative("step_share", step_share, "and of its length");
    v.positive("step_rad", step_rad, "error of its heading");
    v.positive("step_scale", step_scale, "share by which lengths change from one to the next where a camera has no depth");
    v.positive("wheels_share", wheels_share, "of the way and of turns, that wheels may be wrong by, where they give lengths");
    v.integer("least_shared", least_shared, 1, 100000, "landmarks that two keyframes see, for the way between them to be known");
    v.positive("wrong_m", wrong_m, "a stretch of the way that two cameras tell differently by more contradicts");
    v.non_negative("wrong_share", wrong_share, "and by this share of its length");
    v.positive("wrong_rad", wrong_rad, "or by so much of heading");
    v.fraction("most_wrong", most_wrong, "of their stretches; where more contradict, the mounting is wrong, and they are not tied");
    v.section("way", way, "the robot's way by all of its cameras");
  }
};

// A session of a camera, in its own map's frame.
struct RigMember {
  std::string camera;               // its name: sessions of one are never apart by mounting, and never tied
  Map map;                          // keyframes and landmarks
  std::vector<StampedPose> frames;  // by stamp; none: keyframes tell where it was
};

struct TiedMap {
  Map map;                                       // with its steps and ties as constraints; the id of the first member
  std::vector<std::size_t> members;              // numbers; the first one gave the frame, and its first node stays
  std::vector<std::vector<StampedPose>> frames;  // of these members, in the map; of keyframes where they had none
  std::size_t ties = 0;
  double apart_before_m = 0.0, apart_after_m = 0.0;  // root mean square of what ties were off by
  bool solved = false;                               // past the threshold
};

struct TiedRig {
  std::vector<TiedMap> maps;       // the one with most frames first
  std::vector<std::string> notes;  // why siblings stayed apart, for people
};

// Members of one robot; those without nodes are left out. Depth of one camera gives lengths to those without; where none has depth, wheels
// do. odometry: of the robot, in a frame of its own; may be empty. Steps that wheels say were others count less. Pure.
TiedRig tied(const std::vector<RigMember>& members, const std::vector<StampedPose>& odometry, const RigOptions& options = {});

}  // namespace mapweave::fusion
