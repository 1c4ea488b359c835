#include <mapweave/simulation/observations.h>

#include <mapweave/core/error.h>
#include <mapweave/rawlog/observation_stream.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

mrpt::img::CImage image_of(const Picture& picture) {
  mrpt::img::CImage image(static_cast<unsigned>(picture.width), static_cast<unsigned>(picture.height),
                          picture.channels == 1 ? mrpt::img::CH_GRAY : mrpt::img::CH_RGB);
  const std::size_t length = static_cast<std::size_t>(picture.width) * static_cast<std::size_t>(picture.channels);
  for (int row = 0; row < picture.height; ++row) {
    const std::uint8_t* from = picture.values.data() + static_cast<std::size_t>(row) * length;
    std::uint8_t* to = image.ptrLine<std::uint8_t>(static_cast<unsigned>(row));
    if (picture.channels == 1) {
      std::copy_n(from, length, to);
    } else {
      for (std::size_t i = 0; i < length; ++i) to[i] = from[i - i % 3 + 2 - i % 3];  // MRPT keeps blue first
    }
  }
  return image;
}

mrpt::img::CImage image_of(const Picture& picture, const std::string& file) {
  if (file.empty()) return image_of(picture);
  mrpt::img::CImage image;
  image.setExternalStorage(file);
  return image;
}

mrpt::img::TCamera camera_of(const CameraOptions& options) {
  const CameraIntrinsics intrinsics = options.intrinsics();
  mrpt::img::TCamera camera;
  camera.ncols = static_cast<std::uint32_t>(intrinsics.width);
  camera.nrows = static_cast<std::uint32_t>(intrinsics.height);
  camera.setIntrinsicParamsFromValues(intrinsics.fx, intrinsics.fy, intrinsics.cx, intrinsics.cy);
  camera.distortion =
      intrinsics.is_distorted() ? mrpt::img::DistortionModel::plumb_bob : mrpt::img::DistortionModel::none;
  std::copy(intrinsics.distortion.begin(), intrinsics.distortion.end(), camera.dist.begin());
  camera.cameraName = options.id;
  return camera;
}

mrpt::poses::CPose3DQuat mrpt_pose(const Pose3& pose) {
  const double sign = pose.q.w() < 0.0 ? -1.0 : 1.0;
  return {pose.t.x(), pose.t.y(), pose.t.z(),
          mrpt::math::CQuaternionDouble(sign * pose.q.w(), sign * pose.q.x(), sign * pose.q.y(), sign * pose.q.z())};
}

}  // namespace

mrpt::obs::CObservationOdometry::Ptr odometry_observation(const SimulatedStep& step) {
  auto observation = mrpt::obs::CObservationOdometry::Create();
  observation->timestamp = rawlog::to_mrpt_time(step.stamp);
  observation->sensorLabel = "ODOM";
  observation->odometry = mrpt::poses::CPose2D(step.odometry_from_robot);
  return observation;
}

mrpt::obs::CObservation2DRangeScan::Ptr scan_observation(const SimulatedStep& step,
                                                         const SimulatedLaserOptions& options) {
  MAPWEAVE_EXPECT(step.ranges.size() == static_cast<std::size_t>(options.rays), "a scan has the laser's rays");
  auto observation = mrpt::obs::CObservation2DRangeScan::Create();
  observation->timestamp = rawlog::to_mrpt_time(step.stamp);
  observation->sensorLabel = "LASER";
  observation->aperture = static_cast<float>(options.field_of_view_deg * (M_PI / 180.0));
  observation->rightToLeft = true;
  observation->maxRange = static_cast<float>(options.max_range_m);
  observation->stdError = static_cast<float>(options.noise_m);
  observation->sensorPose = mrpt::poses::CPose3D(
      mrpt::math::TPose3D(options.x_m, options.y_m, 0.0, options.robot_from_laser().phi, 0.0, 0.0));
  observation->resizeScan(step.ranges.size());
  for (std::size_t ray = 0; ray < step.ranges.size(); ++ray) {
    observation->setScanRange(ray, step.ranges[ray]);
    observation->setScanRangeValidity(ray, step.ranges[ray] > 0.0f);
  }
  return observation;
}

mrpt::obs::CObservationIMU::Ptr imu_observation(const ImuReading& reading) {
  auto observation = mrpt::obs::CObservationIMU::Create();
  observation->timestamp = rawlog::to_mrpt_time(reading.stamp);
  observation->sensorLabel = "IMU";
  observation->set(mrpt::obs::IMU_WX, reading.turn_rad_per_s.x());
  observation->set(mrpt::obs::IMU_WY, reading.turn_rad_per_s.y());
  observation->set(mrpt::obs::IMU_WZ, reading.turn_rad_per_s.z());
  observation->set(mrpt::obs::IMU_X_ACC, reading.acceleration_m_per_s2.x());
  observation->set(mrpt::obs::IMU_Y_ACC, reading.acceleration_m_per_s2.y());
  observation->set(mrpt::obs::IMU_Z_ACC, reading.acceleration_m_per_s2.z());
  return observation;
}

mrpt::obs::CObservation::Ptr camera_observation(const CameraFrame& frame, const CameraOptions& options,
                                                const PictureFiles& files) {
  mrpt::obs::CObservation::Ptr result;
  switch (options.kind) {
    case SimulatedCameraKind::mono: {
      auto observation = mrpt::obs::CObservationImage::Create();
      observation->image = image_of(frame.left, files.left);
      observation->cameraParams = camera_of(options);
      observation->cameraPose = mrpt::poses::CPose3D(mrpt_pose(options.robot_from_camera()));
      result = observation;
      break;
    }
    case SimulatedCameraKind::stereo: {
      auto observation = mrpt::obs::CObservationStereoImages::Create();
      observation->imageLeft = image_of(frame.left, files.left);
      observation->imageRight = image_of(frame.right, files.right);
      observation->hasImageRight = true;
      observation->leftCamera = observation->rightCamera = camera_of(options);
      observation->cameraPose = mrpt_pose(options.robot_from_camera());
      observation->rightCameraPose =
          mrpt::poses::CPose3DQuat(options.baseline_m, 0.0, 0.0, mrpt::math::CQuaternionDouble(1.0, 0.0, 0.0, 0.0));
      result = observation;
      break;
    }
    case SimulatedCameraKind::rgbd: {
      auto observation = mrpt::obs::CObservation3DRangeScan::Create();
      observation->hasRangeImage = observation->hasIntensityImage = true;
      observation->range_is_depth = true;
      observation->rangeUnits = static_cast<float>(kDepthUnit);
      observation->rangeImage_setSize(options.height, options.width);
      for (int row = 0; row < options.height; ++row) {
        for (int column = 0; column < options.width; ++column)
          observation->rangeImage(row, column) =
              frame.depth[static_cast<std::size_t>(row) * static_cast<std::size_t>(options.width) +
                          static_cast<std::size_t>(column)];
      }
      observation->intensityImage = image_of(frame.left, files.left);
      observation->intensityImageChannel = mrpt::obs::CObservation3DRangeScan::CH_VISIBLE;
      observation->cameraParams = observation->cameraParamsIntensity = camera_of(options);
      observation->sensorPose = mrpt::poses::CPose3D(mrpt_pose(options.robot_from_body()));
      observation->maxRange = static_cast<float>(options.depth.max_range_m);
      result = observation;
      break;
    }
  }
  MAPWEAVE_EXPECT(result, "every kind of camera has its observation");
  result->timestamp = rawlog::to_mrpt_time(frame.stamp);
  result->sensorLabel = options.id;
  return result;
}

}  // namespace mapweave::simulation
