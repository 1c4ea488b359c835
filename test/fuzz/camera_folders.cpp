// Folders of pictures: one file of a sound folder is the input. Pictures too.

#include "logs.h"

#include <picture_file.h>
#include <rawlog/camera_folders.h>

namespace mapweave::fuzz {
namespace {

namespace fs = std::filesystem;
using namespace rawlog;

constexpr int kFrames = 2;

// `file` of the folder that `make` makes.
Kind file_of(const std::string& folder, const std::function<void(const fs::path&)>& make, const std::string& file) {
  const fs::path place = scratch_folder() / folder;
  if (!fs::exists(place)) make(place);
  const std::string sound = file_bytes(place / file);
  const auto decode = [=](std::string_view bytes) {
    scratch_file(folder + "/" + file, bytes);
    try {
      read_log(place);
    } catch (...) {
      scratch_file(folder + "/" + file, sound);
      throw;
    }
    scratch_file(folder + "/" + file, sound);
  };
  return {decode, {sound}};
}

std::vector<Kind> files_of(const std::string& folder, const std::function<void(const fs::path&)>& make,
                           const std::vector<std::string>& files) {
  std::vector<Kind> kinds;
  for (const std::string& file : files) kinds.push_back(file_of(folder, make, file));
  return kinds;
}

Kind picture_kind() {
  const auto look = [](std::string_view bytes) {
    const auto path = scratch_file("input.png", bytes);
    jpeg_size(bytes);
    if (!is_png_or_jpeg(path)) return;
    look_at_picture(path);
    read_depth_picture(path);
  };
  write_picture(scratch_folder() / "depth.png", picture(1, CV_16UC1));
  write_picture(scratch_folder() / "grey.jpg", picture(1, CV_8UC1));
  return {look, {file_bytes(scratch_folder() / "depth.png")}};
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = [] {
    std::vector<Kind> made = {picture_kind()};
    const auto add = [&](std::vector<Kind> more) {
      for (Kind& kind : more) made.push_back(std::move(kind));
    };
    add(files_of(
        "tum", [](const fs::path& place) { make_tum(place, kFrames); },
        {"rgb.txt", "depth.txt", "camera.yaml", "accelerometer.txt", "groundtruth.txt", "depth/100.004000.png"}));
    add(files_of("kitti", [](const fs::path& place) { make_kitti(place, kFrames); }, {"times.txt", "calib.txt"}));
    add(files_of("euroc", [](const fs::path& place) { make_euroc(place, kFrames); },
                 {"mav0/cam0/data.csv", "mav0/cam1/sensor.yaml", "mav0/imu0/data.csv"}));
    add(files_of("reduced", [](const fs::path& place) { make_reduced_euroc(place, kFrames); },
                 {"stereo.txt", "cam0_sensor.yaml", "imu0.csv"}));
    return made;
  }();
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
