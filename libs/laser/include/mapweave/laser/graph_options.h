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
  double inertial_sigma_yaw_rad = 0.01;
  double inertial_sigma_yaw_per_rad = 0.05;
  double point_information_scale = 0.05;
  double min_inliers = 0.35;
  int lost_scans = 10;
  template <class Visitor>
  void describe(Visitor& v) {
    v.non_negative("min_range_m", min_range_m,
                   "laser returns nearer than this distance in metres are left out, because they show the robot's own "
                   "body; larger values drop more returns");
    v.positive("max_range_m", max_range_m,
               "laser returns farther than this distance in metres are left out of maps and matching; larger values "
               "use more returns, which are less accurate far away");
    v.positive("thinning_m", thinning_m,
               "points of a scan nearer than this distance in metres to the last kept one are not matched; larger "
               "values match fewer points and are faster");
    v.integer("most_points", most_points, 20, 250,
              "most points of one scan that are matched; larger values are more accurate and slower");
    v.positive("window_m", window_m,
               "half the side, in metres, of the window around the pose predicted by odometry in which a scan is "
               "searched for; larger values survive worse odometry and take longer");
    v.positive("window_yaw_rad", window_yaw_rad,
               "largest deviation in radians from the heading predicted by odometry that is searched; wheel odometry "
               "misses turns by several degrees; larger values survive worse odometry and take longer");
    v.positive("insert_distance_m", insert_distance_m,
               "a scan is inserted into the current submaps after the robot moved this far in metres since the last "
               "inserted one; larger values insert fewer scans and are faster");
    v.positive("insert_yaw_rad", insert_yaw_rad,
               "a scan is inserted into the current submaps after the robot turned by this angle in radians since the "
               "last inserted one; larger values insert fewer scans and are faster");
    v.number("submap_length_m", submap_length_m, 1.0, 100.0,
             "length in metres of the path in one submap; the next submap begins half-way, so that neighbours overlap; "
             "larger values make fewer submaps, which are easier to recognise and contain more drift");
    v.integer("submap_scans", submap_scans, 10, 100000,
              "most scans in one submap, however short its path: bounds the size of submaps of a robot that stands "
              "still or turns; larger values make fewer submaps");
    v.positive("odometry_sigma_m", odometry_sigma_m,
               "standard deviation in metres of the position from odometry between two scans of a robot that stands "
               "still; larger values trust the laser more");
    v.non_negative("odometry_sigma_per_m", odometry_sigma_per_m,
                   "growth of the odometry's position error in metres per metre driven between two scans; larger "
                   "values trust the laser "
                   "more");
    v.positive("odometry_sigma_yaw_rad", odometry_sigma_yaw_rad,
               "standard deviation in radians of the heading from odometry between two scans of a robot that stands "
               "still; larger values trust the laser more");
    v.non_negative("odometry_sigma_yaw_per_rad", odometry_sigma_yaw_per_rad,
                   "growth of the odometry's heading error in radians per radian turned between two scans; larger "
                   "values trust the laser "
                   "more");
    v.positive(
        "inertial_sigma_yaw_rad", inertial_sigma_yaw_rad,
        "standard deviation in radians of the turn by the inertial unit between two scans of a robot that drives "
        "straight, before it is learned from the scans; larger values trust the laser more");
    v.non_negative("inertial_sigma_yaw_per_rad", inertial_sigma_yaw_per_rad,
                   "growth of the inertial unit's error in radians per radian turned between two scans, before it is "
                   "learned from the scans; larger values trust the laser more");
    v.fraction("point_information_scale", point_information_scale,
               "information of a scan match relative to that of points with independent errors; below 1, because the "
               "points of a scan share errors; where the headings of matches are seen to be better, up to 0.5; larger "
               "values trust scan matches more");
    v.integer("lost_scans", lost_scans, 1, 100000,
              "number of consecutive scans without odometry that match nowhere after which a new, unconnected piece of "
              "map begins; larger values begin a new piece later");
    v.fraction("min_inliers", min_inliers,
               "least share of a scan's points that must lie on walls of the submap for the match to be believed; "
               "larger values follow odometry more often");
  }
};

struct LaserLoopOptions {
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
    v.positive("drift_per_m", drift_per_m,
               "growth of the position error in metres per metre of path; larger values search for loop closures "
               "farther around the estimate, take longer and let them bend the path more");
    v.positive("drift_yaw_per_submap_rad", drift_yaw_per_submap_rad,
               "growth of the heading error in radians from one submap to the next; larger values search for loop "
               "closures farther around the estimate, take longer and let them bend the path more");
    v.positive("max_radius_m", max_radius_m,
               "largest radius in metres around the estimate in which loop closures are searched for, however long the "
               "path was; larger values correct larger drift and take longer");
    v.integer("nearest", nearest, 0, 1000,
              "number of nearest earlier submaps that are searched for a loop closure when a submap is finished; "
              "larger values find more loop closures and take longer");
    v.integer("alike", alike, 0, 1000,
              "number of most similar earlier submaps, by their descriptors, that are searched for a loop closure when "
              "a submap is finished; larger values find more loop closures and take longer");
    v.positive("confirm_radius_m", confirm_radius_m,
               "search radius in metres beyond which a loop closure is believed only once a second one agrees with it; "
               "larger values believe more single ones");
    v.fraction("min_probability", min_probability,
               "least probability of a loop closure, by its walls, to be considered; larger values close fewer loops");
    v.integer("cache_mb", cache_mb, 1, 100000,
              "memory in megabytes for submaps that are kept ready for matching; larger values are faster and give the "
              "same map");
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
           "estimate from the scans of a turning robot how long the laser takes for one sweep and how late its stamps "
           "are, where no "
           "option gives the sweep");
    v.number("delay_s", delay_s, -1.0, 1.0,
             "time in seconds from when a scan was taken to its stamp, for undistorting it by the robot's motion; "
             "larger values mean later stamps; an estimate replaces it");
    v.positive("shortest_s", shortest_s,
               "sweep times and delays below this time in seconds count as zero, since they bend scans less than noise "
               "does; larger values correct fewer lasers");
    v.positive("min_sigmas", min_sigmas,
               "an estimated sweep time or delay is used once it is this many standard deviations away from zero; "
               "larger values need more turns of the robot before scans are corrected");
  }
};

struct GraphMapperOptions {
  FrontEndOptions front_end;
  SweepOptions sweep;
  LaserLoopOptions loops;
  matching::JudgeOptions judge;
  matching::RematchOptions rematch;
  graph::SolveOptions solve;
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("front_end", front_end, "matching each scan to the current submaps, with odometry as prior");
    v.section("sweep", sweep, "distortion of scans by the robot's motion while the laser sweeps");
    v.section("loops", loops, "search for loop closures between submaps of one robot");
    v.section("judge", judge, "when two submaps of one robot are taken for the same place");
    v.section("rematch", rematch, "matching every scan to nearby submaps again once loops are closed");
    v.section("solve", solve, "optimisation of one robot's pose graph");
  }
};

}  // namespace mapweave::laser
