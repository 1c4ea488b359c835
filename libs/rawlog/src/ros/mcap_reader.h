#pragma once
// MCAP recordings of ROS 1 and ROS 2 (mcap.dev/spec).

#include "bag_reader.h"

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string_view>

namespace mapweave::rawlog::ros {

constexpr std::uint64_t kMostRecordBytes = std::uint64_t{1} << 30;

bool is_mcap(std::string_view start_of_file);

// Topics are known from the start: by the summary, with their numbers of messages, where the file has a sound one, else
// by reading the whole file once. With a summary chunks come in the order of their first messages; else all comes as it
// stands in the file. Within a chunk messages are
// sorted. Checksums are checked where the file has them. Attachments, metadata and messages that are not ROS's are
// passed over. A file that its recorder did not finish is read as far as it goes.
// `most_bytes`: a record or unpacked chunk of more bytes is treated as damage.
// `follows`: while a GrowingLog writes the file, its end is waited for; topics are those of its beginning: of a
// RosRecorder's all, of others those of the first two seconds. Those that come later are named, and left out. Throws
// Error: kMissing, kBadInput (no MCAP, empty), kUnsupported (another version; no ROS messages at all).
std::unique_ptr<BagReader> open_mcap(const std::filesystem::path& path, std::uint64_t most_bytes = kMostRecordBytes,
                                     bool follows = false);

}  // namespace mapweave::rawlog::ros
