#pragma once
// Folders that hold a ROS 1 bag in parts, as `rosbag record --split` writes them: NAME_0.bag, NAME_1.bag, ...

#include "bag_reader.h"

#include <cstdint>
#include <filesystem>
#include <memory>

namespace mapweave::rawlog::ros {

// Whether files of ROS 1 bags lie in a folder, by their names: .bag, .bag.gz, .bag.active of one under way.
bool holds_ros1_bags(const std::filesystem::path& folder);

// All parts in the order of their numbers, or the only bag in the folder. The time that the recorder writes before each
// number counts for nothing. Where the first ones are missing (--max-splits) there is a warning; where one is missing
// between others, reading ends there with an Error kMissing that names it.
// Throws Error as open_ros1_bag() does for the first part, kBadInput where the bags are of several recordings.
std::unique_ptr<BagReader> open_ros1_folder(const std::filesystem::path& folder, std::uint64_t most_bytes);

}  // namespace mapweave::rawlog::ros
