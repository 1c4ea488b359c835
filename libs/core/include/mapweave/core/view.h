#pragma once
// Where a camera stands, as hot loops want it.

#include <mapweave/core/geometry.h>

namespace mapweave {

struct View {  // camera_from_map
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();
  Eigen::Vector3d operator*(const Eigen::Vector3d& point_in_map) const { return rotation * point_in_map + translation; }
  View operator*(const View& other) const {
    return {rotation * other.rotation, rotation * other.translation + translation};
  }
  View inverse() const { return {rotation.transpose(), -(rotation.transpose() * translation)}; }
  Eigen::Vector3d centre() const { return -(rotation.transpose() * translation); }  // of the camera, in the map
};

// A view from another one whose scale grows: its translation is so much longer.
inline View stretched(View view, double scale) {
  view.translation *= scale;
  return view;
}
// exp of a small motion (translation, rotation vector) in the camera's frame, applied from the left: the new
// camera_from_map.
View moved(const View& view, const Eigen::Matrix<double, 6, 1>& motion);
View view_of(const Pose3& map_from_camera);
Pose3 pose_of(const View& view);  // map_from_camera

}  // namespace mapweave
