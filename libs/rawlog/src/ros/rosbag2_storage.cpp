#include "rosbag2_storage.h"

#include "bag_parts.h"
#include "db3_reader.h"
#include "rosbag2_metadata.h"
#include "zstd_file.h"

#include <stdlib.h>

#include <mapweave/core/error.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace mapweave::rawlog::ros {
namespace {

namespace fs = std::filesystem;

// A part that was compressed as a file, unpacked in a folder of its own until the end.
class UnpackedPart {
 public:
  explicit UnpackedPart(const fs::path& packed) {
    std::error_code error;
    folder_ = (fs::temp_directory_path(error) / "mapweave-XXXXXX").string();
    if (error || ::mkdtemp(folder_.data()) == nullptr)
      throw Error(ErrorCode::kCannotWrite, "no temporary folder can be made: " + std::generic_category().message(errno),
                  folder_, "name another folder in TMPDIR");
    try {
      unpack_zstd_file(packed, path());
    } catch (...) {
      remove();
      throw;
    }
  }
  ~UnpackedPart() { remove(); }
  UnpackedPart(const UnpackedPart&) = delete;
  UnpackedPart& operator=(const UnpackedPart&) = delete;
  fs::path path() const { return fs::path(folder_) / "part"; }

 private:
  void remove() const {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  std::string folder_;
};

OpenedPart open_part(const fs::path& part, std::uint64_t most_bytes) {
  OpenedPart opened;
  fs::path plain = part, name = part;
  if (part.extension() == ".zstd") {
    const auto unpacked = std::make_shared<UnpackedPart>(part);
    plain = unpacked->path();
    name = part.stem();
    opened.kept = unpacked;
  }
  opened.reader = name.extension() == ".mcap" ? open_mcap(plain, most_bytes) : open_db3_as(plain, part, most_bytes);
  return opened;
}

std::string place_in(const fs::path& part) {
  return part.string().find(".db3") != std::string::npos ? " at message " : " at byte ";
}

}  // namespace

bool is_db3(std::string_view start_of_file) {
  constexpr std::string_view kMark{"SQLite format 3\0", 16};
  return start_of_file.substr(0, kMark.size()) == kMark;
}

std::unique_ptr<BagReader> open_db3(const fs::path& path, std::uint64_t most_bytes) {
  return open_db3_as(path, path, most_bytes);
}

bool is_rosbag2_folder(const fs::path& folder) { return has_rosbag2_metadata(folder) || !parts_in(folder).empty(); }

std::unique_ptr<BagReader> open_rosbag2_folder(const fs::path& folder, std::uint64_t most_bytes) {
  Rosbag2Metadata metadata = read_rosbag2_metadata(folder);
  return open_bag_parts({std::move(metadata.parts), std::move(metadata.topics),
                         [most_bytes](const fs::path& part) { return open_part(part, most_bytes); }, place_in});
}

}  // namespace mapweave::rawlog::ros
