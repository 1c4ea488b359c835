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
    v.integer("iterations", iterations, 1, 1000, "at most so many steps per alignment");
    v.number("match_distance_m", match_distance_m, 0.01, 10.0, "pairs farther apart than this are not pairs, at the start");
    v.number("final_match_distance_m", final_match_distance_m, 0.005, 10.0, "and at the end; the distance shrinks at each convergence");
    v.number("shrink", shrink, 0.1, 0.95, "by this factor");
    v.integer("point_decimation", point_decimation, 1, 100, "one in so many points of a scan looks for a pair");
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
    v.number("resolution_m", resolution_m, 0.01, 1.0, "edge of a cell");
    v.number("ray_length_m", ray_length_m, 0.5, 200.0, "rays are drawn, and scored, up to this length");
    v.number("certainty", certainty, 0.51, 0.99, "occupancy that one ray alone gives to a cell; 0.51..0.99");
    v.number("sigma_m", sigma_m, 0.01, 10.0, "decay of the likelihood field that weighs the particles");
    v.number("match_distance_m", match_distance_m, 0.05, 5.0, "reach of that field");
    v.integer("ray_decimation", ray_decimation, 1, 100, "one ray in so many weighs");
  }
};

// Rao-Blackwellised particle filter whose proposal comes from ICP with each particle's own map: the family of GMapping. A particle holds a
// grid, which weighs it, and the points of its walls, which scans are aligned to (MRPT aligns to grids as well, but only to about a wall's
// thickness).
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
  double min_goodness = 0.5;
  double resample_below = 0.5;
  double weight_power = 1.0;
  double point_distance_m = 0.05;
  std::int32_t memory_limit_mb = 4000;
  IcpSearchOptions icp;
  ParticleGridOptions grid;

  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("seed", seed, 0, 4294967295, "of the filter's random numbers; the same seed gives the same map");
    v.integer("particles", particles, 1, 1000, "hypotheses; time and memory grow with them, each holds a map");
    v.flag("correct_odometry", correct_odometry, "odometry is first corrected by ICP with the last key scans");
    v.positive("match_distance_m", match_distance_m, "each time the robot moved so far");
    v.positive("match_yaw_rad", match_yaw_rad, "or turned so far");
    v.positive("update_distance_m", update_distance_m, "the filter runs after so much motion");
    v.positive("update_yaw_rad", update_yaw_rad, "or so much turning; scans between are placed by the (corrected) odometry");
    v.positive("insert_distance_m", insert_distance_m, "scans join the particles' maps after so much motion; more of them blur the walls");
    v.positive("insert_yaw_rad", insert_yaw_rad, "or so much turning");
    v.fraction("min_goodness", min_goodness, "share of paired points below which odometry is believed instead of ICP");
    v.fraction("resample_below", resample_below, "resample when the effective share of particles falls below this");
    v.number("weight_power", weight_power, 0.0, 10.0, "exponent on a scan's likelihood; below 1 keeps more hypotheses alive");
    v.number("point_distance_m", point_distance_m, 0.005, 1.0, "points of one scan nearer to each other than this are kept once");
    v.integer("memory_limit_mb", memory_limit_mb, 200, 1000000, "maps that would need more end this robot with an error");
    v.section("icp", icp, "alignment of a scan with a particle's points");
    v.section("grid", grid, "the particles' grids");
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
    v.positive("update_distance_m", update_distance_m, "odometry is corrected after so much motion");
    v.positive("update_yaw_rad", update_yaw_rad, "or so much turning");
    v.positive("insert_distance_m", insert_distance_m, "scans join the map after so much motion");
    v.positive("insert_yaw_rad", insert_yaw_rad, "or so much turning");
    v.fraction("min_goodness", min_goodness, "share of paired points below which a correction is not believed");
    v.number("point_distance_m", point_distance_m, 0.005, 1.0, "points of one scan nearer to each other than this are kept once");
    v.integer("memory_limit_mb", memory_limit_mb, 200, 1000000, "a map of points that needs more ends this robot with an error");
    v.section("icp", icp, "alignment of a scan with the map of points");
  }
};

}  // namespace mapweave::laser
