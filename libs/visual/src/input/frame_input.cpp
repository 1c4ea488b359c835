#include "motion_prior.h"
#include "rectifier.h"

#include <mapweave/core/error.h>
#include <mapweave/rawlog/depth_delay.h>
#include <mapweave/visual/frame_input.h>

#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <cstring>
#include <opencv2/imgproc.hpp>

namespace mapweave::visual {
namespace {

using mrpt::obs::CObservation3DRangeScan;
using mrpt::obs::CObservationImage;
using mrpt::obs::CObservationStereoImages;

constexpr int kLeastSide = 64,
              kMostSide = 4096;  // smaller pictures have no coarse levels; larger ones take much memory

Pose3 pose_of(const mrpt::poses::CPose3D& pose) {
  const mrpt::math::CQuaternionDouble q = [&] {
    mrpt::math::CQuaternionDouble result;
    pose.getAsQuaternion(result);
    return result;
  }();
  return {{pose.x(), pose.y(), pose.z()}, Eigen::Quaterniond(q.r(), q.x(), q.y(), q.z()).normalized()};
}

[[noreturn]] void refuse(const std::string& label, const std::string& what, const std::string& remedy) {
  throw Error(ErrorCode::kBadInput, what, "camera '" + label + "'", remedy);
}

LensCalibration lens_of(const mrpt::img::TCamera& camera, const std::string& label) {
  LensCalibration lens;
  lens.camera = {static_cast<int>(std::min<std::uint32_t>(camera.ncols, kMostSide + 1)),
                 static_cast<int>(std::min<std::uint32_t>(camera.nrows, kMostSide + 1)),
                 camera.fx(),
                 camera.fy(),
                 camera.cx(),
                 camera.cy()};
  for (double value : {camera.fx(), camera.fy(), camera.cx(), camera.cy()})
    if (!std::isfinite(value)) refuse(label, "its calibration is not finite", "correct the calibration");
  if (!(camera.fx() > 1.0 && camera.fy() > 1.0))
    refuse(label, "it has no calibration (fx and fy are 0)", "give the log a calibrated camera");
  if (lens.camera.width < kLeastSide || lens.camera.height < kLeastSide || lens.camera.width > kMostSide ||
      lens.camera.height > kMostSide)
    refuse(label,
           "its calibration is of " + std::to_string(camera.ncols) + " x " + std::to_string(camera.nrows) +
               " pixels; " + std::to_string(kLeastSide) + " to " + std::to_string(kMostSide) + " were expected",
           "correct the calibration");
  if (camera.distortion == mrpt::img::DistortionModel::kannala_brandt)
    refuse(label, "its lens is of the model Kannala-Brandt; radial-tangential is read", "rectify its pictures first");
  if (camera.distortion != mrpt::img::DistortionModel::none) {
    lens.distortion = {camera.k1(), camera.k2(), camera.p1(), camera.p2(), camera.k3()};
    for (double value : {camera.k1(), camera.k2(), camera.p1(), camera.p2(), camera.k3()})
      if (!std::isfinite(value)) refuse(label, "its distortion is not finite", "correct the calibration");
  }
  return lens;
}

GreyImage grey_of(const mrpt::img::CImage& image, const Pinhole& camera, const std::string& label) {
  const cv::Mat& raw = image.asCvMatRef();
  if (raw.cols != camera.width || raw.rows != camera.height)
    refuse(label,
           "a picture has " + std::to_string(raw.cols) + " x " + std::to_string(raw.rows) + " pixels; " +
               std::to_string(camera.width) + " x " + std::to_string(camera.height) +
               " of the calibration were expected",
           "calibrate the camera for this size, or leave the picture out");
  GreyImage result(camera.width, camera.height);
  cv::Mat out(result.height, result.width, CV_8U, result.pixels.data());
  if (raw.type() == CV_8UC3)
    cv::cvtColor(raw, out, cv::COLOR_BGR2GRAY);
  else if (raw.type() == CV_8UC1)
    raw.copyTo(out);
  else
    refuse(label, "a picture has neither 1 nor 3 channels of 8 bits", "convert its pictures");
  return result;
}

// Shared with the observation: OpenCV counts who holds the pixels.
ColourPicture colour_of(const mrpt::img::CImage& image, const LensCalibration& lens) {
  const cv::Mat& raw = image.asCvMatRef();
  if (raw.type() != CV_8UC3) return {};
  const auto held = std::make_shared<const cv::Mat>(raw);
  return {{held, held->data}, raw.cols, raw.rows, raw.step, lens.camera, lens.distortion};
}

// The (left) picture of an observation, how it was taken and from where.
struct TakenPicture {
  const mrpt::img::TCamera* calibration = nullptr;
  const mrpt::img::CImage* picture = nullptr;
  Pose3 robot_from_camera;
};

TakenPicture taken_picture(const mrpt::obs::CObservation& observation) {
  if (const auto* scan = dynamic_cast<const CObservation3DRangeScan*>(&observation))
    return {&scan->cameraParamsIntensity, &scan->intensityImage,
            compose(pose_of(scan->sensorPose), pose_of(scan->relativePoseIntensityWRTDepth))};
  if (const auto* pair = dynamic_cast<const CObservationStereoImages*>(&observation))
    return {&pair->leftCamera, &pair->imageLeft, pose_of(mrpt::poses::CPose3D(pair->cameraPose))};
  const auto& single = dynamic_cast<const CObservationImage&>(observation);
  return {&single.cameraParams, &single.image, pose_of(single.cameraPose)};
}

Rectifier rectifier_of(const CObservationStereoImages& pair, const LensCalibration& left, const std::string& label) {
  const Pose3 left_from_right = pose_of(mrpt::poses::CPose3D(pair.rightCameraPose));
  const LensCalibration right = lens_of(pair.rightCamera, label);
  if (!is_finite(left_from_right) || !(left_from_right.t.norm() > 1e-3))
    refuse(label, "its right camera stands where the left one does", "give the log the right camera's pose");
  if (left_from_right.t.x() < 0.5 * left_from_right.t.norm())
    refuse(label, "its right camera is not to the right of the left one",
           "exchange left and right, or correct the right camera's pose");
  if (right.camera.width != left.camera.width || right.camera.height != left.camera.height)
    refuse(label, "its pictures differ in size", "rectify them first");
  return Rectifier(left, right, left_from_right);
}

DepthPicture depth_of(const CObservation3DRangeScan& scan, const LensCalibration& lens, const std::string& label) {
  if (scan.rangeImage.cols() != lens.camera.width || scan.rangeImage.rows() != lens.camera.height)
    refuse(label,
           "a depth picture has " + std::to_string(scan.rangeImage.cols()) + " x " +
               std::to_string(scan.rangeImage.rows()) + " pixels; the size of the colour picture was expected",
           "register depth to colour");
  if (!(scan.rangeUnits > 0.0F)) refuse(label, "its depth has no unit", "give the log its depth scale");
  DepthPicture depth;
  depth.image = DepthImage(lens.camera.width, lens.camera.height);
  std::memcpy(depth.image.pixels.data(), scan.rangeImage.data(), depth.image.pixels.size() * sizeof(std::uint16_t));
  depth.metres_per_unit = static_cast<double>(scan.rangeUnits);
  depth.delay_s = 1e-9 * static_cast<double>(rawlog::depth_delay_ns(scan));
  depth.camera = lens.camera;
  depth.distortion = lens.distortion;
  return depth;
}

}  // namespace

std::optional<CameraKind> camera_kind(const mrpt::obs::CObservation& observation) {
  if (const auto* depth = dynamic_cast<const CObservation3DRangeScan*>(&observation))
    return depth->hasIntensityImage ? std::optional(depth->hasRangeImage ? CameraKind::rgbd : CameraKind::mono)
                                    : std::nullopt;
  if (const auto* pair = dynamic_cast<const CObservationStereoImages*>(&observation))
    return pair->hasImageRight ? CameraKind::stereo : CameraKind::mono;
  if (dynamic_cast<const CObservationImage*>(&observation) != nullptr) return CameraKind::mono;
  return std::nullopt;
}

struct FramePacker::Lens {
  LensCalibration left;
  Rectifier rectifier;
};

FramePacker::FramePacker(FrameInputOptions options) : options_(std::move(options)), motion_(new MotionPrior) {}
FramePacker::~FramePacker() = default;

std::optional<Frame> FramePacker::operator()(const rawlog::Record& record) {
  motion_->add(record);
  const auto offered = camera_kind(*record.observation);
  if (!offered) return std::nullopt;
  const std::string& label = record.observation->sensorLabel;
  if (!options_.label.empty() && label != options_.label) {
    ++ignored_[label];
    return std::nullopt;
  }
  if (options_.kind == CameraKind::automatic) options_.kind = *offered;
  if (options_.kind != CameraKind::mono && options_.kind != *offered) {
    if (rig_) return std::nullopt;  // one that lacks its other half
    refuse(label, options_.kind == CameraKind::rgbd ? "it has no depth" : "it has no right picture",
           "choose another --sensor");
  }
  options_.label = label;

  const TakenPicture taken = taken_picture(*record.observation);
  const auto* pair = dynamic_cast<const CObservationStereoImages*>(record.observation.get());
  if (!lens_) {
    const LensCalibration left = lens_of(*taken.calibration, label);
    lens_.reset(
        new Lens{left, options_.kind == CameraKind::stereo ? rectifier_of(*pair, left, label) : Rectifier(left)});
    if (!is_finite(taken.robot_from_camera)) refuse(label, "its pose on the robot is not finite", "correct the pose");
    rig_ = CameraRig{lens_->rectifier.camera(), lens_->rectifier.baseline_m(), options_.kind == CameraKind::rgbd,
                     compose(taken.robot_from_camera, lens_->rectifier.left_from_rectified()), taken.robot_from_camera};
  }
  rawlog::load_pictures(*record.observation);
  Frame frame;
  frame.stamp = record.stamp;
  frame.expected = motion_->at(frame.stamp, rig_->robot_from_camera);
  frame.odometry_from_camera = motion_->odometry_from_camera(frame.stamp, rig_->robot_from_camera);
  frame.colour = colour_of(*taken.picture, lens_->left);
  frame.colour.raw_from_rectified = lens_->rectifier.left_from_rectified().q;
  frame.grey = lens_->rectifier.left(grey_of(*taken.picture, lens_->left.camera, label));
  if (options_.kind == CameraKind::stereo)
    frame.right = lens_->rectifier.right(grey_of(pair->imageRight, lens_->left.camera, label));
  if (options_.kind == CameraKind::rgbd)
    frame.depth = depth_of(dynamic_cast<const CObservation3DRangeScan&>(*record.observation), lens_->left, label);
  return frame;
}

}  // namespace mapweave::visual
