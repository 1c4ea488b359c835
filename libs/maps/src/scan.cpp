#include <mapweave/core/error.h>
#include <mapweave/maps/scan.h>

#include <algorithm>
#include <cmath>

namespace mapweave {

bool operator==(const ScanGeometry& a, const ScanGeometry& b) {
  return a.first_angle_rad == b.first_angle_rad && a.angle_step_rad == b.angle_step_rad && a.ray_count == b.ray_count &&
         a.max_range_m == b.max_range_m && a.range_unit_m == b.range_unit_m &&
         a.robot_from_laser.t == b.robot_from_laser.t &&
         a.robot_from_laser.q.coeffs() == b.robot_from_laser.q.coeffs() && a.first_ray_s == b.first_ray_s &&
         a.ray_step_s == b.ray_step_s;
}

bool operator==(const SweepMotion& a, const SweepMotion& b) {
  return a.x_mm_s == b.x_mm_s && a.y_mm_s == b.y_mm_s && a.yaw_mrad_s == b.yaw_mrad_s;
}

SweepMotion sweep_motion(const Pose2& velocity) {
  MAPWEAVE_EXPECT(is_finite(velocity), "a velocity is finite");
  const auto thousandths = [](double value) {
    return static_cast<std::int16_t>(std::lround(std::clamp(1e3 * value, -32000.0, 32000.0)));
  };
  return {thousandths(velocity.x), thousandths(velocity.y), thousandths(velocity.phi)};
}

Pose2 moved(const SweepMotion& motion, double seconds) {
  const double step = 1e-3 * seconds, turn = step * motion.yaw_mrad_s, x = step * motion.x_mm_s,
               y = step * motion.y_mm_s;
  // Along an arc, whose chord leaves at half of the turn.
  const double c = std::cos(0.5 * turn), s = std::sin(0.5 * turn);
  return {c * x - s * y, s * x + c * y, turn};
}

std::vector<ScanPoint> points_in_robot(const PackedScan& scan, double min_range_m, double max_range_m) {
  MAPWEAVE_EXPECT(scan.geometry != nullptr && scan.ranges.size() == scan.geometry->ray_count,
                  "a scan has one range per ray of its geometry");
  const ScanGeometry& geometry = *scan.geometry;
  const Eigen::Matrix3d rotation = geometry.robot_from_laser.q.toRotationMatrix();
  const Eigen::Vector3d& origin = geometry.robot_from_laser.t;
  const bool bent = geometry.has_sweep() && !scan.motion.is_zero();
  std::vector<ScanPoint> points;
  points.reserve(scan.ranges.size());
  for (std::size_t ray = 0; ray < scan.ranges.size(); ++ray) {
    if (scan.ranges[ray] == 0) continue;
    const double range = scan.ranges[ray] * geometry.range_unit_m;
    if (range < min_range_m || range > max_range_m || range >= geometry.max_range_m) continue;
    const double angle = geometry.first_angle_rad + static_cast<double>(ray) * geometry.angle_step_rad;
    const double x = range * std::cos(angle), y = range * std::sin(angle);
    ScanPoint point{static_cast<float>(origin.x() + rotation(0, 0) * x + rotation(0, 1) * y),
                    static_cast<float>(origin.y() + rotation(1, 0) * x + rotation(1, 1) * y)};
    if (bent) {
      const Pose2 stamp_from_robot = moved(scan.motion, geometry.ray_time_s(ray));
      const double c = std::cos(stamp_from_robot.phi), s = std::sin(stamp_from_robot.phi);
      point = {static_cast<float>(stamp_from_robot.x + c * point.x - s * point.y),
               static_cast<float>(stamp_from_robot.y + s * point.x + c * point.y)};
    }
    points.push_back(point);
  }
  return points;
}

}  // namespace mapweave
