#pragma once
// One sweep of a planar laser, packed.

#include <mapweave/core/geometry.h>

#include <cstdint>
#include <memory>
#include <vector>

namespace mapweave {

// What all scans of one laser share.
struct ScanGeometry {
  double first_angle_rad = 0.0;  // of ray 0 in the laser frame, counter-clockwise from its x axis
  double angle_step_rad = 0.0;   // to the next ray; negative where the laser sweeps clockwise
  std::uint32_t ray_count = 0;
  double max_range_m = 0.0;     // readings at or past it are no returns
  double range_unit_m = 0.001;  // one step of PackedScan::ranges
  Pose3 robot_from_laser;
};
bool operator==(const ScanGeometry&, const ScanGeometry&);

// Immutable once shared.
struct PackedScan {
  std::shared_ptr<const ScanGeometry> geometry;
  std::vector<std::uint16_t> ranges;  // geometry->ray_count of them; 0: no return, or invalid
};

// A ray's end seen from above.
struct ScanPoint {
  float x, y;  // metres, robot frame
};

// The ends of all rays with a return, in ray order; rays nearer than `min_range_m` or farther than `max_range_m` left out. Tilted and
// upside-down lasers are projected on the ground plane.
std::vector<ScanPoint> points_in_robot(const PackedScan&, double min_range_m = 0.0, double max_range_m = 1e9);

}  // namespace mapweave
