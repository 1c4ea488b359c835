#pragma once
// The containers of ROS messages that are read.

#include "../record_source.h"
#include "bag_reader.h"

#include <filesystem>
#include <memory>

namespace mapweave::rawlog {
class ByteSource;
}

namespace mapweave::rawlog::ros {

// A bag of any container, known by its content. Null for what is none.
std::unique_ptr<BagReader> open_bag(const std::filesystem::path& path, const ReadOptions& options);

// For formats.cpp.
std::unique_ptr<RecordSource> open_ros1_log(std::unique_ptr<ByteSource> bytes, const ReadOptions& options);

}  // namespace mapweave::rawlog::ros
