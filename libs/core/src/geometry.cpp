#include <mapweave/core/geometry.h>

namespace mapweave {

Pose3 spatial(const Pose2& pose) {
  return {Eigen::Vector3d(pose.x, pose.y, 0.0), Eigen::Quaterniond(std::cos(0.5 * pose.phi), 0.0, 0.0, std::sin(0.5 * pose.phi))};
}

Pose2 planar(const Pose3& pose) {
  const Eigen::Vector3d x_axis = pose.q * Eigen::Vector3d::UnitX();
  return {pose.t.x(), pose.t.y(), wrap_angle(std::atan2(x_axis.y(), x_axis.x()))};
}

bool is_finite(const Pose2& pose) { return std::isfinite(pose.x) && std::isfinite(pose.y) && std::isfinite(pose.phi); }

bool is_finite(const Pose3& pose) { return pose.t.allFinite() && pose.q.coeffs().allFinite(); }

}  // namespace mapweave
