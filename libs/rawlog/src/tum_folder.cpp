// TUM RGB-D: rgb.txt and depth.txt list stamps and pictures, associations.txt pairs of both; camera.yaml is ours: the
// data set has none, and its own cameras are known by the names of its folders.

#include "calibration_file.h"
#include "folder_split.h"
#include "picture_lists.h"
#include "say_once.h"

#include <mapweave/core/files.h>
#include <mapweave/core/log.h>
#include <mapweave/core/nearest_name.h>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace mapweave::rawlog {
namespace {

constexpr const char* kKeys =
    "width, height, fx, fy, cx, cy (pixels), distortion: [k1, k2, p1, p2, k3] (without it: none), depth_scale (steps "
    "of the depth "
    "pictures to the metre) and, "
    "where it is known, robot_from_camera: [x, y, z, qx, qy, qz, qw]";

const std::vector<std::string>& known_keys() {
  static const std::vector<std::string> keys = {"camera_model",
                                                "width",
                                                "height",
                                                "fx",
                                                "fy",
                                                "cx",
                                                "cy",
                                                "distortion",
                                                "distortion_model",
                                                "depth_scale",
                                                "depth_registered_to_color",
                                                "robot_from_camera"};
  return keys;
}

// The colour cameras of the data set, as its page and everybody who uses it have them.
struct KnownCamera {
  const char* name;  // part of the folders' names
  std::vector<double> fx_fy_cx_cy, distortion;
};
constexpr double kKnownWidth = 640.0, kKnownHeight = 480.0, kKnownDepthScale = 5000.0;

const std::vector<KnownCamera>& known_cameras() {
  static const std::vector<KnownCamera> cameras = {
      {"freiburg1",
       {517.306408, 516.469215, 318.643040, 255.313989},
       {0.262383, -0.953104, -0.005358, 0.002628, 1.163314}},
      {"freiburg2",
       {520.908620, 521.007327, 325.141442, 249.701764},
       {0.231222, -0.784899, -0.003257, -0.000105, 0.917205}},
      {"freiburg3", {535.4, 539.2, 320.1, 247.6}, {0.0, 0.0, 0.0, 0.0, 0.0}},
  };
  return cameras;
}

mrpt::poses::CPose3D pose_of(const CalibrationFile& camera) {
  if (!camera.has("robot_from_camera")) return looking_ahead();
  const auto pose = camera.numbers("robot_from_camera", 7, 7);
  const double norm = std::sqrt(pose[3] * pose[3] + pose[4] * pose[4] + pose[5] * pose[5] + pose[6] * pose[6]);
  if (!(std::abs(norm - 1.0) < 1e-3))
    throw camera.wrong("robot_from_camera", "has a quaternion of another length than 1");
  const mrpt::math::CQuaternionDouble rotation(pose[6] / norm, pose[3] / norm, pose[4] / norm, pose[5] / norm);
  return mrpt::poses::CPose3D(rotation, pose[0], pose[1], pose[2]);
}

// By the name that the data set gives its folders: rgbd_dataset_freiburg1_rpy.
bool take_known_camera(CameraFolder& found) {
  const std::string name = std::filesystem::absolute(found.folder).lexically_normal().string();
  const std::size_t slash = name.find_last_of('/', name.size() - 2);
  for (const KnownCamera& camera : known_cameras()) {
    if (name.find(camera.name, slash + 1) == std::string::npos) continue;
    found.calibration = std::string("the calibration of TUM's ") + camera.name;
    found.first = make_camera(kKnownWidth, kKnownHeight, camera.fx_fy_cx_cy, camera.distortion, camera.name);
    found.depth_scale = kKnownDepthScale;
    found.robot_from_first = looking_ahead();
    say_once(found.folder.string() + ": there is no camera.yaml; by the folder's name the camera is that of TUM's " +
             camera.name + ", whose calibration is used");
    return true;
  }
  return false;
}

// A key that is nearly one that is missing was misspelt; others are of no use here.
void check_keys(const CalibrationFile& camera) {
  std::string unused;
  for (const std::string& key : camera.keys()) {
    const std::vector<std::string>& known = known_keys();
    if (!camera.has("distortion") && (key.rfind("dist", 0) == 0 || key == "k1"))
      throw camera.wrong(key, "is there, but no 'distortion'; a camera without any needs neither");
    if (std::find(known.begin(), known.end(), key) != known.end()) continue;
    const auto meant = nearest_name(key, known);
    if (meant && !camera.has(*meant)) throw camera.wrong(key, "is unknown; did you mean '" + *meant + "'?");
    unused += (unused.empty() ? "" : ", ") + key;
  }
  if (!unused.empty()) say_once(camera.path().string() + ": not used, as nobody here knows them: " + unused);
}

void read_calibration(CameraFolder& found) {
  found.calibration = found.folder / "camera.yaml";
  if (!is_file(found.calibration) && take_known_camera(found)) return;
  const CalibrationFile camera(found.calibration, kKeys);
  check_keys(camera);
  if (camera.has("camera_model") && camera.text("camera_model") != "pinhole")
    throw camera.wrong("camera_model", "is '" + camera.text("camera_model") + "'; pinhole is what is read");
  const auto distortion = camera.has("distortion") ? camera.numbers("distortion", 4, 5) : std::vector<double>();
  found.first = make_camera(camera.number("width"), camera.number("height"),
                            {camera.number("fx"), camera.number("fy"), camera.number("cx"), camera.number("cy")},
                            distortion, found.calibration.string());
  found.robot_from_first = pose_of(camera);
  if (found.kind != FolderKind::kDepth) return;
  found.depth_scale = camera.number("depth_scale");
  if (!(found.depth_scale > 0.0))
    throw camera.wrong("depth_scale", "must be above 0: steps of the depth pictures to the metre");
  if (camera.has("depth_registered_to_color") && !camera.flag("depth_registered_to_color"))
    throw camera.wrong("depth_registered_to_color",
                       "is false; depth pictures as seen from the colour camera are what is read");
}

void report_left_out(const CameraFolder& found, std::size_t left_out, const std::string& what) {
  if (left_out > 0)
    log(LogLevel::warning, found.folder.string() + ": " + std::to_string(left_out) + " " + what + " are left out; " +
                               std::to_string(found.frames.size()) + " frames remain (reading.max_pair_s)");
}

[[noreturn]] void throw_never_pair(const CameraFolder& found, const std::string& range, double window_s) {
  throw Error(ErrorCode::kBadInput,
              "no colour and depth pictures are within " + std::to_string(window_s) + " s of each other" + range,
              found.folder.string(), "repair the stamps, or widen reading.max_pair_s");
}

void read_associations(CameraFolder& found, const std::filesystem::path& list, double window_s) {
  std::size_t rows = 0;
  std::optional<Stamp> before;
  found.trouble = for_each_row(list, kBlankSeparated, [&](const std::string& first, Fields& fields) {
    FolderFrame frame;
    frame.stamp = parse_stamp(first, StampUnit::kSeconds, fields);
    expect_rising(before, frame.stamp, fields);
    before = frame.stamp;
    frame.stamp_text = first;
    frame.first = parse_picture(fields);
    frame.second_stamp_text = fields.text("the depth picture's stamp");
    frame.second_stamp = parse_stamp(frame.second_stamp_text, StampUnit::kSeconds, fields);
    frame.second = parse_picture(fields);
    ++rows;
    if (std::abs(seconds_between(frame.stamp, frame.second_stamp)) < window_s) found.frames.push_back(std::move(frame));
  });
  if (found.frames.empty()) throw_never_pair(found, "", window_s);
  report_left_out(found, rows - found.frames.size(), "pairs of associations.txt lie too far apart and");
}

void read_lists(CameraFolder& found, double window_s) {
  const auto colour = read_picture_list(found.folder / "rgb.txt", kBlankSeparated, StampUnit::kSeconds);
  found.trouble = colour.trouble;
  if (found.kind == FolderKind::kMono) {
    for (const ListedPicture& picture : colour.pictures)
      found.frames.push_back({picture.stamp, {}, picture.stamp_text, {}, picture.file, {}});
    return;
  }
  const auto depth = read_picture_list(found.folder / "depth.txt", kBlankSeparated, StampUnit::kSeconds);
  if (!found.trouble) found.trouble = depth.trouble;
  for (const auto& [i, j] : pair_by_stamp(colour.pictures, depth.pictures, window_s, found.folder)) {
    const ListedPicture &first = colour.pictures[i], &second = depth.pictures[j];
    found.frames.push_back({first.stamp, second.stamp, first.stamp_text, second.stamp_text, first.file, second.file});
  }
  const auto range = [](const PictureList& list) {
    return list.pictures.front().stamp_text + " to " + list.pictures.back().stamp_text;
  };
  if (found.frames.empty())
    throw_never_pair(found, " (colour: " + range(colour) + ", depth: " + range(depth) + ")", window_s);
  report_left_out(found, colour.pictures.size() - found.frames.size(), "colour pictures without depth");
}

}  // namespace

bool is_tum_folder(const std::filesystem::path& folder) {
  return is_file(folder / "rgb.txt") || is_file(folder / "associations.txt") || is_file(folder / "depth.txt");
}

CameraFolder read_tum_folder(const std::filesystem::path& folder, const ReadOptions& options) {
  CameraFolder found;
  found.folder = folder;
  const bool has_associations = is_file(folder / "associations.txt");
  std::error_code ignored;
  const bool has_depth = is_file(folder / "depth.txt") || std::filesystem::is_directory(folder / "depth", ignored);
  found.kind = has_associations || has_depth ? FolderKind::kDepth : FolderKind::kMono;
  read_calibration(found);
  if (has_associations)
    read_associations(found, folder / "associations.txt", options.max_pair_s);
  else
    read_lists(found, options.max_pair_s);
  // The data set does not say how the accelerometer stands; its axes are taken for the camera's.
  if (is_file(folder / "accelerometer.txt")) found.imu = ImuFile{"accelerometer.txt", false, found.robot_from_first};
  return found;
}

namespace {

std::string calibration_text(const CameraFolder& whole) {
  const mrpt::img::TCamera& camera = whole.first;
  std::ostringstream text;
  text.precision(9);
  text << "width: " << camera.ncols << "\nheight: " << camera.nrows << "\nfx: " << camera.fx()
       << "\nfy: " << camera.fy() << "\ncx: " << camera.cx() << "\ncy: " << camera.cy() << "\ndistortion: ["
       << camera.k1() << ", " << camera.k2() << ", " << camera.p1() << ", " << camera.p2() << ", " << camera.k3()
       << "]\ndepth_scale: " << whole.depth_scale << "\n";
  return text.str();
}

}  // namespace

void write_tum_part(const CameraFolder& whole, const FolderPart& part, const std::filesystem::path& out) {
  const std::string header = "# timestamp filename\n";
  std::string colour = header, depth = header, pairs;
  for (std::size_t i = part.begin; i < part.end; ++i) {
    const FolderFrame& frame = whole.frames[i];
    const std::string first = frame.stamp_text + " " + frame.first.generic_string();
    colour += first + "\n";
    link_file(whole.folder / frame.first, out / frame.first);
    if (whole.kind != FolderKind::kDepth) continue;
    const std::string second = frame.second_stamp_text + " " + frame.second.generic_string();
    depth += second + "\n";
    pairs += first + " " + second + "\n";
    link_file(whole.folder / frame.second, out / frame.second);
  }
  // Pictures that are paired stay so in lists that lack the others; each list is written where the whole has it.
  if (is_file(whole.folder / "rgb.txt")) write_list(out / "rgb.txt", colour);
  if (is_file(whole.folder / "depth.txt")) write_list(out / "depth.txt", depth);
  if (is_file(whole.folder / "associations.txt")) write_list(out / "associations.txt", pairs);
  for (const char* name : {"camera.yaml", "groundtruth.txt"}) copy_if_there(whole, name, out);
  if (!is_file(whole.folder / "camera.yaml"))
    write_list(out / "camera.yaml", calibration_text(whole));  // parts have other names
}

}  // namespace mapweave::rawlog
