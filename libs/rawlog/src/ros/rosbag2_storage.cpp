#include "rosbag2_storage.h"

#include "bag_parts.h"
#include "db3_reader.h"
#include "rosbag2_metadata.h"
#include "zstd_file.h"

#include <stdlib.h>

#include <mapweave/core/error.h>

#include <cerrno>
#include <optional>
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
      cut_ = unpack_zstd_file(packed, path());
    } catch (...) {
      remove();
      throw;
    }
  }
  ~UnpackedPart() { remove(); }
  UnpackedPart(const UnpackedPart&) = delete;
  UnpackedPart& operator=(const UnpackedPart&) = delete;
  fs::path path() const { return fs::path(folder_) / "part"; }
  const std::optional<Error>& cut() const { return cut_; }  // none: it is whole

 private:
  void remove() const {
    std::error_code ignored;
    fs::remove_all(folder_, ignored);
  }
  std::string folder_;
  std::optional<Error> cut_;
};

// What was unpacked of a part that is cut short. Wherever it ends, the part's end is what is said.
class CutPart final : public BagReader {
 public:
  CutPart(std::unique_ptr<BagReader> unpacked, Error cut) : unpacked_(std::move(unpacked)), cut_(std::move(cut)) {}
  const std::vector<BagTopic>& topics() const override { return unpacked_->topics(); }
  void select(const std::vector<std::size_t>& topics) override { unpacked_->select(topics); }
  bool next(BagMessage& message) override {
    try {
      if (unpacked_->next(message)) return true;
    } catch (const Error&) {  // of what is said here
    }
    throw cut_;
  }
  std::string place_name(std::uint64_t place) const override { return unpacked_->place_name(place); }
  std::string doubt() const override { return unpacked_->doubt(); }
  std::uint64_t bytes_read() const override { return unpacked_->bytes_read(); }
  std::uint64_t bytes_total() const override { return unpacked_->bytes_total(); }

 private:
  std::unique_ptr<BagReader> unpacked_;
  Error cut_;
};

std::unique_ptr<BagReader> open_plain(const fs::path& plain, const fs::path& name, const fs::path& shown,
                                      std::uint64_t most_bytes) {
  return name.extension() == ".mcap" ? open_mcap(plain, most_bytes) : open_db3_as(plain, shown, most_bytes);
}

OpenedPart open_part(const fs::path& part, std::uint64_t most_bytes) {
  if (part.extension() != ".zstd") return {nullptr, open_plain(part, part, part, most_bytes)};
  const auto unpacked = std::make_shared<UnpackedPart>(part);
  const auto open = [&] { return open_plain(unpacked->path(), part.stem(), part, most_bytes); };
  if (!unpacked->cut()) return {unpacked, open()};
  try {
    return {unpacked, std::make_unique<CutPart>(open(), *unpacked->cut())};
  } catch (const Error&) {
    throw *unpacked->cut();
  }
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

bool is_zstd(std::string_view start_of_file) {
  constexpr std::string_view kMark{"\x28\xb5\x2f\xfd", 4};
  return start_of_file.substr(0, kMark.size()) == kMark;
}

std::unique_ptr<BagReader> open_zstd_part(const fs::path& path, std::uint64_t most_bytes) {
  return open_bag_parts(
      {{path}, {}, [most_bytes](const fs::path& part) { return open_part(part, most_bytes); }, place_in});
}

bool is_rosbag2_folder(const fs::path& folder) { return has_rosbag2_metadata(folder) || !parts_in(folder).empty(); }

std::unique_ptr<BagReader> open_rosbag2_folder(const fs::path& folder, std::uint64_t most_bytes) {
  Rosbag2Metadata metadata = read_rosbag2_metadata(folder);
  return open_bag_parts({std::move(metadata.parts), std::move(metadata.topics),
                         [most_bytes](const fs::path& part) { return open_part(part, most_bytes); }, place_in});
}

}  // namespace mapweave::rawlog::ros
