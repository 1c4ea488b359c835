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

// What a folder is called that is read as a bag: "rosbag2 folder", "folder of a ROS 1 bag". Null for what is none, and
// for folders of pictures that bags lie in.
const char* bag_folder_name(const std::filesystem::path& path);

// A bag of any container, known by its content; a folder by its files. Null for what is none. Throws Error as the
// containers' readers do.
std::unique_ptr<BagReader> open_bag(const std::filesystem::path& path, const ReadOptions& options);

// For formats.cpp: files of each container, and folders that bag_folder_name() knows.
std::unique_ptr<RecordSource> open_bag_log(std::unique_ptr<ByteSource> bytes, const ReadOptions& options);
std::unique_ptr<RecordSource> open_bag_folder(const std::filesystem::path& folder, const ReadOptions& options);

}  // namespace mapweave::rawlog::ros
