#pragma once
// A rectified camera, and what its sensor does wrong. Frame `camera`: x right, y down, z forward. Pixels: the centre of
// the upper left one is (0, 0).

#include <Eigen/Core>

namespace mapweave {

// Depths in front of a camera. Nearer than the first, no landmark is looked for in its picture: a pose that is a
// millimetre off moves it there by a hundredth of the focal length. While a pose is being found, what was farther at
// first may come nearer; only what is all but in the camera's own plane is left out.
inline constexpr double kNearest_m = 0.1;
inline constexpr double kNearestAligned_m = 0.05;  // where pictures are aligned, and depths varied
inline constexpr double kNearestSolved_m = 0.02;   // in least squares
// A ray of length 1 or so that was turned into another camera's frame: its depth. Less is far aside, or behind.
inline constexpr double kLeastForward = 0.1;

struct Pinhole {
  int width = 0, height = 0;
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
  Eigen::Vector2d project(const Eigen::Vector3d& point_in_camera) const {  // z > 0
    return {fx * point_in_camera.x() / point_in_camera.z() + cx, fy * point_in_camera.y() / point_in_camera.z() + cy};
  }
  Eigen::Vector3d ray(const Eigen::Vector2d& pixel) const {
    return {(pixel.x() - cx) / fx, (pixel.y() - cy) / fy, 1.0};
  }  // z = 1
  bool shows(const Eigen::Vector2d& pixel) const {
    return pixel.x() >= 0.0 && pixel.y() >= 0.0 && pixel.x() <= width - 1.0 && pixel.y() <= height - 1.0;
  }
};

// Systematic errors of a sensor: unknown beforehand, estimated with the map.
struct SensorCalibration {
  double readout_s = 0.0;             // from the first row to the last (rolling shutter)
  double inverse_depth_offset = 0.0;  // measured less true, 1/m
};

}  // namespace mapweave
