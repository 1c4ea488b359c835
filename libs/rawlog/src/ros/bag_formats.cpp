#include "bag_formats.h"

#include "../byte_source.h"
#include "bag_source.h"
#include "ros1_bag.h"

#include <cmath>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::size_t kStartBytes = 64;

std::uint64_t most_bytes(const ReadOptions& options) {
  constexpr double kMegabyte = 1e6, kMost_mb = 4000.0;  // lengths in bags have 32 bits
  return static_cast<std::uint64_t>(std::llround(std::min(options.max_object_mb, kMost_mb) * kMegabyte));
}

}  // namespace

std::unique_ptr<BagReader> open_bag(const std::filesystem::path& path, const ReadOptions& options) {
  if (is_ros1_bag(ByteSource(path).ahead(kStartBytes))) return open_ros1_bag(path, most_bytes(options));
  return nullptr;
}

std::unique_ptr<RecordSource> open_ros1_log(std::unique_ptr<ByteSource> bytes, const ReadOptions& options) {
  const std::filesystem::path path = bytes->path();
  bytes.reset();
  return open_bag_source(open_ros1_bag(path, most_bytes(options)), path, options);
}

}  // namespace mapweave::rawlog::ros
