#include "bag_formats.h"

#include "../byte_source.h"
#include "../camera_folder.h"
#include "../log_writer.h"
#include "bag_source.h"
#include "mcap_reader.h"
#include "ros1_bag.h"
#include "ros1_folder.h"
#include "rosbag2_storage.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <system_error>
#include <utility>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::size_t kStartBytes = 64;

std::uint64_t most_bytes(const ReadOptions& options) {
  constexpr double kMegabyte = 1e6, kMost_mb = 4000.0;  // lengths in bags have 32 bits
  return static_cast<std::uint64_t>(std::llround(std::min(options.max_object_mb, kMost_mb) * kMegabyte));
}

struct FolderKind {
  const char* name = nullptr;  // null: no bag
  std::unique_ptr<BagReader> (*open)(const std::filesystem::path&, std::uint64_t most_bytes) = nullptr;
};

FolderKind kind_of(const std::filesystem::path& folder) {
  if (is_rosbag2_folder(folder)) return {"rosbag2 folder", open_rosbag2_folder};
  const auto& layouts = folder_layouts();
  const bool is_of_pictures = std::any_of(layouts.begin(), layouts.end(),
                                          [&](const FolderLayout& layout) { return layout.recognises(folder); });
  if (!is_of_pictures && holds_ros1_bags(folder)) return {"folder of a ROS 1 bag", open_ros1_folder};
  return {};
}

}  // namespace

const char* bag_folder_name(const std::filesystem::path& path) { return kind_of(path).name; }

std::unique_ptr<BagReader> open_bag(const std::filesystem::path& path, const ReadOptions& options) {
  const std::uint64_t most = most_bytes(options);
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) {
    const FolderKind folder = kind_of(path);
    return folder.open == nullptr ? nullptr : folder.open(path, most);
  }
  bool is_packed = false;
  std::string start;
  {
    ByteSource bytes(path, options.follow);
    start = bytes.ahead(kStartBytes);
    is_packed = bytes.packed();
  }
  if (options.follow && (is_ros1_bag(start) || is_db3(start) || is_zstd(start)) && LogWriterWatch(path).has_writer())
    throw Error(ErrorCode::kUnsupported, "is a bag of a format that is not read while it is written", path.string(),
                "record as MCAP, or map the bag when it is finished");
  if (is_ros1_bag(start)) return open_ros1_bag(path, most);
  if (is_zstd(start)) return open_zstd_part(path, most);
  if (!is_mcap(start) && !is_db3(start)) return nullptr;
  if (is_packed)
    throw Error(ErrorCode::kUnsupported, "is a recording of ROS 2 packed with gzip", path.string(),
                "unpack it first: gunzip --keep " + path.string());
  if (is_mcap(start)) return open_mcap(path, most, options.follow);
  return open_db3(path, most);
}

std::unique_ptr<RecordSource> open_bag_log(std::unique_ptr<ByteSource> bytes, const ReadOptions& options) {
  const std::filesystem::path path = bytes->path();
  bytes.reset();
  auto bag = open_bag(path, options);
  if (!bag)
    throw Error(ErrorCode::kCorrupt, "is named as a bag, but does not begin as one", path.string(),
                "copy the bag again");
  return open_bag_source(std::move(bag), path, options);
}

std::unique_ptr<RecordSource> open_bag_folder(const std::filesystem::path& folder, const ReadOptions& options) {
  return open_bag_source(open_bag(folder, options), folder, options);
}

}  // namespace mapweave::rawlog::ros
