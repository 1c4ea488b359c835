#include "formats.h"

#include "byte_source.h"
#include "camera_folder.h"
#include "ordered_stream.h"
#include "ros/bag_formats.h"
#include "ros/mcap_reader.h"
#include "ros/ros1_bag.h"
#include "ros/rosbag2_storage.h"

#include <mapweave/core/error.h>
#include <mapweave/rawlog/contents.h>

#include <algorithm>
#include <exception>

namespace mapweave::rawlog {
namespace {

constexpr std::size_t kStartBytes = 1 << 16, kMagicBytes = 8;

std::string extension_of(const std::filesystem::path& path) {
  auto name = path.filename();
  if (name.extension() == ".gz") name = name.stem();
  std::string extension = name.extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

}  // namespace

const std::vector<Format>& formats() {
  static const std::vector<Format> all = {
      {"MRPT rawlog", {".rawlog"}, is_rawlog, open_rawlog},
      {"g2o", {".g2o"}, is_g2o, open_g2o},
      {"CARMEN log", {".log", ".clf"}, is_carmen, open_carmen},
      {"ROS 1 bag", {".bag"}, ros::is_ros1_bag, ros::open_bag_log},
      {"MCAP recording", {".mcap"}, ros::is_mcap, ros::open_bag_log},
      {"rosbag2 recording", {".db3"}, ros::is_db3, ros::open_bag_log},
      {"zstd part of a rosbag2 recording", {".zstd"}, ros::is_zstd, ros::open_bag_log},
  };
  return all;
}

const Format& recognise(ByteSource& bytes) {
  // A recording that a robot writes at a few kB a second is known by its first bytes.
  const auto start = bytes.ahead(ros::is_mcap(bytes.ahead(kMagicBytes)) ? kMagicBytes : kStartBytes);
  for (const Format& format : formats()) {
    if (format.recognises(start)) return format;
  }
  const std::string extension = extension_of(bytes.path());
  for (const Format& format : formats()) {
    if (std::find(format.extensions.begin(), format.extensions.end(), extension) != format.extensions.end())
      return format;
  }
  std::string known;
  for (const Format& format : formats())
    known +=
        (known.empty() ? "" : ", ") + std::string(format.name) + " (" + std::string(format.extensions.front()) + ")";
  const std::string name = bytes.path().string();
  std::string remedy = "convert it to one of them";
  if (start.substr(0, 4) == "PK\x03\x04")
    remedy = "unpack it first (unzip " + name + " -d FOLDER), then name the folder or the log in it";
  else if (start.size() > 262 && start.substr(257, 5) == "ustar")
    remedy = "unpack it first (tar -xf " + name + "), then name the folder or the log in it";
  const Error unknown(ErrorCode::kUnsupported, "is of no format that is read: " + known + ", each as it is or as .gz",
                      bytes.path().string(), remedy);
  std::rethrow_exception(bytes.cause_of(std::make_exception_ptr(unknown)));
}

OpenedLog open_source(const std::filesystem::path& path, const ReadOptions& options) {
  std::error_code ignored;
  if (const char* bag = ros::bag_folder_name(path)) return {bag, ros::open_bag_folder(path, options)};
  if (std::filesystem::is_directory(path, ignored)) {
    const FolderLayout& layout = recognise_folder(path);
    return {layout.name, open_folder(layout.read(path, options))};
  }
  auto bytes = std::make_unique<ByteSource>(path, options.follow);
  const Format& format = recognise(*bytes);
  return {format.name, format.open(std::move(bytes), options)};
}

std::unique_ptr<ObservationStream> open_log(const std::filesystem::path& path, const ReadOptions& options) {
  return make_ordered_stream(open_source(path, options).source, options);
}

std::string format_of_log(const std::filesystem::path& log) {
  if (const char* bag = ros::bag_folder_name(log)) return bag;
  std::error_code ignored;
  if (std::filesystem::is_directory(log, ignored)) return recognise_folder(log).name;
  ByteSource bytes(log);
  return recognise(bytes).name;
}

bool is_picture_folder(const std::filesystem::path& log) {
  std::error_code ignored;
  return std::filesystem::is_directory(log, ignored) && ros::bag_folder_name(log) == nullptr;
}

bool truth_follows_camera(const std::filesystem::path& log) {
  std::error_code ignored;
  if (!std::filesystem::is_directory(log, ignored)) return false;
  const auto& layouts = folder_layouts();
  const auto layout =
      std::find_if(layouts.begin(), layouts.end(), [&](const FolderLayout& known) { return known.recognises(log); });
  return layout != layouts.end() && layout->truth_is_of_camera;
}

}  // namespace mapweave::rawlog
