#include "driven_motion.h"

#include <algorithm>
#include <cmath>

namespace mapweave::visual {

void go_on(DrivenMotion& driven, const std::optional<Pose3>& odometry_from_camera) {
  if (driven.odometry_from_camera && odometry_from_camera) {
    const Pose3 moved = between(*driven.odometry_from_camera, *odometry_from_camera);
    driven.metres += moved.t.norm();
    driven.radians += Eigen::AngleAxisd(moved.q).angle();
  }
  driven.odometry_from_camera = odometry_from_camera;
}

Departure departure(const Station& from, const Station& to, const SessionOptions& options) {
  // Allowed whatever the time and the motion.
  constexpr double kReach_m = 0.5, kOdometry_m = 0.3, kOdometry_rad = 0.1;
  if (!from.driven.odometry_from_camera || !to.driven.odometry_from_camera)
    return {(to.view.centre() - from.view.centre()).norm(),
            kReach_m + options.carried_m_per_s * std::abs(seconds_between(from.stamp, to.stamp)),
            options.alike_m > 0.0 ? options.alike_m : kUnique_m};
  const View expected =
      view_of(between(*from.driven.odometry_from_camera, *to.driven.odometry_from_camera)) * from.view;
  const double metres = std::abs(to.driven.metres - from.driven.metres),
               radians = std::abs(to.driven.radians - from.driven.radians);
  const double reach_rad = kOdometry_rad + options.odometry_drift * radians;
  const double reach_m = kOdometry_m + (options.odometry_drift + reach_rad) * metres;
  if (!(Eigen::AngleAxisd(to.view.rotation * expected.rotation.transpose()).angle() < reach_rad))
    return {std::numeric_limits<double>::infinity(), reach_m};
  const double refused_m = from.stamp < to.stamp ? to.driven.refused_m : from.driven.refused_m;
  return {(to.view.centre() - expected.centre()).norm(), std::min(reach_m, 0.5 * refused_m)};
}

Allowed allowed(const Departure& departure, double repeats_m) {
  if (!(departure.error_m < departure.reach_m)) return Allowed::no;
  return departure.error_m + departure.reach_m < std::min(repeats_m, departure.repeats_m) ? Allowed::yes
                                                                                          : Allowed::unclear;
}

}  // namespace mapweave::visual
