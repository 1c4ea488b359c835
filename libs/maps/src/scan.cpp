#include <mapweave/core/error.h>
#include <mapweave/maps/scan.h>

#include <cmath>

namespace mapweave {

bool operator==(const ScanGeometry& a, const ScanGeometry& b) {
  return a.first_angle_rad == b.first_angle_rad && a.angle_step_rad == b.angle_step_rad && a.ray_count == b.ray_count &&
         a.max_range_m == b.max_range_m && a.range_unit_m == b.range_unit_m && a.robot_from_laser.t == b.robot_from_laser.t &&
         a.robot_from_laser.q.coeffs() == b.robot_from_laser.q.coeffs();
}

std::vector<ScanPoint> points_in_robot(const PackedScan& scan, double min_range_m, double max_range_m) {
  MAPWEAVE_EXPECT(scan.geometry != nullptr && scan.ranges.size() == scan.geometry->ray_count,
                  "a scan has one range per ray of its geometry");
  const ScanGeometry& geometry = *scan.geometry;
  const Eigen::Matrix3d rotation = geometry.robot_from_laser.q.toRotationMatrix();
  const Eigen::Vector3d& origin = geometry.robot_from_laser.t;
  std::vector<ScanPoint> points;
  points.reserve(scan.ranges.size());
  for (std::size_t ray = 0; ray < scan.ranges.size(); ++ray) {
    if (scan.ranges[ray] == 0) continue;
    const double range = scan.ranges[ray] * geometry.range_unit_m;
    if (range < min_range_m || range > max_range_m || range >= geometry.max_range_m) continue;
    const double angle = geometry.first_angle_rad + static_cast<double>(ray) * geometry.angle_step_rad;
    const double x = range * std::cos(angle), y = range * std::sin(angle);
    points.push_back({static_cast<float>(origin.x() + rotation(0, 0) * x + rotation(0, 1) * y),
                      static_cast<float>(origin.y() + rotation(1, 0) * x + rotation(1, 1) * y)});
  }
  return points;
}

}  // namespace mapweave
