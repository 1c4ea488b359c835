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
  // A laser takes time to turn. When ray 0 was measured, in seconds after the scan's stamp, and the time from each ray
  // to the next; negative where the rays were measured in the opposite order. Both 0: all rays at the stamp, or not
  // known.
  double first_ray_s = 0.0;
  double ray_step_s = 0.0;
  bool has_sweep() const { return first_ray_s != 0.0 || ray_step_s != 0.0; }
  double ray_time_s(std::size_t ray) const {
    return first_ray_s + static_cast<double>(ray) * ray_step_s;
  }  // after the stamp
};
bool operator==(const ScanGeometry&, const ScanGeometry&);

// How the robot moved while the laser turned: even motion in the robot's frame at the stamp.
struct SweepMotion {
  std::int16_t x_mm_s = 0, y_mm_s = 0;  // millimetres per second
  std::int16_t yaw_mrad_s = 0;          // thousandths of a radian per second, counter-clockwise
  bool is_zero() const { return x_mm_s == 0 && y_mm_s == 0 && yaw_mrad_s == 0; }
};
bool operator==(const SweepMotion&, const SweepMotion&);
// Rounded, and limited to 32 m/s and 32 rad/s. `velocity`: per second.
SweepMotion sweep_motion(const Pose2& velocity);
// The motion within `seconds`: stamp_from_robot at that time after the stamp. phi is not wrapped.
Pose2 moved(const SweepMotion&, double seconds);

// Immutable once shared.
struct PackedScan {
  std::shared_ptr<const ScanGeometry> geometry;
  std::vector<std::uint16_t> ranges;  // geometry->ray_count of them, as measured; 0: no return, or invalid
  SweepMotion motion = {};            // zero where the geometry has no sweep
};

// A ray's end seen from above.
struct ScanPoint {
  float x, y;  // metres, robot frame
};

// The ends of all rays with a return, where they lie in the robot's frame at the stamp, in ray order; rays nearer than
// `min_range_m` or farther than `max_range_m` left out. Tilted and upside-down lasers are projected on the ground
// plane.
std::vector<ScanPoint> points_in_robot(const PackedScan&, double min_range_m = 0.0, double max_range_m = 1e9);

}  // namespace mapweave
