#pragma once
// A trajectory with its scans becomes a map of frozen submaps: for engines that answer with poses alone.

#include <mapweave/maps/map.h>

#include <optional>
#include <vector>

namespace mapweave::laser {

// Variances grow with the path, as a random walk's do, so that a chain of constraints means the same however dense its
// nodes are.
struct MotionNoiseOptions {
  double m_per_sqrt_m = 0.02;
  double rad_per_sqrt_m = 0.003;
  double rad_per_sqrt_rad = 0.01;

  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("m_per_sqrt_m", m_per_sqrt_m,
               "standard deviation of the position in metres after 1 m of motion; grows with the square root of the "
               "path; larger values trust this motion less");
    v.positive("rad_per_sqrt_m", rad_per_sqrt_m,
               "standard deviation of the heading in radians after 1 m of motion; grows with the square root of the "
               "path; larger values trust this motion less");
    v.positive("rad_per_sqrt_rad", rad_per_sqrt_rad,
               "standard deviation of the heading in radians after turning by 1 rad; grows with the square root of the "
               "turn; larger values trust this motion less");
  }
};

struct SubmapCutterOptions {
  double scan_distance_m = 0.1;
  double scan_yaw_rad = 0.1;
  std::int32_t min_returns = 10;
  double submap_length_m = 7.0;
  MotionNoiseOptions scan_match;
  MotionNoiseOptions odometry{0.07, 0.03, 0.1};

  template <class Visitor>
  void describe(Visitor& v) {
    v.non_negative("scan_distance_m", scan_distance_m,
                   "a scan becomes part of a submap after this much motion in metres since the last one that did; "
                   "larger values keep fewer scans");
    v.non_negative("scan_yaw_rad", scan_yaw_rad,
                   "a scan becomes part of a submap after this much turning in radians since the last one that did; "
                   "larger values keep fewer scans");
    v.integer("min_returns", min_returns, 1, 100000,
              "least number of returns of a scan to become part of a submap; larger values leave more scans out");
    v.positive("submap_length_m", submap_length_m,
               "length in metres of the path in one submap; the next submap begins half-way, so that neighbours "
               "overlap; larger values make fewer submaps, which are easier to recognise and contain more drift");
    v.section("scan_match", scan_match,
              "noise of the motion between two scans as the engine (rbpf or icp) estimates it");
    v.section("odometry", odometry, "noise of the motion between two scans as wheel odometry measures it");
  }
};

struct TrackedScan {
  Stamp stamp;
  PackedScan scan;
  Pose2 map_from_robot;                     // the engine's answer
  std::optional<Pose2> previous_from_this;  // motion since the previous scan as the wheels measured it
};

// A node per scan, numbered from 0 in their order; constraints scan_match and (where wheels measured) odometry between
// neighbours; submaps of submap_length_m along the path, each half overlapping the one before, all frozen. The map's
// frame becomes the first scan's pose. Memory: the scans that become content, and about 500 bytes a scan.
Map cut_into_submaps(const MapId&, const SessionId&, std::vector<TrackedScan> scans, const SubmapCutterOptions& = {});

}  // namespace mapweave::laser
