#pragma once
// MCAP recordings of ROS 1 and ROS 2 (mcap.dev/spec).

#include "bag_reader.h"

#include <filesystem>
#include <memory>
#include <string_view>

namespace mapweave::rawlog::ros {

bool is_mcap(std::string_view start_of_file);

// Where the file has a sound summary, topics and their numbers of messages are known from the beginning, and chunks
// come in the order of their first messages; else all comes as it stands in the file. Within a chunk messages are
// sorted. Checksums are checked where the file has them. Attachments, metadata and messages that are not ROS's are
// passed over. A file that its recorder did not finish is read as far as it goes.
// Throws Error: kMissing, kBadInput (no MCAP, empty), kUnsupported (another version; no ROS messages at all).
std::unique_ptr<BagReader> open_mcap(const std::filesystem::path& path);

}  // namespace mapweave::rawlog::ros
