#pragma once
// From simulated teams to what mappers take.

#include <mapweave/maps/scan.h>
#include <mapweave/simulation/tiny_worlds.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

namespace mapweave::test {

inline std::shared_ptr<const ScanGeometry> scan_geometry(const simulation::SimulatedLaserOptions& laser) {
  ScanGeometry geometry;
  geometry.first_angle_rad = laser.first_angle_rad();
  geometry.angle_step_rad = laser.angle_step_rad();
  geometry.ray_count = static_cast<std::uint32_t>(laser.rays);
  geometry.max_range_m = laser.max_range_m;
  geometry.range_unit_m = laser.max_range_m > 60.0 ? 0.005 : 0.001;
  geometry.robot_from_laser = spatial(laser.robot_from_laser());
  return std::make_shared<const ScanGeometry>(geometry);
}

// The same, and what it should know of the sweep.
inline std::shared_ptr<const ScanGeometry> swept_geometry(const simulation::SimulatedLaserOptions& laser) {
  ScanGeometry geometry = *scan_geometry(laser);
  geometry.first_ray_s = laser.first_ray_s();
  geometry.ray_step_s = laser.ray_step_s();
  return std::make_shared<const ScanGeometry>(geometry);
}

inline PackedScan packed(const std::vector<float>& ranges_m, std::shared_ptr<const ScanGeometry> geometry) {
  PackedScan scan{std::move(geometry), {}};
  scan.ranges.reserve(ranges_m.size());
  for (const float range : ranges_m) {
    scan.ranges.push_back(static_cast<std::uint16_t>(
        std::min(65535L, std::lround(static_cast<double>(range) / scan.geometry->range_unit_m))));
  }
  return scan;
}

}  // namespace mapweave::test
