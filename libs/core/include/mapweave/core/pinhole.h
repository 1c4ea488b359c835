#pragma once
// A rectified camera, and what its sensor does wrong. Frame `camera`: x right, y down, z forward. Pixels: the centre of
// the upper left one is (0, 0).

#include <Eigen/Core>

namespace mapweave {

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
