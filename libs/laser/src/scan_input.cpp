#include "motion_tracks.h"

#include <mapweave/core/log.h>
#include <mapweave/laser/mapper_protocol.h>
#include <mapweave/laser/scan_input.h>
#include <mapweave/rawlog/scan_sweep.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <algorithm>
#include <cmath>

namespace mapweave::laser {
namespace {

constexpr double kUnknownMaxRange_m = 100.0;  // for logs that do not say
constexpr double kFarthest_m =
    200.0;  // no planar laser sees farther; a log that says so must not ask for rasters of many kilometres
constexpr double kJump_m = 1.0;            // beyond what the top speed allows
constexpr double kFarthestJump_m = 100.0;  // however long nothing was recorded
constexpr double kSweepStep_s = 0.001;
constexpr double kInertialEvery_s = 0.039;
constexpr double kFastest_rad_s = 4000.0;  // degrees, too: found out later

Pose3 pose_from_mrpt(const mrpt::poses::CPose3D& pose) {
  Pose3 result;
  result.t = {pose.x(), pose.y(), pose.z()};
  result.q = Eigen::Quaterniond(Eigen::Matrix3d(pose.getRotationMatrix().asEigen())).normalized();
  return result;
}

std::optional<ScanGeometry> geometry_of(const mrpt::obs::CObservation2DRangeScan& scan,
                                        const ScanInputOptions& options) {
  ScanGeometry geometry;
  const std::size_t rays = scan.getScanSize();
  if (rays < 2 || rays > protocol::kMaxRays) return std::nullopt;
  if (!(scan.aperture > 0.0f && scan.aperture < 6.3f)) return std::nullopt;
  geometry.ray_count = static_cast<std::uint32_t>(rays);
  const double direction = scan.rightToLeft ? 1.0 : -1.0, aperture = scan.aperture;
  geometry.first_angle_rad = -0.5 * direction * aperture;
  geometry.angle_step_rad = direction * aperture / static_cast<double>(rays - 1);
  const double own_max = scan.maxRange;
  geometry.max_range_m = std::isfinite(own_max) && own_max > 0.0 ? own_max : kUnknownMaxRange_m;
  if (options.max_range_m > 0.0) geometry.max_range_m = std::min(geometry.max_range_m, options.max_range_m);
  geometry.max_range_m = std::min(geometry.max_range_m, kFarthest_m);
  geometry.range_unit_m = 0.001 * std::max(1.0, std::ceil(geometry.max_range_m / 65.535));
  const auto& pose = scan.sensorPose;
  if (!std::isfinite(pose.yaw() + pose.pitch() + pose.roll()) || !(pose.norm() < kFarthest_m)) return std::nullopt;
  geometry.robot_from_laser = pose_from_mrpt(pose);
  if (options.sweep == SweepSource::given && options.sweep_s > 0.0) {
    // Their rays stand in the order in which the laser turns.
    const bool along = options.sweep_order == SweepOrder::along_rays;
    geometry.ray_step_s = (along ? options.sweep_s : -options.sweep_s) / static_cast<double>(rays - 1);
    geometry.first_ray_s = options.sweep_s * ((along ? 0.0 : 1.0) - options.sweep_stamp);
  } else if (options.sweep == SweepSource::automatic) {
    // Rounded: lasers whose speed varies a little would have a geometry for each scan.
    const double sweep_s = kSweepStep_s * std::round(1e-9 * static_cast<double>(rawlog::sweep_ns(scan)) / kSweepStep_s);
    geometry.ray_step_s = sweep_s / static_cast<double>(rays - 1);
  }
  return geometry;
}

}  // namespace

ScanPacker::ScanPacker(ScanInputOptions options)
    : options_(std::move(options)), label_is_known_(!options_.label.empty()) {}

Pose2 ScanPacker::steady(Stamp stamp, const Pose2& odometry_from_robot) {
  Pose2 result = compose(start_from_odometry_, odometry_from_robot);
  if (last_odometry_) {
    const auto& [then, there] = *last_odometry_;
    const double possible =
        std::min(kJump_m + options_.max_speed_mps * std::max(0.0, seconds_between(then, stamp)), kFarthestJump_m);
    if (std::hypot(result.x - there.x, result.y - there.y) > possible) {
      start_from_odometry_ = compose(there, inverse(odometry_from_robot));
      result = there;
      if (++odometry_jumps_ == 1)
        log(LogLevel::warning,
            "the odometry jumps farther than " + std::to_string(static_cast<int>(options_.max_speed_mps)) +
                " m/s allow: taken as a counter that started anew (option laser.scan.max_speed_mps)");
    }
  }
  last_odometry_.emplace(stamp, result);
  return result;
}

// Turn rates are summed up; a unit that measures headings alone is taken at its word.
std::optional<LaserInput> ScanPacker::inertial(Stamp stamp, const mrpt::obs::CObservationIMU& reading) {
  const bool has_rate = reading.has(mrpt::obs::IMU_WZ), has_heading = reading.has(mrpt::obs::IMU_YAW);
  found_inertial_ = found_inertial_ || has_rate || has_heading;
  if (options_.inertial == InertialUse::none || !(has_rate || has_heading) ||
      (inertial_ && inertial_->label != reading.sensorLabel))
    return std::nullopt;
  Inertial now;
  now.label = reading.sensorLabel;
  now.stamp = stamp;
  if (has_rate) {
    const auto part = [&](auto axis) { return reading.has(axis) ? reading.get(axis) : 0.0; };
    const Eigen::Matrix3d robot_from_unit = reading.sensorPose.getRotationMatrix().asEigen();
    now.rate_rad_s = robot_from_unit.row(2).dot(
        Eigen::Vector3d(part(mrpt::obs::IMU_WX), part(mrpt::obs::IMU_WY), part(mrpt::obs::IMU_WZ)));
  } else {
    now.heading_rad = reading.get(mrpt::obs::IMU_YAW);
  }
  if (!(std::abs(now.rate_rad_s) < kFastest_rad_s) || (now.heading_rad && !std::isfinite(*now.heading_rad))) {
    ++unusable_;
    return std::nullopt;
  }
  if (inertial_) {
    const double seconds = seconds_between(inertial_->stamp, stamp);
    if (seconds <= 0.0) return std::nullopt;
    now.yaw_rad = inertial_->yaw_rad;
    now.answered = inertial_->answered;
    if (now.heading_rad && inertial_->heading_rad)
      now.yaw_rad += wrap_angle(*now.heading_rad - *inertial_->heading_rad);
    else if (seconds < kInertialGap_s)
      now.yaw_rad += 0.5 * seconds * (inertial_->rate_rad_s + now.rate_rad_s);
  }
  const bool answers = !now.answered || seconds_between(*now.answered, stamp) >= kInertialEvery_s;
  if (answers) now.answered = stamp;
  inertial_ = now;
  return answers ? std::optional<LaserInput>(InertialInput{stamp, now.yaw_rad}) : std::nullopt;
}

std::optional<LaserInput> ScanPacker::operator()(const rawlog::Record& record) {
  using namespace mrpt::obs;
  if (const auto odometry = std::dynamic_pointer_cast<const CObservationOdometry>(record.observation)) {
    const Pose2 odometry_from_robot = odometry->odometry.asTPose();
    if (is_finite(odometry_from_robot))
      return OdometryInput{record.stamp, spatial(steady(record.stamp, odometry_from_robot))};
    ++unusable_;
    return std::nullopt;
  }
  if (const auto unit = std::dynamic_pointer_cast<const CObservationIMU>(record.observation))
    return inertial(record.stamp, *unit);
  const auto scan = std::dynamic_pointer_cast<const CObservation2DRangeScan>(record.observation);
  if (!scan) return std::nullopt;
  if (label_is_known_ && scan->sensorLabel != options_.label) {
    if (++ignored_[scan->sensorLabel] == 1)
      log(LogLevel::warning, "laser '" + scan->sensorLabel + "' is ignored: '" + options_.label +
                                 "' is used; choose with the option 'label'");
    return std::nullopt;
  }
  const auto geometry = geometry_of(*scan, options_);
  if (!geometry) {
    if (++unusable_ == 1)
      log(LogLevel::warning,
          "a scan of laser '" + scan->sensorLabel + "' is left out: its rays or its pose make no sense");
    return std::nullopt;
  }
  if (!label_is_known_) options_.label = scan->sensorLabel;
  label_is_known_ = found_laser_ = true;
  if (!geometry_ || !(*geometry_ == *geometry)) geometry_ = std::make_shared<const ScanGeometry>(*geometry);

  PackedScan packed{geometry_, std::vector<std::uint16_t>(geometry->ray_count, 0)};
  for (std::uint32_t ray = 0; ray < geometry->ray_count; ++ray) {
    const double range = scan->getScanRange(ray);
    if (!scan->getScanRangeValidity(ray) ||
        !(range >= options_.min_range_m && range > 0.0 && range < geometry->max_range_m))
      continue;
    packed.ranges[ray] =
        static_cast<std::uint16_t>(std::clamp(std::round(range / geometry->range_unit_m), 1.0, 65535.0));
  }
  return ScanInput{record.stamp, std::move(packed)};
}

}  // namespace mapweave::laser
