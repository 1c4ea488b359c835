#pragma once
// Recordings of rosbag2: SQLite files (.db3) of all its schemas, and folders with metadata.yaml that list their parts
// (.db3 or .mcap, which may be compressed by zstd as files or message by message).

#include "bag_reader.h"
#include "mcap_reader.h"

#include <filesystem>
#include <memory>
#include <string_view>

namespace mapweave::rawlog::ros {

// By content: an SQLite file, of whatever program.
bool is_db3(std::string_view start_of_file);

// One .db3 file. Messages come in the order in which they were received. A file that its recorder did not finish is
// read with the -wal file beside it, in a folder that may be written: SQLite leaves an -shm file there.
// Throws Error: kMissing, kBadInput (a folder, empty, another program's), kCorrupt (no SQLite, cut short, damaged),
// kUnsupported (no ROS messages).
std::unique_ptr<BagReader> open_db3(const std::filesystem::path& path, std::uint64_t most_bytes = kMostRecordBytes);

// One part that rosbag2 compressed as a file (.db3.zstd, .mcap.zstd), unpacked to a temporary file. Throws Error as
// open_rosbag2_folder() does.
bool is_zstd(std::string_view start_of_file);
std::unique_ptr<BagReader> open_zstd_part(const std::filesystem::path& path, std::uint64_t most_bytes);

// Whether a folder looks like one of rosbag2's: metadata.yaml of rosbag2, or parts without it.
bool is_rosbag2_folder(const std::filesystem::path& folder);

// All parts of a recording, one after the other, in the order of metadata.yaml; without it (the recorder was killed),
// with a warning, those that lie in the folder, in the order of their numbers. Parts compressed as files are unpacked
// to a temporary file, one at a time.
// Throws Error as open_db3() and open_mcap() do, kMissing for a part that is missing, kBadInput for a metadata.yaml
// that cannot be used.
std::unique_ptr<BagReader> open_rosbag2_folder(const std::filesystem::path& folder,
                                               std::uint64_t most_bytes = kMostRecordBytes);

}  // namespace mapweave::rawlog::ros
