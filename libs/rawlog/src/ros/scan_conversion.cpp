#include "scan_conversion.h"

#include "cloud_points.h"

#include <mapweave/rawlog/scan_sweep.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace mapweave::rawlog::ros {
namespace {

constexpr double kOverSweep = 1.1;  // a sweep that takes longer than from scan to scan was miscounted
constexpr double kLongestSweep_s = 1.0;
constexpr double kStepTolerance = 0.01;  // of an angular step
constexpr std::size_t kCloudRays = 720;
constexpr double kCloudRange_m = 100.0, kNearestInCloud_m = 0.05;

std::string text_of(double value) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6g", value);
  return text;
}

// From the first ray to the last, with its sign. Some drivers put the maximum a step behind the last ray.
double span_of(const LaserScanMessage& message) {
  const double step = message.angle_increment_rad;
  const double by_steps = step * static_cast<double>(message.ranges_m.size() - 1);
  const double stated = static_cast<double>(message.angle_max_rad) - message.angle_min_rad;
  return std::abs(stated - by_steps) < kStepTolerance * std::abs(step) ? stated : by_steps;
}

// Empty where the sweep was kept or is not said.
std::string keep_sweep(const LaserScanMessage& message, mrpt::obs::CObservation2DRangeScan& scan) {
  const double step_s = message.time_increment_s, scan_s = message.scan_time_s;
  if (!(step_s > 0.0)) return {};
  const double sweep_s = step_s * static_cast<double>(message.ranges_m.size() - 1);
  if (!(sweep_s < kLongestSweep_s) || (scan_s > 0.0 && sweep_s > kOverSweep * scan_s))
    return "time_increment says that a sweep takes " + text_of(sweep_s) + " s, scan_time " + text_of(scan_s) +
           " s from scan to scan; the sweep is not used";
  set_sweep_ns(scan, std::llround(sweep_s * 1e9));
  return {};
}

// In the robot's directions, from the sensor's place.
Eigen::Vector3d levelled(const Eigen::Vector3d& point, const Pose3& robot_from_sensor) {
  return robot_from_sensor.q * point;
}

int most_level_ring(const CloudPoints& points, const Pose3& robot_from_sensor) {
  struct Sum {
    double elevation_rad = 0.0;
    int points = 0;
  };
  std::map<int, Sum> rings;
  points.for_each([&](const Eigen::Vector3d& point, int ring) {
    const Eigen::Vector3d level = levelled(point, robot_from_sensor);
    if (level.norm() < kNearestInCloud_m) return;
    rings[ring].elevation_rad += std::abs(std::asin(level.z() / level.norm()));
    ++rings[ring].points;
  });
  int best = 0, most = 0;
  for (const auto& [ring, sum] : rings) most = std::max(most, sum.points);
  double least = std::numeric_limits<double>::infinity();
  for (const auto& [ring, sum] : rings) {
    const double mean = sum.elevation_rad / sum.points;
    if (2 * sum.points < most || !(mean < least)) continue;  // a ring that sees next to nothing is of no use
    least = mean;
    best = ring;
  }
  return best;
}

}  // namespace

mrpt::poses::CPose3D to_mrpt_pose(const Pose3& pose) {
  return {mrpt::math::CQuaternionDouble(pose.q.w(), pose.q.x(), pose.q.y(), pose.q.z()), pose.t.x(), pose.t.y(),
          pose.t.z()};
}

ConvertedScan to_scan(const LaserScanMessage& message, const Pose3& robot_from_sensor) {
  const std::size_t rays = message.ranges_m.size();
  if (rays < 2) return {nullptr, "it has " + std::to_string(rays) + " rays"};
  const double span = span_of(message), middle = message.angle_min_rad + 0.5 * span;
  if (!std::isfinite(middle) || span == 0.0) return {nullptr, "its angles make no sense"};
  ConvertedScan converted{std::make_shared<mrpt::obs::CObservation2DRangeScan>(), {}};
  auto& scan = *converted.scan;
  scan.rightToLeft = span > 0.0;
  scan.aperture = static_cast<float>(std::abs(span));
  scan.maxRange = message.range_max_m;
  scan.sensorPose = to_mrpt_pose(compose(robot_from_sensor, spatial(Pose2(0.0, 0.0, wrap_angle(middle)))));
  scan.resizeScan(rays);
  const bool has_maximum = std::isfinite(message.range_max_m) && message.range_max_m > 0.0f;
  for (std::size_t ray = 0; ray < rays; ++ray) {
    const float range = message.ranges_m[ray];
    const bool is_valid = std::isfinite(range) && range > 0.0f && range >= message.range_min_m &&
                          (!has_maximum || range <= message.range_max_m);
    scan.setScanRange(ray, is_valid ? range : 0.0f);
    scan.setScanRangeValidity(ray, is_valid);
  }
  converted.problem = keep_sweep(message, scan);
  return converted;
}

ConvertedScan to_scan(const PointCloudMessage& message, const Pose3& robot_from_sensor, const ReadOptions& options,
                      std::optional<int>& ring) {
  const CloudPoints points(message);
  if (!ring && points.has_rings())
    ring = options.cloud_ring >= 0 ? options.cloud_ring : most_level_ring(points, robot_from_sensor);
  const double step_rad = 2.0 * M_PI / kCloudRays, aperture = step_rad * (kCloudRays - 1);
  std::vector<float> nearest(kCloudRays, 0.0f);
  points.for_each([&](const Eigen::Vector3d& point, int of_ring) {
    const Eigen::Vector3d level = levelled(point, robot_from_sensor);
    const double range = level.head<2>().norm();
    const bool is_used =
        points.has_rings() ? of_ring == *ring : level.z() >= options.cloud_low_m && level.z() <= options.cloud_high_m;
    if (!is_used || !(range > kNearestInCloud_m && range < kCloudRange_m)) return;
    const auto ray = std::llround((std::atan2(level.y(), level.x()) + 0.5 * aperture) / step_rad);
    float& known = nearest[static_cast<std::size_t>(ray + static_cast<long long>(kCloudRays)) % kCloudRays];
    if (known == 0.0f || range < known) known = static_cast<float>(range);
  });
  ConvertedScan converted{std::make_shared<mrpt::obs::CObservation2DRangeScan>(), {}};
  auto& scan = *converted.scan;
  scan.rightToLeft = true;
  scan.aperture = static_cast<float>(aperture);
  scan.maxRange = static_cast<float>(kCloudRange_m);
  const Eigen::Vector3d& place = robot_from_sensor.t;
  scan.sensorPose = mrpt::poses::CPose3D(place.x(), place.y(), place.z(), 0.0, 0.0, 0.0);
  scan.resizeScan(kCloudRays);
  for (std::size_t ray = 0; ray < kCloudRays; ++ray) {
    scan.setScanRange(ray, nearest[ray]);
    scan.setScanRangeValidity(ray, nearest[ray] > 0.0f);
  }
  return converted;
}

std::shared_ptr<mrpt::obs::CObservationIMU> to_imu(const ImuMessage& message, const Pose3& robot_from_sensor) {
  using namespace mrpt::obs;
  auto imu = std::make_shared<CObservationIMU>();
  imu->sensorPose = to_mrpt_pose(robot_from_sensor);
  const auto set = [&](auto first, auto second, auto third, const Eigen::Vector3d& values) {
    imu->set(first, values.x());
    imu->set(second, values.y());
    imu->set(third, values.z());
  };
  if (message.has_turn_rate) set(IMU_WX, IMU_WY, IMU_WZ, message.turn_rate_rad_s);
  if (message.has_acceleration) set(IMU_X_ACC, IMU_Y_ACC, IMU_Z_ACC, message.acceleration_m_s2);
  if (message.has_orientation) {
    const auto& q = message.orientation;
    const mrpt::poses::CPose3D turned = to_mrpt_pose({Eigen::Vector3d::Zero(), q});
    set(IMU_YAW, IMU_PITCH, IMU_ROLL, {turned.yaw(), turned.pitch(), turned.roll()});
    set(IMU_ORI_QUAT_X, IMU_ORI_QUAT_Y, IMU_ORI_QUAT_Z, q.vec());
    imu->set(IMU_ORI_QUAT_W, q.w());
  }
  return imu;
}

std::shared_ptr<mrpt::obs::CObservationGPS> to_gps(const PositionMessage& message, const Pose3& robot_from_sensor) {
  auto gps = std::make_shared<mrpt::obs::CObservationGPS>();
  gps->sensorPose = to_mrpt_pose(robot_from_sensor);
  mrpt::obs::gnss::Message_NMEA_GGA position;
  if (message.status >= 0 && std::isfinite(message.latitude_deg) && std::isfinite(message.longitude_deg)) {
    position.fields.fix_quality = message.status > 0 ? 2 : 1;
    position.fields.latitude_degrees = message.latitude_deg;
    position.fields.longitude_degrees = message.longitude_deg;
    position.fields.altitude_meters = std::isfinite(message.altitude_m) ? message.altitude_m : 0.0;
  }
  gps->setMsg(position);
  return gps;
}

}  // namespace mapweave::rawlog::ros
