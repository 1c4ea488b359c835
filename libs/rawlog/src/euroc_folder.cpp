// EuRoC: as published (mav0/cam0/data.csv and sensor.yaml, mav0/imu0/...), or reduced to one level (stereo.txt or
// cam0/data.csv, with cam0_sensor.yaml and imu0.csv). The robot's frame is the data set's body frame: T_BS is the pose
// of a sensor in it.

#include "calibration_file.h"
#include "folder_split.h"
#include "picture_lists.h"

#include <mapweave/core/log.h>

namespace mapweave::rawlog {
namespace {

constexpr const char* kKeys =
    "T_BS (with data: 16 numbers), resolution, intrinsics: [fu, fv, cu, cv], distortion_model and "
    "distortion_coefficients";
constexpr double kSamePairSeconds = 0.001;  // the two cameras are triggered together

struct Camera {
  mrpt::img::TCamera camera;
  mrpt::poses::CPose3D robot_from_camera;
};

bool is_there(const std::filesystem::path& path) {
  std::error_code ignored;
  return std::filesystem::exists(path, ignored);
}

mrpt::poses::CPose3D pose_in(const CalibrationFile& sensor) {
  return make_pose(sensor.numbers("T_BS", "data", 16), sensor.path().string() + ": T_BS");
}

Camera read_camera(const std::filesystem::path& file) {
  const CalibrationFile sensor(file, kKeys);
  if (sensor.has("camera_model") && sensor.text("camera_model") != "pinhole")
    throw sensor.wrong("camera_model", "is '" + sensor.text("camera_model") + "'; pinhole is what is read");
  const bool is_straight = !sensor.has("distortion_model") && !sensor.has("distortion_coefficients");
  const std::string model = is_straight ? "none" : sensor.text("distortion_model");
  if (!is_straight && model != "radial-tangential" && model != "radtan" && model != "plumb_bob")
    throw sensor.wrong("distortion_model", "is '" + model + "'; radial-tangential is what is read");
  const auto resolution = sensor.numbers("resolution", 2, 2);
  return {
      make_camera(resolution[0], resolution[1], sensor.numbers("intrinsics", 4, 4),
                  is_straight ? std::vector<double>() : sensor.numbers("distortion_coefficients", 4, 5), file.string()),
      pose_in(sensor)};
}

// Where the parts of one layout lie, relative to the folder.
struct Layout {
  std::filesystem::path base;
  bool is_reduced;
  std::filesystem::path calibration(const std::string& sensor) const {
    return is_reduced ? std::filesystem::path(sensor + "_sensor.yaml") : base / sensor / "sensor.yaml";
  }
  std::filesystem::path list(const std::string& camera) const { return base / camera / "data.csv"; }
};

Layout layout_of(const std::filesystem::path& folder) {
  if (is_there(folder / "mav0")) return {"mav0", false};
  return {"", !is_there(folder / "cam0/sensor.yaml")};
}

void read_stereo_list(CameraFolder& found, const std::filesystem::path& list) {
  found.trouble = for_each_row(list, kBlankSeparated, [&](const std::string& text, Fields& fields) {
    const Stamp stamp = parse_stamp(text, StampUnit::kSeconds, fields);
    expect_rising(found.frames.empty() ? std::nullopt : std::optional(found.frames.back().stamp), stamp, fields);
    FolderFrame frame{stamp, stamp, text, text, parse_picture(fields), {}};
    if (found.kind == FolderKind::kStereo) frame.second = parse_picture(fields);
    found.frames.push_back(std::move(frame));
  });
}

void read_camera_lists(CameraFolder& found, const Layout& layout) {
  const auto read = [&](const std::string& camera) {
    const auto list = layout.list(camera);
    return read_picture_list(found.folder / list, kCommaSeparated, StampUnit::kNanoseconds,
                             list.parent_path() / "data");
  };
  const PictureList left = read("cam0");
  found.trouble = left.trouble;
  if (found.kind == FolderKind::kMono) {
    for (const ListedPicture& picture : left.pictures)
      found.frames.push_back({picture.stamp, {}, picture.stamp_text, {}, picture.file, {}});
    return;
  }
  const PictureList right = read("cam1");
  if (!found.trouble) found.trouble = right.trouble;
  for (const auto& [i, j] : pair_by_stamp(left.pictures, right.pictures, kSamePairSeconds, found.folder)) {
    const ListedPicture &first = left.pictures[i], &second = right.pictures[j];
    found.frames.push_back({first.stamp, second.stamp, first.stamp_text, second.stamp_text, first.file, second.file});
  }
  if (found.frames.empty())
    throw Error(ErrorCode::kBadInput, "no pictures of cam0 and cam1 were taken together (within 1 ms)",
                found.folder.string(), "copy the lists of both cameras again");
  if (const auto alone = left.pictures.size() - found.frames.size(); alone > 0)
    log(LogLevel::warning,
        found.folder.string() + ": " + std::to_string(alone) + " left pictures without a right one are left out");
}

}  // namespace

bool is_euroc_folder(const std::filesystem::path& folder) {
  return is_there(folder / "mav0") || is_there(folder / "cam0_sensor.yaml") || is_there(folder / "cam0/data.csv") ||
         (is_there(folder / "stereo.txt") && is_there(folder / "cam0"));
}

CameraFolder read_euroc_folder(const std::filesystem::path& folder, const ReadOptions&) {
  CameraFolder found;
  found.folder = folder;
  const Layout layout = layout_of(folder);
  found.calibration = folder / layout.calibration("cam0");
  const Camera left = read_camera(found.calibration);
  found.first = left.camera;
  found.robot_from_first = left.robot_from_camera;
  if (is_there(folder / layout.base / "cam1") || is_there(folder / layout.calibration("cam1"))) {
    found.kind = FolderKind::kStereo;
    const Camera right = read_camera(folder / layout.calibration("cam1"));
    found.second = right.camera;
    found.first_from_second = right.robot_from_camera - left.robot_from_camera;
  }
  if (layout.is_reduced && is_there(folder / "stereo.txt"))
    read_stereo_list(found, folder / "stereo.txt");
  else
    read_camera_lists(found, layout);
  for (const std::filesystem::path& file : {layout.base / "imu0" / "data.csv", std::filesystem::path("imu0.csv")}) {
    if (!is_there(folder / file)) continue;
    found.imu = ImuFile{file, true, {}};  // the body frame is the IMU's where nothing else is said
    if (is_there(folder / layout.calibration("imu0")))
      found.imu->robot_from_imu =
          pose_in(CalibrationFile(folder / layout.calibration("imu0"), "T_BS (with data: 16 numbers)"));
    break;
  }
  return found;
}

void write_euroc_part(const CameraFolder& whole, const FolderPart& part, const std::filesystem::path& out) {
  const Layout layout = layout_of(whole.folder);
  const bool has_pairs = layout.is_reduced && is_there(whole.folder / "stereo.txt");
  const std::string header = "#timestamp [ns],filename\n";
  std::string left = header, right = header, pairs;
  for (std::size_t i = part.begin; i < part.end; ++i) {
    const FolderFrame& frame = whole.frames[i];
    left += frame.stamp_text + "," + frame.first.filename().string() + "\n";
    right += frame.second_stamp_text + "," + frame.second.filename().string() + "\n";
    pairs += frame.stamp_text + " " + frame.first.generic_string() + " " + frame.second.generic_string() + "\n";
    link_file(whole.folder / frame.first, out / frame.first);
    if (!frame.second.empty()) link_file(whole.folder / frame.second, out / frame.second);
  }
  if (has_pairs)
    write_list(out / "stereo.txt", pairs);
  else
    write_list(out / layout.list("cam0"), left);
  if (!has_pairs && whole.kind == FolderKind::kStereo) write_list(out / layout.list("cam1"), right);
  for (const char* sensor : {"cam0", "cam1", "imu0"}) copy_if_there(whole, layout.calibration(sensor), out);
  for (const auto& name : {std::filesystem::path("groundtruth.txt"), layout.base / "body.yaml",
                           layout.base / "state_groundtruth_estimate0" / "data.csv"})
    copy_if_there(whole, name, out);
}

}  // namespace mapweave::rawlog
