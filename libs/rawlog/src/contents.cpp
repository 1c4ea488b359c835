#include "formats.h"
#include "ordered_stream.h"
#include "picture_file.h"
#include "ros/bag_contents.h"

#include <mapweave/core/error.h>
#include <mapweave/core/geometry.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/rawlog/contents.h>
#include <mapweave/rawlog/depth_delay.h>
#include <mapweave/rawlog/unit_check.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace mapweave::rawlog {
namespace {

constexpr std::size_t kMostGeometries = 100;  // kept per sensor: a laser that turns on its own axis has one per scan

LaserGeometry geometry_of(const mrpt::obs::CObservation2DRangeScan& scan) {
  LaserGeometry geometry;
  geometry.rays = static_cast<std::uint32_t>(scan.getScanSize());
  geometry.max_range_m = scan.maxRange;
  const auto& pose = scan.sensorPose;
  geometry.x_m = pose.x();
  geometry.y_m = pose.y();
  geometry.z_m = pose.z();
  geometry.yaw_rad = pose.yaw();
  geometry.pitch_rad = pose.pitch();
  geometry.roll_rad = pose.roll();
  const double half = 0.5 * (scan.rightToLeft ? 1.0 : -1.0) * scan.aperture;
  geometry.first_angle_rad = geometry.yaw_rad - half;
  geometry.last_angle_rad = geometry.yaw_rad + half;
  return geometry;
}

bool alike(const LaserGeometry& a, const LaserGeometry& b) {
  const auto near = [](double x, double y) { return std::abs(x - y) < 1e-4; };
  return a.rays == b.rays && near(a.first_angle_rad, b.first_angle_rad) && near(a.last_angle_rad, b.last_angle_rad) &&
         near(a.max_range_m, b.max_range_m) && near(a.x_m, b.x_m) && near(a.y_m, b.y_m) && near(a.z_m, b.z_m) &&
         near(a.pitch_rad, b.pitch_rad) && near(a.roll_rad, b.roll_rad);
}

struct Sensor {
  const mrpt::rtti::TRuntimeClassId* class_id;
  SensorContents contents;
  Pose2 last_odometry;
  double length_m = 0.0;
};

Sensor& sensor_of(const mrpt::obs::CObservation& observation, std::vector<Sensor>& sensors) {
  const auto* class_id = observation.GetRuntimeClass();
  const auto known = std::find_if(sensors.begin(), sensors.end(), [&](const Sensor& sensor) {
    return sensor.class_id == class_id && sensor.contents.label == observation.sensorLabel;
  });
  if (known != sensors.end()) return *known;
  Sensor sensor{class_id, {}, {}};
  const std::string name = class_id->className;
  sensor.contents.class_name = name.substr(name.rfind(':') + 1);
  sensor.contents.label = observation.sensorLabel;
  return sensors.emplace_back(std::move(sensor));
}

void add_geometry(std::vector<LaserGeometry>& geometries, const mrpt::obs::CObservation2DRangeScan& scan) {
  const LaserGeometry geometry = geometry_of(scan);
  auto known = std::find_if(geometries.begin(), geometries.end(),
                            [&](const LaserGeometry& other) { return alike(geometry, other); });
  if (known == geometries.end()) {
    if (geometries.size() == kMostGeometries) return;
    known = geometries.insert(known, geometry);
  }
  ++known->scans;
}

void look_at_camera(const mrpt::img::CImage& image, const mrpt::img::TCamera& calibration,
                    RecordedCameraGeometry& camera) {
  if (!image.isExternallyStored()) {
    camera.width = static_cast<std::uint32_t>(image.getWidth());
    camera.height = static_cast<std::uint32_t>(image.getHeight());
  } else if (is_png_or_jpeg(image.getExternalStorageFile())) {
    const PictureFile file = look_at_picture(image.getExternalStorageFile());
    camera.width = file.width;
    camera.height = file.height;
  }
  camera.calibrated = calibration.fx() > 0.0 && calibration.fy() > 0.0;
  if (!camera.calibrated) return;
  camera.fx = calibration.fx();
  camera.fy = calibration.fy();
  camera.cx = calibration.cx();
  camera.cy = calibration.cy();
  camera.distorted = std::any_of(calibration.dist.begin(), calibration.dist.end(), [](double k) { return k != 0.0; });
}

void add_depth(const mrpt::obs::CObservation3DRangeScan& scan, bool is_first, RecordedCameraGeometry& camera) {
  const double delay_s = static_cast<double>(depth_delay_ns(scan)) * 1e-9;
  camera.least_depth_delay_s = is_first ? delay_s : std::min(camera.least_depth_delay_s, delay_s);
  camera.most_depth_delay_s = is_first ? delay_s : std::max(camera.most_depth_delay_s, delay_s);
  std::uint16_t nearest = 65535, farthest = 0;
  for (const std::uint16_t* steps = scan.rangeImage.data(); steps != scan.rangeImage.data() + scan.rangeImage.size();
       ++steps) {
    if (*steps == 0) continue;
    nearest = std::min(nearest, *steps);
    farthest = std::max(farthest, *steps);
  }
  if (farthest == 0) return;
  const double near_m = nearest * scan.rangeUnits, far_m = farthest * scan.rangeUnits;
  camera.nearest_m = camera.farthest_m == 0.0 ? near_m : std::min(camera.nearest_m, near_m);
  camera.farthest_m = std::max(camera.farthest_m, far_m);
}

void add_camera(const mrpt::obs::CObservation& observation, std::optional<RecordedCameraGeometry>& camera) {
  const bool is_first = !camera;
  const auto* image = dynamic_cast<const mrpt::obs::CObservationImage*>(&observation);
  const auto* stereo = dynamic_cast<const mrpt::obs::CObservationStereoImages*>(&observation);
  const auto* depth = dynamic_cast<const mrpt::obs::CObservation3DRangeScan*>(&observation);
  if (image == nullptr && stereo == nullptr && depth == nullptr) return;
  if (is_first) camera.emplace();
  if (image != nullptr) look_at_camera(image->image, image->cameraParams, *camera);
  if (stereo != nullptr) {
    look_at_camera(stereo->imageLeft, stereo->leftCamera, *camera);
    camera->baseline_m = stereo->rightCameraPose.norm();
  }
  if (depth == nullptr) return;
  if (depth->hasIntensityImage) look_at_camera(depth->intensityImage, depth->cameraParamsIntensity, *camera);
  if (depth->hasRangeImage) add_depth(*depth, is_first, *camera);
}

}  // namespace

LogContents summarize_log(const std::filesystem::path& log, const ReadOptions& options) {
  LogContents contents;
  contents.topics = ros::topics_of_bag(log, options);
  contents.format = format_of_log(log);
  OpenedLog opened;
  try {
    opened = open_source(log, options);
  } catch (const Error& error) {
    if (contents.topics.empty()) throw;
    contents.trouble = error.what();
    return contents;
  }
  const auto stream = make_ordered_stream(std::move(opened.source), options);
  std::vector<Sensor> sensors;
  UnitCheck units;
  const auto note = [&](const std::vector<UnitDoubt>& doubts) {
    for (const UnitDoubt& doubt : doubts) contents.doubts.push_back(doubt.what + ": " + doubt.guess);
  };
  while (const auto record = stream->next()) {
    const auto& observation = *record->observation;
    if (contents.observations % 256 == 0) throw_if_interrupted();
    if (contents.observations++ == 0) contents.first = record->stamp;
    contents.last = record->stamp;
    note(units.add(*record));
    Sensor& found = sensor_of(observation, sensors);
    SensorContents& sensor = found.contents;
    if (sensor.count++ == 0) {
      sensor.first = sensor.last = record->stamp;
    }
    sensor.longest_gap_s = std::max(sensor.longest_gap_s, seconds_between(sensor.last, record->stamp));
    sensor.last = record->stamp;
    if (const auto* scan = dynamic_cast<const mrpt::obs::CObservation2DRangeScan*>(&observation)) {
      ++contents.scans;
      add_geometry(sensor.geometries, *scan);
    } else if (const auto* odometry = dynamic_cast<const mrpt::obs::CObservationOdometry*>(&observation)) {
      const Pose2 pose = odometry->odometry.asTPose();
      if (sensor.count > 1)
        found.length_m += std::hypot(pose.x - found.last_odometry.x, pose.y - found.last_odometry.y);
      found.last_odometry = pose;
    } else {
      add_camera(observation, sensor.camera);
    }
  }
  note(units.finish());
  contents.duration_s = seconds_between(contents.first, contents.last);
  for (auto& [class_id, sensor, last_odometry, length_m] : sensors) {
    const double seconds = seconds_between(sensor.first, sensor.last);
    if (seconds > 0.0) sensor.rate_hz = static_cast<double>(sensor.count - 1) / seconds;
    std::stable_sort(sensor.geometries.begin(), sensor.geometries.end(),
                     [](const LaserGeometry& a, const LaserGeometry& b) { return a.scans > b.scans; });
    contents.odometry_length_m = std::max(contents.odometry_length_m, length_m);
    contents.sensors.push_back(std::move(sensor));
  }
  std::sort(contents.sensors.begin(), contents.sensors.end(), [](const SensorContents& a, const SensorContents& b) {
    return std::tie(a.label, a.class_name) < std::tie(b.label, b.class_name);
  });
  return contents;
}

}  // namespace mapweave::rawlog
