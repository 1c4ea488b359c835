#include "camera_conversion.h"

#include "../camera_folder.h"
#include "../say_once.h"
#include "scan_conversion.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/rawlog/depth_delay.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <cmath>
#include <cstdlib>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::size_t kMostWaiting = 30;  // pictures without a partner yet

template <class Observation>
void append(std::shared_ptr<Observation> observation, const PictureOrigin& origin, const std::string& label,
            std::vector<PlacedRecord>& records) {
  observation->timestamp = to_mrpt_time(origin.stamp);
  observation->sensorLabel = label;
  const Stamp stamp = to_stamp(observation->timestamp);
  records.push_back({{stamp, std::move(observation)}, origin.place});
}

Eigen::Matrix3d matrix_of(const std::array<double, 9>& rows) {
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(rows.data());
}

}  // namespace

CameraConversion::CameraConversion(BagCamera camera, double max_pair_s, std::string bag)
    : camera_(std::move(camera)), window_ns_(std::llround(max_pair_s * 1e9)), bag_(std::move(bag)) {}

bool CameraConversion::is_second(std::size_t topic) const {
  return camera_.second == topic || camera_.second_calibration == topic;
}

bool CameraConversion::awaits_calibration(std::size_t topic) const {
  const bool second = is_second(topic);
  const bool has_topic = (second ? camera_.second_calibration : camera_.first_calibration).has_value();
  return has_topic && !sides_[second].calibration;
}

void CameraConversion::calibrate(std::size_t topic, const CameraInfoMessage& message) {
  const bool second = is_second(topic);
  const auto converted = to_calibration(message, second ? camera_.second_is_rectified : camera_.first_is_rectified);
  if (!converted.remark.empty()) say_once(bag_ + ": camera '" + camera_.label + "': " + converted.remark);
  sides_[second].calibration = converted.camera;
  sides_[second].rectification = message;
  if (converted.fisheye)
    set_lens(sides_[second], *converted.fisheye);
  else
    sides_[second].lens.reset();
}

void CameraConversion::set_lens(Side& side, const std::array<double, 4>& fisheye) const {
  if (camera_.kind == BagCameraKind::depth)
    throw Error(ErrorCode::kUnsupported, "camera '" + camera_.label + "' measures depth with a fisheye lens", {},
                "record rectified pictures and depth, or leave the camera out: name the topics to read in "
                "reading.topics");
  if (side.lens && side.lens->is_of(*side.calibration, fisheye)) return;
  side.lens.emplace(*side.calibration, fisheye);
  const auto view_deg = side.lens->view_deg();
  say_once(bag_ + ": camera '" + camera_.label + "' has a fisheye lens: its pictures are rectified, " +
           std::to_string(std::lround(view_deg[0])) + " x " + std::to_string(std::lround(view_deg[1])) +
           " degrees of its view remain");
}

mrpt::img::TCamera CameraConversion::calibration_of(bool second, std::size_t columns, std::size_t rows) const {
  const auto& known = sides_[second].calibration;
  mrpt::img::TCamera camera;
  if (known && known->fx() > 0.0) {
    if (known->ncols != columns || known->nrows != rows)
      throw Error(ErrorCode::kBadInput, "a picture of camera '" + camera_.label + "' has " + std::to_string(columns) +
                                            " x " + std::to_string(rows) + " pixels; " + std::to_string(known->ncols) +
                                            " x " + std::to_string(known->nrows) +
                                            " were expected, as its camera_info says");
    return *known;
  }
  say_once(bag_ + ": camera '" + camera_.label + "' has no calibration: " +
           ((second ? camera_.second_calibration : camera_.first_calibration)
                ? "its camera_info has none"
                : "no topic " + (second ? camera_.second_camera_info : camera_.first_camera_info) +
                      " is there; record it with its pictures, or name it in reading.topics"));
  camera.ncols = static_cast<std::uint32_t>(columns);
  camera.nrows = static_cast<std::uint32_t>(rows);
  camera.setIntrinsicParamsFromValues(0.0, 0.0, 0.0, 0.0);
  return camera;
}

CameraConversion::Picture CameraConversion::decoded(bool second, MessageReader& reader, PictureForm form) {
  Picture picture;
  const auto decode = [&](const auto& message) {
    if (is_depth(second))
      picture.depth = to_depth(message);
    else
      picture.image = to_picture(message);
  };
  if (form == PictureForm::compressed) decode(read_compressed_image(reader));
  if (form == PictureForm::raw) decode(read_image(reader));
  if (form == PictureForm::cloud) {
    const PointCloudMessage message = read_point_cloud(reader);
    const CloudPoints points(message);
    decode(points);
    expect_optical_axes(points);
    if (!camera_.first && points.has_colours()) picture.image = to_picture(points);
  }
  return picture;
}

// By the first cloud that says it. With other axes z would be no depth.
void CameraConversion::expect_optical_axes(const CloudPoints& points) {
  const auto& known = sides_[1].calibration ? sides_[1].calibration : sides_[0].calibration;
  if (has_known_axes_ || !known || known->ncols != points.columns() || known->nrows != points.rows()) return;
  const std::optional<bool> are_optical = are_at_their_pixels(points, *known);
  if (are_optical && !*are_optical)
    throw Error(ErrorCode::kBadInput,
                "the points of camera '" + camera_.label +
                    "' are not seen at their pixels, as its camera_info has them: an organised cloud in the camera's "
                    "optical frame (x right, y down, z ahead) was expected",
                {}, "record its depth image, or leave the cloud out: name the topics to read in reading.topics");
  has_known_axes_ = are_optical.has_value();
}

void CameraConversion::add(std::size_t topic, MessageReader& reader, PictureForm form, PictureOrigin origin,
                           std::vector<PlacedRecord>& records) {
  const bool second = is_second(topic);
  Picture picture = decoded(second, reader, form);
  picture.origin = std::move(origin);
  if (sides_[second].lens) sides_[second].lens->rectify(picture.image);
  const bool is_alone = camera_.kind == BagCameraKind::mono || !camera_.first || is_apart_;
  if (is_alone) return make_single(picture, second, records);
  waiting_[second].push_back(std::move(picture));
  match(false, records);
}

void CameraConversion::finish(std::vector<PlacedRecord>& records) {
  match(true, records);
  for (auto& side : waiting_)
    while (!side.empty()) drop(side);
  if (unpaired_ > 0)
    log(LogLevel::warning, bag_ + ": camera '" + camera_.label + "': " + std::to_string(unpaired_) +
                               " pictures without a partner are left out; " + std::to_string(paired_) +
                               " pairs remain (reading.max_pair_s)");
  unpaired_ = 0;
}

void CameraConversion::drop(std::deque<Picture>& pictures) {
  pictures.pop_front();
  ++unpaired_;
}

void CameraConversion::match(bool is_last, std::vector<PlacedRecord>& records) {
  auto &firsts = waiting_[0], &seconds = waiting_[1];
  while (!firsts.empty() && !seconds.empty()) {
    const std::int64_t first = firsts.front().origin.stamp.ns, second = seconds.front().origin.stamp.ns;
    if (std::abs(first - second) >= std::max<std::int64_t>(window_ns_, 1)) {
      drop(first < second ? firsts : seconds);
      continue;
    }
    // The earlier one may have a follower that is nearer.
    auto& earlier = first < second ? firsts : seconds;
    if (first != second) {
      if (earlier.size() < 2 && !is_last) return;
      const std::int64_t later = std::max(first, second);
      if (earlier.size() > 1 && std::abs(earlier[1].origin.stamp.ns - later) < std::abs(first - second)) {
        drop(earlier);
        continue;
      }
    }
    make(firsts.front(), seconds.front(), records);
    firsts.pop_front();
    seconds.pop_front();
  }
  for (auto& side : waiting_)
    while (side.size() > kMostWaiting) drop(side);
}

void CameraConversion::make(Picture& first, Picture& second, std::vector<PlacedRecord>& records) {
  ++paired_;
  if (camera_.kind == BagCameraKind::stereo) return make_pair(first, second, records);
  const bool is_registered = first.origin.frame == second.origin.frame &&
                             static_cast<std::size_t>(second.depth.cols()) == first.image.getWidth() &&
                             static_cast<std::size_t>(second.depth.rows()) == first.image.getHeight();
  if (is_registered) return make_depth(&first, second, records);
  say_once(
      bag_ + ": camera '" + camera_.label + "': its depth (frame '" + second.origin.frame +
      "') is not registered to its colour pictures (frame '" + first.origin.frame +
      "'); both are read apart. Record depth that is registered (depth_registered, aligned_depth_to_color) for more");
  is_apart_ = true;
  make_single(first, false, records);
  make_single(second, true, records);
}

void CameraConversion::make_single(Picture& picture, bool second, std::vector<PlacedRecord>& records) {
  if (is_depth(second)) return make_depth(picture.image.isEmpty() ? nullptr : &picture, picture, records);
  auto image = std::make_shared<mrpt::obs::CObservationImage>();
  image->cameraPose = to_mrpt_pose(picture.origin.robot_from_camera);
  image->cameraParams = calibration_of(second, picture.image.getWidth(), picture.image.getHeight());
  image->image = std::move(picture.image);
  append(std::move(image), picture.origin, camera_.label, records);
}

// By the rectification of both, which every calibrated pair has; else by the transforms.
Pose3 CameraConversion::left_from_right(const Picture& left, const Picture& right) const {
  const CameraInfoMessage &l = sides_[0].rectification, &r = sides_[1].rectification;
  if (r.projection[0] > 0.0 && r.projection[3] < 0.0) {
    Pose3 pose;
    const double baseline_m = -r.projection[3] / r.projection[0];
    const bool is_rectified = camera_.first_is_rectified && camera_.second_is_rectified;
    const Eigen::Matrix3d left_turned = is_rectified ? Eigen::Matrix3d::Identity() : matrix_of(l.rectification);
    const Eigen::Matrix3d right_turned = is_rectified ? Eigen::Matrix3d::Identity() : matrix_of(r.rectification);
    pose.t = left_turned.transpose() * Eigen::Vector3d(baseline_m, 0.0, 0.0);
    pose.q = Eigen::Quaterniond(Eigen::Matrix3d(left_turned.transpose() * right_turned)).normalized();
    return pose;
  }
  return between(left.origin.robot_from_camera, right.origin.robot_from_camera);
}

void CameraConversion::make_pair(Picture& left, Picture& right, std::vector<PlacedRecord>& records) {
  auto pair = std::make_shared<mrpt::obs::CObservationStereoImages>();
  pair->cameraPose = mrpt::poses::CPose3DQuat(to_mrpt_pose(left.origin.robot_from_camera));
  pair->rightCameraPose = mrpt::poses::CPose3DQuat(to_mrpt_pose(left_from_right(left, right)));
  pair->leftCamera = calibration_of(false, left.image.getWidth(), left.image.getHeight());
  pair->rightCamera = calibration_of(true, right.image.getWidth(), right.image.getHeight());
  pair->hasImageRight = true;
  pair->imageLeft = std::move(left.image);
  pair->imageRight = std::move(right.image);
  append(std::move(pair), left.origin, camera_.label, records);
}

void CameraConversion::make_depth(Picture* colour, Picture& depth, std::vector<PlacedRecord>& records) {
  auto scan = std::make_shared<mrpt::obs::CObservation3DRangeScan>();
  // Of the depth camera MRPT has x ahead and z up, of the other one optical axes.
  scan->relativePoseIntensityWRTDepth = looking_ahead();
  scan->sensorPose = to_mrpt_pose((colour != nullptr ? *colour : depth).origin.robot_from_camera) +
                     (mrpt::poses::CPose3D() - looking_ahead());
  const auto columns = static_cast<std::size_t>(depth.depth.cols()),
             rows = static_cast<std::size_t>(depth.depth.rows());
  scan->cameraParams = scan->cameraParamsIntensity =
      calibration_of(colour == nullptr || colour == &depth, columns, rows);
  scan->hasRangeImage = true;
  scan->rangeImage = std::move(depth.depth);
  scan->range_is_depth = true;
  scan->rangeUnits = kDepthUnit_m;
  scan->maxRange = 65535.0f * kDepthUnit_m;
  if (colour != nullptr) {
    scan->hasIntensityImage = true;
    scan->intensityImage = std::move(colour->image);
    set_depth_delay_ns(*scan, depth.origin.stamp.ns - colour->origin.stamp.ns);
  }
  append(std::move(scan), colour != nullptr ? colour->origin : depth.origin, camera_.label, records);
}

}  // namespace mapweave::rawlog::ros
