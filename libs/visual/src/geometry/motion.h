#pragma once
// The camera's motion while a picture is read row by row.

#include <mapweave/core/pinhole.h>
#include <mapweave/core/view.h>

namespace mapweave::visual {

// How points move in the camera's frame.
struct Motion {
  Eigen::Vector3d translation_per_s = Eigen::Vector3d::Zero(), rotation_per_s = Eigen::Vector3d::Zero();
  Eigen::Vector3d speed_of(const Eigen::Vector3d& point_in_camera) const {
    return rotation_per_s.cross(point_in_camera) + translation_per_s;
  }
};
// Of frames so far apart nothing is known.
inline constexpr double kLongestInterval_s = 0.15;
Motion motion_of(const View& later_from_earlier, double interval_s);

// Pixels per second of readout: rows below the middle are exposed later than the frame's stamp, those above earlier.
Eigen::Vector2d row_flow(const Pinhole& camera, const Motion& motion, const Eigen::Vector2d& pixel, double depth_m);

}  // namespace mapweave::visual
