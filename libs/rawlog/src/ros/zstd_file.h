#pragma once
// Files and messages that rosbag2 compressed by zstd.

#include <mapweave/core/error.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>
#include <vector>

namespace mapweave::rawlog::ros {

// A message in CDR as it was before rosbag2 compressed it (compression_mode MESSAGE), by the mark at its beginning: no
// message in CDR begins so. Throws Error kCorrupt without a place: damage, more than `most_bytes`.
void unpack_message(std::string_view data, std::uint64_t most_bytes, std::vector<std::byte>& to);

// Unpacks a file into a new one at `to`. Of one that is cut short, what is there; the answer is that Error then. Throws
// Error: kMissing, kCorrupt (naming `from`), kCannotWrite.
std::optional<Error> unpack_zstd_file(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace mapweave::rawlog::ros
