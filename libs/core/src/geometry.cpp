#include <mapweave/core/geometry.h>

namespace mapweave {

Pose3 spatial(const Pose2& pose) {
  return {Eigen::Vector3d(pose.x, pose.y, 0.0),
          Eigen::Quaterniond(std::cos(0.5 * pose.phi), 0.0, 0.0, std::sin(0.5 * pose.phi))};
}

Pose2 planar(const Pose3& pose) {
  const Eigen::Vector3d x_axis = pose.q * Eigen::Vector3d::UnitX();
  return {pose.t.x(), pose.t.y(), wrap_angle(std::atan2(x_axis.y(), x_axis.x()))};
}

Eigen::Matrix<double, 6, 6> spatial(const Eigen::Matrix3d& planar) {
  Eigen::Matrix<double, 6, 6> result = Eigen::Matrix<double, 6, 6>::Zero();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) result(kPlanarAxes[row], kPlanarAxes[column]) = planar(row, column);
  return result;
}

Eigen::Matrix3d planar(const Eigen::Matrix<double, 6, 6>& spatial) {
  Eigen::Matrix3d result;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 3; ++column) result(row, column) = spatial(kPlanarAxes[row], kPlanarAxes[column]);
  return result;
}

bool is_planar(const Pose3& pose) { return pose.t.z() == 0.0 && pose.q.x() == 0.0 && pose.q.y() == 0.0; }
bool is_finite(const Pose2& pose) { return std::isfinite(pose.x) && std::isfinite(pose.y) && std::isfinite(pose.phi); }

bool is_finite(const Pose3& pose) { return pose.t.allFinite() && pose.q.coeffs().allFinite(); }

}  // namespace mapweave
