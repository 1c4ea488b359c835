#pragma once
// Files and messages that rosbag2 compressed by zstd.

#include <filesystem>
#include <string_view>

namespace mapweave::rawlog::ros {

bool is_zstd(std::string_view bytes);  // by the mark at its beginning

// Unpacks a file into a new one at `to`. Throws Error: kMissing, kCorrupt (naming `from`), kCannotWrite.
void unpack_zstd_file(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace mapweave::rawlog::ros
