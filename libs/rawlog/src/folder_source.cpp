// A folder's pictures and inertial measurements as observations, in the order of stamps. Pictures of light stay in
// their files and are loaded by whoever looks at them, but each is looked at here: that it is there, whole, and of its
// calibration's size. Depth is decoded.

#include "camera_folder.h"
#include "picture_file.h"
#include "picture_lists.h"

#include <mapweave/core/median.h>
#include <mapweave/rawlog/depth_delay.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapweave::rawlog {
namespace {

constexpr double kNearestDepth_m = 0.05, kFarthestDepth_m = 100.0;  // of a median that can be
constexpr double kHalfTurn = 3.14159265358979323846;

class ImuReader {
 public:
  ImuReader(const std::filesystem::path& folder, const ImuFile& imu)
      : imu_(imu), path_(folder / imu.file), rows_(path_, imu.is_csv ? kCommaSeparated : kBlankSeparated) {}

  // The stamp of the next row; nullopt at the end.
  std::optional<Stamp> next_stamp() {
    if (!waiting_ && !ended_) advance();
    return waiting_ ? std::optional(waiting_->record.stamp) : std::nullopt;
  }
  PlacedRecord take() { return *std::exchange(waiting_, std::nullopt); }
  const ByteSource& bytes() const { return rows_.bytes(); }
  std::string place_name(std::uint64_t line) const { return path_.string() + ":" + std::to_string(line); }

 private:
  void advance() {
    std::string first;
    auto fields = rows_.next(first);
    ended_ = !fields;
    if (ended_) return;
    const Stamp stamp = parse_stamp(first, imu_.is_csv ? StampUnit::kNanoseconds : StampUnit::kSeconds, *fields);
    expect_rising(before_, stamp, *fields);
    before_ = stamp;
    auto imu = std::make_shared<mrpt::obs::CObservationIMU>();
    imu->timestamp = to_mrpt_time(stamp);
    imu->sensorLabel = "IMU";
    imu->sensorPose = imu_.robot_from_imu;
    if (imu_.is_csv)
      for (const auto index : {mrpt::obs::IMU_WX, mrpt::obs::IMU_WY, mrpt::obs::IMU_WZ})
        imu->set(index, fields->number("a turn rate"));
    for (const auto index : {mrpt::obs::IMU_X_ACC, mrpt::obs::IMU_Y_ACC, mrpt::obs::IMU_Z_ACC})
      imu->set(index, fields->number("an acceleration"));
    waiting_ = PlacedRecord{{to_stamp(imu->timestamp), imu}, rows_.line()};
  }

  ImuFile imu_;
  std::filesystem::path path_;
  RowReader rows_;
  std::optional<PlacedRecord> waiting_;
  std::optional<Stamp> before_;
  bool ended_ = false;
};

class FolderSource final : public RecordSource {
 public:
  explicit FolderSource(CameraFolder folder) : folder_(std::move(folder)) {
    if (folder_.imu) imu_ = std::make_unique<ImuReader>(folder_.folder, *folder_.imu);
    for (const FolderFrame& frame : folder_.frames) bytes_total_ += bytes_of(frame);
    if (imu_) bytes_total_ += imu_->bytes().file_bytes();
  }

  bool read(std::vector<PlacedRecord>& records) override {
    const auto imu_stamp = imu_ ? imu_->next_stamp() : std::nullopt;
    const bool has_frame = next_ < folder_.frames.size();
    if (imu_stamp && (!has_frame || !(to_stamp(to_mrpt_time(folder_.frames[next_].stamp)) < *imu_stamp))) {
      records.push_back(imu_->take());
      records.back().place = 2 * records.back().place + 1;
      return true;
    }
    if (!has_frame) {
      if (folder_.trouble) throw *folder_.trouble;
      return false;
    }
    const FolderFrame& frame = folder_.frames[next_];
    auto observation = observation_of(frame);
    records.push_back({{to_stamp(observation->timestamp), std::move(observation)}, 2 * next_});
    bytes_read_ += bytes_of(frame);
    ++next_;
    return true;
  }

  bool is_in_order() const override { return true; }
  std::string place_name(std::uint64_t place) const override {
    if (place % 2 == 1) return imu_->place_name(place / 2);
    return (folder_.folder / folder_.frames[place / 2].first).string();
  }
  std::string path() const override { return folder_.folder.string(); }
  std::uint64_t bytes_read() const override { return bytes_read_ + (imu_ ? imu_->bytes().file_bytes_read() : 0); }
  std::uint64_t bytes_total() const override { return bytes_total_; }

 private:
  std::uint64_t bytes_of(const FolderFrame& frame) const {  // 0 for what is missing: said once it is the frame's turn
    const auto size = [&](const std::filesystem::path& name) -> std::uint64_t {
      std::error_code problem;
      const auto bytes = name.empty() ? 0 : std::filesystem::file_size(folder_.folder / name, problem);
      return problem ? 0 : bytes;
    };
    return size(frame.first) + size(frame.second);
  }

  std::shared_ptr<mrpt::obs::CObservation> observation_of(const FolderFrame& frame) {
    std::shared_ptr<mrpt::obs::CObservation> observation;
    if (folder_.kind == FolderKind::kMono) {
      auto image = std::make_shared<mrpt::obs::CObservationImage>();
      image->sensorLabel = "CAMERA";
      image->cameraPose = folder_.robot_from_first;
      image->cameraParams = folder_.first;
      image->image.setExternalStorage(picture(frame.first, folder_.first));
      observation = image;
    } else if (folder_.kind == FolderKind::kStereo) {
      auto pair = std::make_shared<mrpt::obs::CObservationStereoImages>();
      pair->sensorLabel = "STEREO";
      pair->cameraPose = mrpt::poses::CPose3DQuat(folder_.robot_from_first);
      pair->rightCameraPose = mrpt::poses::CPose3DQuat(folder_.first_from_second);
      pair->leftCamera = folder_.first;
      pair->rightCamera = folder_.second;
      pair->hasImageRight = true;
      pair->imageLeft.setExternalStorage(picture(frame.first, folder_.first));
      pair->imageRight.setExternalStorage(picture(frame.second, folder_.second));
      observation = pair;
    } else {
      observation = depth_of(frame);
    }
    observation->timestamp = to_mrpt_time(frame.stamp);
    return observation;
  }

  std::shared_ptr<mrpt::obs::CObservation> depth_of(const FolderFrame& frame) {
    auto scan = std::make_shared<mrpt::obs::CObservation3DRangeScan>();
    scan->sensorLabel = "RGBD";
    // Registered: both pictures are of one camera. Of the depth camera MRPT has x ahead and z up, of the other one
    // optical axes.
    scan->relativePoseIntensityWRTDepth = looking_ahead();
    scan->sensorPose = folder_.robot_from_first + (mrpt::poses::CPose3D() - looking_ahead());
    scan->cameraParams = scan->cameraParamsIntensity = folder_.first;
    scan->hasIntensityImage = true;
    scan->intensityImage.setExternalStorage(picture(frame.first, folder_.first));
    const auto file = folder_.folder / frame.second;
    expect_size(file, look_at_picture(file), folder_.first);
    scan->hasRangeImage = true;
    scan->rangeImage = read_depth_picture(file);
    scan->range_is_depth = true;
    scan->rangeUnits = static_cast<float>(1.0 / folder_.depth_scale);
    scan->maxRange = static_cast<float>(65535.0 / folder_.depth_scale);
    if (!scale_is_checked_) check_scale(file, scan->rangeImage);
    set_depth_delay_ns(*scan, frame.second_stamp.ns - frame.stamp.ns);
    return scan;
  }

  std::string picture(const std::filesystem::path& name, const mrpt::img::TCamera& camera) const {
    const auto file = folder_.folder / name;
    const PictureFile found = look_at_picture(file);
    expect_size(file, found, camera);
    if (found.bits > 8)
      throw Error(ErrorCode::kBadInput,
                  "the picture has " + std::to_string(found.bits) + " bits a channel; 8 were expected", file.string(),
                  "convert the pictures to 8 bits");
    return file.string();
  }

  void expect_size(const std::filesystem::path& file, const PictureFile& found,
                   const mrpt::img::TCamera& camera) const {
    if (found.width == camera.ncols && found.height == camera.nrows) return;
    const auto text = [](std::uint32_t width, std::uint32_t height) {
      return std::to_string(width) + " x " + std::to_string(height);
    };
    throw Error(ErrorCode::kBadInput,
                "the picture has " + text(found.width, found.height) + " pixels; " + text(camera.ncols, camera.nrows) +
                    " were expected, as " + folder_.calibration.string() + " says",
                file.string(), "give the calibration of these pictures");
  }

  // Of the first depth picture that has readings: a scale that is off by a thousand makes a map of nothing.
  void check_scale(const std::filesystem::path& file, const mrpt::math::CMatrix_u16& depth) {
    std::vector<std::uint16_t> readings;
    std::copy_if(depth.data(), depth.data() + depth.size(), std::back_inserter(readings),
                 [](std::uint16_t steps) { return steps != 0; });
    if (readings.empty()) return;
    scale_is_checked_ = true;
    const double median_m = median(std::move(readings)) / folder_.depth_scale;
    if (median_m >= kNearestDepth_m && median_m <= kFarthestDepth_m) return;
    throw Error(ErrorCode::kBadInput,
                "the median depth is " + std::to_string(median_m) + " m with a depth_scale of " +
                    std::to_string(folder_.depth_scale) + "; 0.05 to 100 m were expected",
                file.string(), "correct depth_scale in " + folder_.calibration.string() + " (steps to the metre)");
  }

  CameraFolder folder_;
  std::unique_ptr<ImuReader> imu_;
  std::size_t next_ = 0;
  std::uint64_t bytes_read_ = 0, bytes_total_ = 0;
  bool scale_is_checked_ = false;
};

}  // namespace

mrpt::poses::CPose3D looking_ahead() { return {0.0, 0.0, 0.0, -kHalfTurn / 2, 0.0, -kHalfTurn / 2}; }

std::unique_ptr<RecordSource> open_folder(CameraFolder folder) {
  folder.folder = std::filesystem::absolute(folder.folder).lexically_normal();
  return std::make_unique<FolderSource>(std::move(folder));
}

}  // namespace mapweave::rawlog
