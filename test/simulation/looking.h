#pragma once
// Cameras for tests.

#include <mapweave/simulation/camera_model.h>

namespace mapweave::test {

// A camera's frame has z ahead; this one looks along the world's x, turned by yaw and then tipped by pitch (down) and
// roll.
inline Pose3 looking(double x, double y, double z, double yaw_rad, double pitch_rad = 0.0, double roll_rad = 0.0) {
  const Eigen::Quaterniond world_from_body = Eigen::AngleAxisd(yaw_rad, Eigen::Vector3d::UnitZ()) *
                                             Eigen::AngleAxisd(pitch_rad, Eigen::Vector3d::UnitY()) *
                                             Eigen::AngleAxisd(roll_rad, Eigen::Vector3d::UnitX());
  return {{x, y, z}, world_from_body * Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5)};
}

inline simulation::CameraIntrinsics small_camera(int width = 160, int height = 120) {
  return {width, height, 0.82 * width, 0.82 * width, 0.5 * (width - 1), 0.5 * (height - 1), {}};
}

inline std::array<double, 5> kinect_distortion() {
  return {0.262383, -0.953104, -0.005358, 0.002628, 1.163314};
}  // TUM freiburg1

}  // namespace mapweave::test
