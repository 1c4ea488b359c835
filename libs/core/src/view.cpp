#include <mapweave/core/view.h>

namespace mapweave {

View moved(const View& view, const Eigen::Matrix<double, 6, 1>& motion) {
  const Eigen::Vector3d turn = motion.tail<3>();
  const double angle = turn.norm();
  const Eigen::Matrix3d rotation =
      angle < 1e-12 ? Eigen::Matrix3d::Identity() : Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  // Through a quaternion, so that rotations stay rotations.
  const Eigen::Matrix3d turned = Eigen::Quaterniond(rotation * view.rotation).normalized().toRotationMatrix();
  return {turned, rotation * view.translation + motion.head<3>()};
}

View view_of(const Pose3& map_from_camera) {
  const Eigen::Matrix3d rotation = map_from_camera.q.conjugate().toRotationMatrix();
  return {rotation, -(rotation * map_from_camera.t)};
}

Pose3 pose_of(const View& view) { return {view.centre(), Eigen::Quaterniond(view.rotation.transpose()).normalized()}; }

}  // namespace mapweave
