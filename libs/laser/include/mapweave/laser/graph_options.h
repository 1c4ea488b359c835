#pragma once
// Options of the engine `graph`.

#include <mapweave/graph/pose_graph.h>
#include <mapweave/maps/map_noise.h>
#include <mapweave/matching/judge.h>
#include <mapweave/matching/rematch.h>

namespace mapweave::laser {

struct FrontEndOptions {
  double min_range_m = 0.1;
  double max_range_m = 40.0;
  double thinning_m = 0.05;
  int most_points = 180;
  double window_m = 0.3;
  double window_yaw_rad = 0.21;
  double insert_distance_m = 0.05;
  double insert_yaw_rad = 0.026;
  double submap_length_m = 8.0;
  int submap_scans = 600;
  double odometry_sigma_m = 0.02;
  double odometry_sigma_per_m = 0.10;
  double odometry_sigma_yaw_rad = 0.01;
  double odometry_sigma_yaw_per_rad = 0.15;
  double point_information_scale = 0.05;
  double min_inliers = 0.35;
  int lost_scans = 10;
  template <class Visitor>
  void describe(Visitor& v) {
    v.non_negative("min_range_m", min_range_m, "nearer returns are left out (the robot's own body)");
    v.positive("max_range_m", max_range_m, "farther returns are left out");
    v.positive("thinning_m", thinning_m, "points of a scan nearer than this to the one before are not matched");
    v.integer("most_points", most_points, 20, 250, "points of a scan that are matched");
    v.positive("window_m", window_m, "searched around where odometry says the robot is");
    v.positive("window_yaw_rad", window_yaw_rad,
               "searched around where odometry says the robot looks; wheels miss turns of several degrees");
    v.positive("insert_distance_m", insert_distance_m, "a scan becomes part of submaps after this much motion");
    v.positive("insert_yaw_rad", insert_yaw_rad, "or after this much turning");
    v.number("submap_length_m", submap_length_m, 1.0, 100.0, "path after which a submap is closed; the next one starts half-way");
    v.integer("submap_scans", submap_scans, 10, 100000, "scans after which a submap is closed whatever its path");
    v.positive("odometry_sigma_m", odometry_sigma_m, "error of the odometry's path between two scans, standing");
    v.non_negative("odometry_sigma_per_m", odometry_sigma_per_m, "and per metre");
    v.positive("odometry_sigma_yaw_rad", odometry_sigma_yaw_rad, "error of the odometry's heading between two scans, standing");
    v.non_negative("odometry_sigma_yaw_per_rad", odometry_sigma_yaw_per_rad, "and per radian turned");
    v.fraction("point_information_scale", point_information_scale, "weight of a point, against one whose error is its own");
    v.integer("lost_scans", lost_scans, 1, 100000, "scans without odometry that fit nowhere, after which a new piece of map begins");
    v.fraction("min_inliers", min_inliers, "a match with a smaller share of fitting points is not believed");
  }
};

struct LoopOptions {
  double drift_per_m = kPathDrift_per_m;
  double drift_yaw_per_submap_rad = kSubmapTurn_rad;
  double max_radius_m = 15.0;
  int nearest = 6;
  int alike = 3;
  double confirm_radius_m = 2.0;
  double min_probability = 0.5;
  int cache_mb = 64;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("drift_per_m", drift_per_m, "how uncertain a path grows, for the window in which loops are looked for");
    v.positive("drift_yaw_per_submap_rad", drift_yaw_per_submap_rad, "the same for the heading");
    v.positive("max_radius_m", max_radius_m, "no loop is looked for in a wider window");
    v.integer("nearest", nearest, 0, 1000, "submaps searched for each new one: the nearest");
    v.integer("alike", alike, 0, 1000, "and those that look most alike");
    v.positive("confirm_radius_m", confirm_radius_m, "a loop found in a window wider than this waits for a second one that agrees");
    v.fraction("min_probability", min_probability, "of a loop, to be considered");
    v.integer("cache_mb", cache_mb, 1, 100000, "memory for submaps that are ready to be searched");
  }
};

// What a log does not say of when its rays were measured.
struct SweepOptions {
  bool estimate = true;
  double delay_s = 0.0;
  double shortest_s = 0.03;
  double min_sigmas = 5.0;

  template <class Visitor>
  void describe(Visitor& v) {
    v.flag("estimate", estimate,
           "where no option says how long the laser takes to turn, learn it while the robot turns, and how late its scans are stamped");
    v.number("delay_s", delay_s, -1.0, 1.0, "scans show what was there this long before their stamp; an estimate takes its place");
    v.positive("shortest_s", shortest_s, "shorter sweeps and delays count as none");
    v.positive("min_sigmas", min_sigmas, "an estimate is believed from this many standard deviations");
  }
};

struct GraphMapperOptions {
  FrontEndOptions front_end;
  SweepOptions sweep;
  LoopOptions loops;
  matching::JudgeOptions judge;
  matching::RematchOptions rematch;
  graph::SolveOptions solve;
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("front_end", front_end, "matching each scan to the submap under way");
    v.section("sweep", sweep, "scans bent by motion, because the laser takes time to turn");
    v.section("loops", loops, "where loops are looked for");
    v.section("judge", judge, "when two submaps show the same place");
    v.section("rematch", rematch, "matching every scan again once the loops are closed");
    v.section("solve", solve, "the pose graph");
  }
};

}  // namespace mapweave::laser
