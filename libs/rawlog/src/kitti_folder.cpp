// KITTI odometry: image_0 and image_1 (grey) or image_2 and image_3 (colour), rectified, their files numbered by the
// lines of times.txt; calib.txt holds a 3 x 4 projection of each camera.

#include "calibration_file.h"
#include "folder_split.h"
#include "picture_file.h"
#include "picture_lists.h"

#include <mapweave/core/files.h>
#include <mapweave/core/log.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <iterator>
#include <map>
#include <sstream>

namespace mapweave::rawlog {
namespace {

using Projection = std::array<double, 12>;  // row by row

// By their numbers: "000042.png" is 42.
std::map<std::size_t, std::filesystem::path> pictures_in(const std::filesystem::path& folder,
                                                         const std::string& camera) {
  std::map<std::size_t, std::filesystem::path> found;
  std::error_code problem;
  for (const auto& entry : std::filesystem::directory_iterator(folder / camera, problem)) {
    const std::string stem = entry.path().stem().string(), extension = entry.path().extension().string();
    std::size_t number = 0;
    const auto [end, bad] = std::from_chars(stem.data(), stem.data() + stem.size(), number);
    if (bad != std::errc{} || end != stem.data() + stem.size()) continue;
    if (extension != ".png" && extension != ".jpg" && extension != ".jpeg") continue;
    auto& name = found[number];
    name = std::max(
        name, std::filesystem::path(camera) / entry.path().filename());  // of a .jpg and a .png the latter, always
  }
  if (problem || found.empty())
    throw Error(ErrorCode::kMissing, "holds no pictures; numbered ones (000000.png) were expected",
                (folder / camera).string(), "copy the recording again");
  return found;
}

std::map<std::string, Projection> projections_in(const std::filesystem::path& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored))
    throw Error(ErrorCode::kMissing, "there is no calibration", file.string(),
                "copy it from the data set: lines P0: to P3:, each with the 12 numbers of a projection");
  std::map<std::string, Projection> found;
  const auto trouble = for_each_row(file, kBlankSeparated, [&](const std::string& first, Fields& fields) {
    if (first.front() != 'P') return;  // Tr: of the laser
    Projection& projection = found[first.substr(0, first.find(':'))];
    for (double& number : projection) number = fields.number("a projection's number");
    fields.expect_end("a projection of 12 numbers");
  });
  if (trouble) throw *trouble;
  return found;
}

const Projection& projection_of(const std::map<std::string, Projection>& projections, const std::string& name,
                                const std::filesystem::path& file) {
  const auto found = projections.find(name);
  if (found != projections.end()) return found->second;
  throw Error(ErrorCode::kBadInput, "holds no projection '" + name + ":'; one was expected", file.string(),
              "copy the file from the data set again");
}

// The size stands nowhere but in the pictures; the first one's holds for all.
mrpt::img::TCamera camera_of(const Projection& projection, const std::filesystem::path& picture,
                             const std::string& where) {
  const PictureFile size = look_at_picture(picture);
  return make_camera(size.width, size.height, {projection[0], projection[5], projection[2], projection[6]}, {}, where);
}

double right_of_origin_m(const Projection& projection) { return -projection[3] / projection[0]; }

}  // namespace

bool is_kitti_folder(const std::filesystem::path& folder) {
  for (const char* camera : {"image_0", "image_1", "image_2", "image_3"})
    if (is_folder(folder / camera)) return true;
  return false;
}

CameraFolder read_kitti_folder(const std::filesystem::path& folder, const ReadOptions&) {
  CameraFolder found;
  found.folder = folder;
  found.calibration = folder / "calib.txt";
  const bool is_grey = is_folder(folder / "image_0") || is_folder(folder / "image_1");
  const std::string left = is_grey ? "image_0" : "image_2", right = is_grey ? "image_1" : "image_3";
  found.kind = is_folder(folder / right) ? FolderKind::kStereo : FolderKind::kMono;
  const auto projections = projections_in(found.calibration);
  const auto firsts = pictures_in(folder, left);
  const auto& projection = projection_of(projections, is_grey ? "P0" : "P2", found.calibration);
  found.first = camera_of(projection, folder / firsts.begin()->second, found.calibration.string());
  found.robot_from_first = looking_ahead();
  std::map<std::size_t, std::filesystem::path> seconds;
  if (found.kind == FolderKind::kStereo) {
    seconds = pictures_in(folder, right);
    const auto& other = projection_of(projections, is_grey ? "P1" : "P3", found.calibration);
    found.second = camera_of(other, folder / seconds.begin()->second, found.calibration.string());
    const double baseline_m = right_of_origin_m(other) - right_of_origin_m(projection);
    if (!(baseline_m > 0.0))
      throw Error(ErrorCode::kBadInput,
                  right + " stands " + std::to_string(-baseline_m) + " m left of " + left +
                      "; a place right of it was expected",
                  found.calibration.string(), "swap the folders of the two cameras, or their projections");
    found.first_from_second = mrpt::poses::CPose3D(baseline_m, 0.0, 0.0, 0.0, 0.0, 0.0);
  }
  // A picture that is missing gets the name that it should have, and is missed when its turn comes.
  const auto name_in = [](const auto& pictures, const std::string& camera, std::size_t number) {
    const auto picture = pictures.find(number);
    if (picture != pictures.end()) return picture->second;
    const std::string sample = pictures.begin()->second.filename().string(), digits = std::to_string(number);
    const auto width = pictures.begin()->second.stem().string().size();
    return std::filesystem::path(camera) /
           (std::string(width > digits.size() ? width - digits.size() : 0, '0') + digits + sample.substr(width));
  };
  found.trouble = for_each_row(folder / "times.txt", kBlankSeparated, [&](const std::string& text, Fields& fields) {
    const Stamp stamp = parse_stamp(text, StampUnit::kSeconds, fields);
    expect_rising(found.frames.empty() ? std::nullopt : std::optional(found.frames.back().stamp), stamp, fields);
    const std::size_t number = found.frames.size();
    FolderFrame frame{stamp, stamp, text, text, name_in(firsts, left, number), {}};
    if (found.kind == FolderKind::kStereo) frame.second = name_in(seconds, right, number);
    found.frames.push_back(std::move(frame));
  });
  const auto untimed = std::distance(firsts.lower_bound(found.frames.size()), firsts.end());
  if (untimed > 0 && !found.trouble)
    log(LogLevel::warning, folder.string() + ": " + std::to_string(untimed) + " pictures of " + left +
                               " are left out; times.txt ends before");
  return found;
}

// The part's pictures are numbered anew, from 0.
void write_kitti_part(const CameraFolder& whole, const FolderPart& part, const std::filesystem::path& out) {
  std::string times;
  for (std::size_t i = part.begin; i < part.end; ++i) {
    const FolderFrame& frame = whole.frames[i];
    times += frame.stamp_text + "\n";
    std::string number = std::to_string(i - part.begin);
    number.insert(0, std::max<std::size_t>(6, number.size()) - number.size(), '0');
    for (const auto& name : {frame.first, frame.second})
      if (!name.empty())
        link_file(whole.folder / name, out / name.parent_path() / (number + name.extension().string()));
  }
  write_list(out / "times.txt", times);
  copy_if_there(whole, "calib.txt", out);
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(whole.folder / "poses.txt", ignored)) return;
  std::istringstream poses(read_file(whole.folder / "poses.txt"));
  std::string kept, line;
  for (std::size_t i = 0; i < part.end && std::getline(poses, line); ++i)
    if (i >= part.begin) kept += line + "\n";
  write_list(out / "poses.txt", kept);
}

}  // namespace mapweave::rawlog
