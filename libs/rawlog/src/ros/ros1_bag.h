#pragma once
// ROS 1 bags of version 2.0: http://wiki.ros.org/Bags/Format/2.0

#include "bag_reader.h"

#include <filesystem>
#include <memory>
#include <string_view>

namespace mapweave::rawlog::ros {

// Whether a file begins as a ROS 1 bag of any version does.
bool is_ros1_bag(std::string_view start_of_file);

// Opens a ROS 1 bag, as it is or gz. Topics are known from the start: from the index where there is a sound one, else
// the whole file is read once to find them.
//
// A bag that was not closed (its recorder crashed) is read as far as it goes, with a warning; so a chunk that was being
// written ends it. A closed bag that is cut short ends with an Error.
// `most_bytes`: a record or unpacked chunk of more bytes is treated as damage
// Throws Error kMissing, kBadInput for an empty file, kUnsupported for another version or an encrypted bag, kCorrupt
std::unique_ptr<BagReader> open_ros1_bag(const std::filesystem::path& file, std::uint64_t most_bytes);

}  // namespace mapweave::rawlog::ros
