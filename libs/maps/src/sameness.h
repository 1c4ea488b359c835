#pragma once
// Bit for bit: what the byte form tells apart is different.

#include <mapweave/maps/map.h>

#include <algorithm>
#include <cstring>

namespace mapweave {

inline bool same(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0; }
inline bool same(const Pose3& a, const Pose3& b) {
  return std::memcmp(a.t.data(), b.t.data(), 3 * sizeof(double)) == 0 &&
         std::memcmp(a.q.coeffs().data(), b.q.coeffs().data(), 4 * sizeof(double)) == 0;
}
inline bool same(const Eigen::Matrix<double, 6, 6>& a, const Eigen::Matrix<double, 6, 6>& b) {
  return std::memcmp(a.data(), b.data(), 36 * sizeof(double)) == 0;
}
inline bool same(const ScanGeometry& a, const ScanGeometry& b) {
  return same(a.first_angle_rad, b.first_angle_rad) && same(a.angle_step_rad, b.angle_step_rad) &&
         a.ray_count == b.ray_count && same(a.max_range_m, b.max_range_m) && same(a.range_unit_m, b.range_unit_m) &&
         same(a.robot_from_laser, b.robot_from_laser) && same(a.first_ray_s, b.first_ray_s) &&
         same(a.ray_step_s, b.ray_step_s);
}
inline bool same(const PackedScan& a, const PackedScan& b) {
  return (a.geometry == b.geometry || same(*a.geometry, *b.geometry)) && a.ranges == b.ranges && a.motion == b.motion;
}
inline bool same(const OccupancyGrid& a, const OccupancyGrid& b) {
  return same(a.resolution_m, b.resolution_m) && same(a.origin_x_m, b.origin_x_m) && same(a.origin_y_m, b.origin_y_m) &&
         a.columns == b.columns && a.rows == b.rows && a.log_odds == b.log_odds;
}
inline bool same(const CameraGeometry& a, const CameraGeometry& b) {
  return a.width == b.width && a.height == b.height && same(a.fx, b.fx) && same(a.fy, b.fy) && same(a.cx, b.cx) &&
         same(a.cy, b.cy) && same(a.baseline_m, b.baseline_m) && same(a.level_scale, b.level_scale) &&
         same(a.robot_from_camera, b.robot_from_camera);
}
inline bool same(const KeyframePoint& a, const KeyframePoint& b) { return std::memcmp(&a, &b, sizeof a) == 0; }
inline bool same(const KeyframeFeatures& a, const KeyframeFeatures& b) {
  return (a.geometry == b.geometry || same(*a.geometry, *b.geometry)) && a.descriptors == b.descriptors &&
         std::equal(a.points.begin(), a.points.end(), b.points.begin(), b.points.end(),
                    [](const KeyframePoint& left, const KeyframePoint& right) { return same(left, right); });
}
inline bool same(const LandmarkSighting& a, const LandmarkSighting& b) {
  return a.node == b.node && a.u == b.u && a.v == b.v && a.inverse_depth == b.inverse_depth && a.level == b.level;
}
inline bool same(const std::shared_ptr<const Payload>& a, const std::shared_ptr<const Payload>& b) {
  if (a == b) return true;
  if (!a || !b || a->index() != b->index()) return false;
  return std::visit([&](const auto& content) { return same(content, std::get<std::decay_t<decltype(content)>>(*b)); },
                    *a);
}
inline bool same(const Submap& a, const Submap& b) {
  return a.id == b.id && a.frozen == b.frozen && a.content == b.content &&
         std::equal(a.submap_from_node.begin(), a.submap_from_node.end(), b.submap_from_node.begin(),
                    b.submap_from_node.end(), [](const auto& left, const auto& right) {
                      return left.first == right.first && same(left.second, right.second);
                    });
}
inline bool same(const Constraint& a, const Constraint& b) {
  return a.id == b.id && same(a.from_from_to.pose, b.from_from_to.pose) &&
         same(a.from_from_to.scale, b.from_from_to.scale) && same(a.information, b.information) &&
         a.because == b.because;
}

}  // namespace mapweave
