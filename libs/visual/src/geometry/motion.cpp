#include "motion.h"

namespace mapweave::visual {

Motion motion_of(const View& later_from_earlier, double interval_s) {
  if (!(interval_s > 0.0 && interval_s < kLongestInterval_s)) return {};
  const Eigen::AngleAxisd turn(later_from_earlier.rotation);
  return {later_from_earlier.translation / interval_s, turn.angle() * turn.axis() / interval_s};
}

Eigen::Vector2d row_flow(const Pinhole& camera, const Motion& motion, const Eigen::Vector2d& pixel, double depth_m) {
  const double share = (pixel.y() - 0.5 * camera.height) / camera.height;
  const Eigen::Vector3d point = camera.ray(pixel) * depth_m, speed = motion.speed_of(point);
  return share / depth_m *
         Eigen::Vector2d(camera.fx * (speed.x() - speed.z() * point.x() / depth_m),
                         camera.fy * (speed.y() - speed.z() * point.y() / depth_m));
}

}  // namespace mapweave::visual
