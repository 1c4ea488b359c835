#include "rosbag2_storage.h"

#include "db3_reader.h"
#include "rosbag2_metadata.h"
#include "zstd_file.h"

#include <stdlib.h>

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>

#include <algorithm>
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

class Rosbag2Folder final : public BagReader {
 public:
  Rosbag2Folder(Rosbag2Metadata metadata, std::uint64_t most_bytes)
      : parts_(std::move(metadata.parts)), topics_(std::move(metadata.topics)), most_bytes_(most_bytes) {
    for (const fs::path& part : parts_) {
      std::error_code ignored;
      const auto bytes = fs::file_size(part, ignored);
      bytes_of_.push_back(ignored ? 0 : bytes);
      bytes_total_ += bytes_of_.back();
    }
    if (!topics_.empty()) return;
    // Nobody counted them: each part is asked.
    for (; part_ < parts_.size(); ++part_) {
      open_part();
      for (std::size_t topic = 0; topic < reader_->topics().size(); ++topic)
        topics_[topic_here(topic)].messages += reader_->topics()[topic].messages;
      close_part();
    }
    part_ = 0;
  }

  const std::vector<BagTopic>& topics() const override { return topics_; }

  void select(const std::vector<std::size_t>& topics) override {
    selected_.emplace(topics_.size(), false);
    for (const std::size_t topic : topics) selected_->at(topic) = true;
    if (reader_) select_in_part();
  }

  bool next(BagMessage& message) override {
    while (part_ < parts_.size()) {
      if (!reader_) {
        open_part();
        if (selected_) select_in_part();
      }
      if (reader_->next(message)) {
        message.topic = topic_here(message.topic);
        message.place = place_of(part_, message.place);
        return true;
      }
      bytes_before_ += bytes_of_[part_];
      close_part();
      ++part_;
    }
    return false;
  }

  std::string place_name(std::uint64_t place) const override {
    const std::size_t part = static_cast<std::size_t>(place >> kPlaceBits);
    const std::string unit = parts_[part].string().find(".db3") != std::string::npos ? " at message " : " at byte ";
    return parts_[part].string() + unit + std::to_string(place & ((std::uint64_t{1} << kPlaceBits) - 1));
  }

  std::uint64_t bytes_read() const override {
    if (!reader_ || reader_->bytes_total() == 0) return bytes_before_;
    const double done = static_cast<double>(reader_->bytes_read()) / static_cast<double>(reader_->bytes_total());
    return bytes_before_ + static_cast<std::uint64_t>(done * static_cast<double>(bytes_of_[part_]));
  }
  std::uint64_t bytes_total() const override { return bytes_total_; }

 private:
  static constexpr int kPlaceBits = 44;  // 16 TiB of a part
  static std::uint64_t place_of(std::size_t part, std::uint64_t place) {
    return std::uint64_t{part} << kPlaceBits | (place & ((std::uint64_t{1} << kPlaceBits) - 1));
  }

  void open_part() {
    const fs::path& part = parts_[part_];
    fs::path plain = part;
    if (part.extension() == ".zstd") {
      unpacked_.emplace(part);
      plain = unpacked_->path();
    }
    const std::string name = part.extension() == ".zstd" ? part.stem().string() : part.filename().string();
    reader_ =
        fs::path(name).extension() == ".mcap" ? open_mcap(plain, most_bytes_) : open_db3_as(plain, part, most_bytes_);
    topic_of_.clear();
  }

  void close_part() {
    reader_.reset();
    unpacked_.reset();
  }

  // The topic of the recording that a part's topic is. A part may hold some that metadata.yaml does not list.
  std::size_t topic_here(std::size_t in_part) {
    while (topic_of_.size() <= in_part) {
      BagTopic topic = reader_->topics()[topic_of_.size()];
      const auto same = std::find_if(topics_.begin(), topics_.end(), [&](const BagTopic& known) {
        return known.name == topic.name && known.type == topic.type && known.encoding == topic.encoding;
      });
      topic_of_.push_back(static_cast<std::size_t>(same - topics_.begin()));
      topic.messages = 0;
      if (same == topics_.end()) topics_.push_back(std::move(topic));
    }
    return topic_of_[in_part];
  }

  void select_in_part() {
    std::vector<std::size_t> in_part;
    for (std::size_t topic = 0; topic < reader_->topics().size(); ++topic)
      if (const std::size_t here = topic_here(topic); here < selected_->size() && (*selected_)[here])
        in_part.push_back(topic);
    reader_->select(in_part);
  }

  std::vector<fs::path> parts_;
  std::vector<std::uint64_t> bytes_of_;  // each part
  std::uint64_t bytes_total_ = 0, bytes_before_ = 0;
  std::vector<BagTopic> topics_;
  std::uint64_t most_bytes_;
  std::optional<std::vector<bool>> selected_;
  std::size_t part_ = 0;
  std::optional<UnpackedPart> unpacked_;  // outlives its reader
  std::unique_ptr<BagReader> reader_;     // of the part; null before its first message
  std::vector<std::size_t> topic_of_;     // of the part's topics
};

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
  return std::make_unique<Rosbag2Folder>(read_rosbag2_metadata(folder), most_bytes);
}

}  // namespace mapweave::rawlog::ros
