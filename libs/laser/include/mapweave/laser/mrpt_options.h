#pragma once
// What can be set on MRPT's engines `rbpf` and `icp`. They run in the helper mrpt_mapper; this header needs no MRPT.

#include <cstdint>

namespace mapweave::laser {

// MRPT's CICP, point to point.
struct IcpSearchOptions {
  std::int32_t iterations = 80;
  double match_distance_m = 0.5;
  double final_match_distance_m = 0.05;
  double shrink = 0.8;
  std::int32_t point_decimation = 5;

  template <class Visitor>
  void describe(Visitor& v) {
    v.integer(
        "iterations", iterations, 1, 1000,
        "most iterations of ICP for one alignment; larger values are slower and change nothing once it has converged");
    v.number("match_distance_m", match_distance_m, 0.01, 10.0,
             "largest distance in metres between the points of a pair when ICP begins; larger values tolerate larger "
             "errors of odometry");
    v.number(
        "final_match_distance_m", final_match_distance_m, 0.005, 10.0,
        "largest distance in metres between the points of a pair when ICP ends; larger values let more outliers in");
    v.number("shrink", shrink, 0.1, 0.95,
             "factor by which ICP's pairing distance shrinks each time it converges, from match_distance_m to "
             "final_match_distance_m; larger values shrink it more slowly, which is safer and takes longer");
    v.integer(
        "point_decimation", point_decimation, 1, 100,
        "every n-th point of a scan is paired by ICP; larger values are faster and less accurate, 1 uses all points");
  }
};

// The grids that the particles of `rbpf` hold.
struct ParticleGridOptions {
  double resolution_m = 0.05;
  double ray_length_m = 20.0;
  double certainty = 0.7;
  double sigma_m = 0.5;
  double match_distance_m = 0.3;
  std::int32_t ray_decimation = 5;

  template <class Visitor>
  void describe(Visitor& v) {
    v.number(
        "resolution_m", resolution_m, 0.01, 1.0,
        "side in metres of a cell of the particles' grids; larger values need less memory and time and are coarser");
    v.number("ray_length_m", ray_length_m, 0.5, 200.0,
             "longest part of a laser ray, in metres, that is drawn into the particles' grids and scored against them; "
             "larger values use more of each scan");
    v.number("certainty", certainty, 0.51, 0.99,
             "occupancy that a single ray gives to the cell it ends in; larger values make the particles' grids change "
             "faster");
    v.number("sigma_m", sigma_m, 0.01, 10.0,
             "standard deviation in metres of the likelihood field that weighs particles; larger values weigh "
             "particles more alike");
    v.number("match_distance_m", match_distance_m, 0.05, 5.0,
             "distance in metres to the nearest wall from which on the likelihood field that weighs particles is "
             "constant; larger values let points farther from walls count");
    v.integer("ray_decimation", ray_decimation, 1, 100,
              "every n-th ray of a scan is used to weigh particles; larger values are faster and less accurate, 1 uses "
              "all rays");
  }
};

// Rao-Blackwellised particle filter whose proposal comes from ICP with each particle's own map: the family of GMapping.
// A particle holds a grid, which weighs it, and the points of its walls, which scans are aligned to (MRPT aligns to
// grids as well, but only to about a wall's thickness).
struct RbpfOptions {
  std::uint32_t seed = 1;
  std::int32_t particles = 4;
  bool correct_odometry = true;
  double match_distance_m = 0.05;
  double match_yaw_rad = 0.02;
  double update_distance_m = 0.3;
  double update_yaw_rad = 0.3;
  double insert_distance_m = 1.5;
  double insert_yaw_rad = 0.8;
  double resample_below = 0.5;
  double weight_power = 1.0;
  double point_distance_m = 0.05;
  std::int32_t memory_limit_mb = 4000;
  IcpSearchOptions icp;
  ParticleGridOptions grid;

  template <class Visitor>
  void describe(Visitor& v) {
    v.integer(
        "seed", seed, 0, 4294967295,
        "seed of the particle filter's random numbers, added to the run's seed; the same seed gives the same map");
    v.integer("particles", particles, 1, 1000,
              "number of particles, each with a map; larger values survive more errors and need proportionally more "
              "time and memory");
    v.flag("correct_odometry", correct_odometry,
           "correct odometry by ICP with recent scans before the particle filter uses it");
    v.positive("match_distance_m", match_distance_m,
               "odometry is corrected by ICP each time the robot moved this far in metres; larger values match less "
               "often and are faster");
    v.positive("match_yaw_rad", match_yaw_rad,
               "odometry is corrected by ICP each time the robot turned by this angle in radians; larger values match "
               "less often and are faster");
    v.positive("update_distance_m", update_distance_m,
               "the particle filter is updated each time the robot moved this far in metres; scans between are placed "
               "by corrected odometry; larger values are faster and less accurate");
    v.positive("update_yaw_rad", update_yaw_rad,
               "the particle filter is updated each time the robot turned by this angle in radians; scans between are "
               "placed by corrected odometry; larger values are faster and less accurate");
    v.positive("insert_distance_m", insert_distance_m,
               "a scan is inserted into the particles' maps after this much motion in metres; larger values insert "
               "fewer scans, which keeps walls sharper");
    v.positive("insert_yaw_rad", insert_yaw_rad,
               "a scan is inserted into the particles' maps after this much turning in radians; larger values insert "
               "fewer scans, which keeps walls sharper");
    v.fraction(
        "resample_below", resample_below,
        "particles are resampled when the effective share of them falls below this; larger values resample more often");
    v.number("weight_power", weight_power, 0.0, 10.0,
             "exponent of a scan's likelihood when particles are weighed; larger values keep fewer hypotheses alive");
    v.number("point_distance_m", point_distance_m, 0.005, 1.0,
             "points of one scan nearer to each other than this distance in metres are inserted once into the "
             "particles' maps; larger values make coarser maps that need less memory");
    v.integer("memory_limit_mb", memory_limit_mb, 200, 1000000,
              "most memory in megabytes for the particles' maps; a robot that would need more ends with an error; "
              "larger values map longer runs");
    v.section("icp", icp, "ICP of a scan with the wall points of a particle's map");
    v.section("grid", grid, "occupancy grids by which particles are weighed");
  }
};

// MRPT's incremental ICP: quick, no loops closed; no random numbers, so no seed.
struct IcpOptions {
  double update_distance_m = 0.05;
  double update_yaw_rad = 0.02;
  double insert_distance_m = 1.0;
  double insert_yaw_rad = 0.5;
  double min_goodness = 0.4;
  double point_distance_m = 0.05;
  std::int32_t memory_limit_mb = 4000;
  IcpSearchOptions icp;

  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("update_distance_m", update_distance_m,
               "a scan is matched to the map each time the robot moved this far in metres; larger values match less "
               "often and are faster");
    v.positive("update_yaw_rad", update_yaw_rad,
               "a scan is matched to the map each time the robot turned by this angle in radians; larger values match "
               "less often and are faster");
    v.positive("insert_distance_m", insert_distance_m,
               "a scan is inserted into the map after this much motion in metres since the last inserted one; larger "
               "values insert fewer scans");
    v.positive("insert_yaw_rad", insert_yaw_rad,
               "a scan is inserted into the map after this much turning in radians since the last inserted one; larger "
               "values insert fewer scans");
    v.fraction("min_goodness", min_goodness,
               "least share of points that ICP must pair for its result to replace odometry; larger values follow "
               "odometry more often");
    v.number("point_distance_m", point_distance_m, 0.005, 1.0,
             "points of one scan nearer to each other than this distance in metres are inserted once into the map; "
             "larger values make a coarser map that needs less memory");
    v.integer("memory_limit_mb", memory_limit_mb, 200, 1000000,
              "most memory in megabytes for the map of points; a robot that would need more ends with an error; larger "
              "values map longer runs");
    v.section("icp", icp, "ICP of a scan with the wall points of the map");
  }
};

}  // namespace mapweave::laser
