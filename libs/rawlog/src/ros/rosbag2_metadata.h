#pragma once
// What a folder of rosbag2 says of its parts.

#include "bag_reader.h"

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::rawlog::ros {

struct Rosbag2Metadata {
  std::string storage;                       // "sqlite3" or "mcap"; empty: by the names of the parts
  std::vector<std::filesystem::path> parts;  // that are there
  std::vector<BagTopic> topics;              // as far as they are of ROS messages
};

bool has_rosbag2_metadata(const std::filesystem::path& folder);
// Parts in a folder without metadata, in the order of the numbers in their names.
std::vector<std::filesystem::path> parts_in(const std::filesystem::path& folder);
// Of metadata.yaml, or where it is missing of the parts in the folder. Throws Error: kBadInput for one that cannot be
// used, kMissing for parts that are not there, kUnsupported for other storages and compressions.
Rosbag2Metadata read_rosbag2_metadata(const std::filesystem::path& folder);

}  // namespace mapweave::rawlog::ros
