#include "motion_prior.h"

#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapweave::visual {
namespace {

constexpr double kLongestGap_s = 0.5;       // of samples: beyond it nothing is known of what lies between
constexpr std::size_t kMostSamples = 4096;  // bounds memory, at any rate of odometry

template <class Samples>
void forget_before(Samples& samples, Stamp stamp) {  // but the last one at or before it
  while (samples.size() > 2 && !(stamp < samples[1].stamp)) samples.pop_front();
  while (samples.size() > kMostSamples) samples.pop_front();
}

}  // namespace

void MotionPrior::add(const rawlog::Record& record) {
  if (const auto* odometry = dynamic_cast<const mrpt::obs::CObservationOdometry*>(record.observation.get())) {
    const Pose2 pose = odometry->odometry.asTPose();
    if (!is_finite(pose)) return;
    if (!odometry_.empty() && !(odometry_.back().stamp < record.stamp)) odometry_.pop_back();
    odometry_.push_back({record.stamp, pose});
  } else if (const auto* imu = dynamic_cast<const mrpt::obs::CObservationIMU*>(record.observation.get())) {
    if (!imu->has(mrpt::obs::IMU_WX) || !imu->has(mrpt::obs::IMU_WY) || !imu->has(mrpt::obs::IMU_WZ)) return;
    const mrpt::math::TPoint3D turning = imu->sensorPose.rotateVector(
        {imu->get(mrpt::obs::IMU_WX), imu->get(mrpt::obs::IMU_WY), imu->get(mrpt::obs::IMU_WZ)});
    const Eigen::Vector3d rad_per_s(turning.x, turning.y, turning.z);
    if (rad_per_s.allFinite() && rad_per_s.norm() < 50.0) turning_.push_back({record.stamp, rad_per_s});
  }
  if (before_) {
    forget_before(odometry_, *before_);
    forget_before(turning_, *before_);
  }
}

std::optional<Pose2> MotionPrior::odometry_at(Stamp when) const {
  constexpr double kStill_s = 0.2;  // so long after its first word a robot is taken to stand
  if (odometry_.size() == 1 && std::abs(seconds_between(odometry_[0].stamp, when)) < kStill_s)
    return odometry_[0].odometry_from_robot;
  if (odometry_.size() < 2) return std::nullopt;
  std::size_t later = 1;
  while (later + 1 < odometry_.size() && odometry_[later].stamp < when) ++later;
  const Odometry &a = odometry_[later - 1], &b = odometry_[later];
  const double step = seconds_between(a.stamp, b.stamp), since = seconds_between(a.stamp, when);
  if (since < -kLongestGap_s || since > step + kLongestGap_s || step > kLongestGap_s) return std::nullopt;
  const Pose2 moved = between(a.odometry_from_robot, b.odometry_from_robot);
  const double share = since / step;
  return compose(a.odometry_from_robot, Pose2(share * moved.x, share * moved.y, share * moved.phi));
}

std::optional<Eigen::Quaterniond> MotionPrior::turned(Stamp from, Stamp to) const {
  if (turning_.empty()) return std::nullopt;
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  bool any = false;
  for (std::size_t i = 0; i < turning_.size(); ++i) {
    // Each reading holds until the next one.
    const Stamp begin = std::max(from, turning_[i].stamp),
                end = i + 1 < turning_.size() ? std::min(to, turning_[i + 1].stamp) : to;
    const double held_s = seconds_between(begin, end);
    if (!(held_s > 0.0)) continue;
    if (held_s > kLongestGap_s) return std::nullopt;
    any = true;
    const Eigen::Vector3d turn_rad = held_s * turning_[i].rad_per_s;
    if (turn_rad.norm() > 1e-12)
      turn = turn * Eigen::Quaterniond(Eigen::AngleAxisd(turn_rad.norm(), turn_rad.normalized()));
  }
  return any ? std::optional(turn.normalized()) : std::nullopt;
}

std::optional<ExpectedMotion> MotionPrior::at(Stamp now, const Pose3& robot_from_camera) {
  const auto before = std::exchange(before_, now);
  if (!before) return std::nullopt;
  const Eigen::Quaterniond camera_from_robot = robot_from_camera.q.conjugate();
  const auto from = odometry_at(*before), to = odometry_at(now);
  if (from && to) {
    const Pose3 moved = compose(compose(inverse(robot_from_camera), spatial(between(*from, *to))), robot_from_camera);
    return ExpectedMotion{moved.q, moved.t};
  }
  if (const auto turn = turned(*before, now))
    return ExpectedMotion{camera_from_robot * *turn * robot_from_camera.q, std::nullopt};
  return std::nullopt;
}

std::optional<Pose3> MotionPrior::odometry_from_camera(Stamp now, const Pose3& robot_from_camera) const {
  const auto pose = odometry_at(now);
  return pose ? std::optional(compose(spatial(*pose), robot_from_camera)) : std::nullopt;
}

}  // namespace mapweave::visual
