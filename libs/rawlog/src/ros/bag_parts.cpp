#include "bag_parts.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <optional>
#include <system_error>
#include <utility>

namespace mapweave::rawlog::ros {
namespace {

namespace fs = std::filesystem;

class PartsReader final : public BagReader {
 public:
  explicit PartsReader(BagParts parts) : parts_(std::move(parts)) {
    for (const fs::path& part : parts_.paths) {
      std::error_code ignored;
      const auto bytes = fs::file_size(part, ignored);
      bytes_of_.push_back(ignored ? 0 : bytes);
      bytes_total_ += bytes_of_.back();
    }
    if (parts_.topics.empty()) ask_all();
  }

  const std::vector<BagTopic>& topics() const override { return parts_.topics; }

  void select(const std::vector<std::size_t>& topics) override {
    selected_.emplace(parts_.topics.size(), false);
    for (const std::size_t topic : topics) selected_->at(topic) = true;
    if (opened_.reader) select_in_part();
  }

  bool next(BagMessage& message) override {
    while (part_ < parts_.paths.size()) {
      if (!opened_.reader) {
        open_part();
        if (selected_) select_in_part();
      }
      if (opened_.reader->next(message)) {
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
    const fs::path& part = parts_.paths[static_cast<std::size_t>(place >> kPlaceBits)];
    return part.string() + parts_.place(part) + std::to_string(place & ((std::uint64_t{1} << kPlaceBits) - 1));
  }

  std::string doubt() const override { return opened_.reader ? opened_.reader->doubt() : std::string(); }
  std::uint64_t bytes_read() const override {
    if (!opened_.reader || opened_.reader->bytes_total() == 0) return bytes_before_;
    const double done =
        static_cast<double>(opened_.reader->bytes_read()) / static_cast<double>(opened_.reader->bytes_total());
    return bytes_before_ + static_cast<std::uint64_t>(done * static_cast<double>(bytes_of_[part_]));
  }
  std::uint64_t bytes_total() const override { return bytes_total_; }

 private:
  static constexpr int kPlaceBits = 44;  // 16 TiB of a part
  static std::uint64_t place_of(std::size_t part, std::uint64_t place) {
    return std::uint64_t{part} << kPlaceBits | (place & ((std::uint64_t{1} << kPlaceBits) - 1));
  }

  // Nobody counted the messages.
  void ask_all() {
    for (; part_ < parts_.paths.size(); ++part_) {
      try {
        open_part();
      } catch (const Error&) {
        if (part_ == 0) throw;
        continue;
      }
      for (std::size_t topic = 0; topic < opened_.reader->topics().size(); ++topic) {
        const std::size_t here = topic_here(topic);
        parts_.topics[here].messages += opened_.reader->topics()[topic].messages;
      }
      close_part();
    }
    part_ = 0;
  }

  void open_part() {
    opened_ = parts_.open(parts_.paths[part_]);
    topic_of_.clear();
  }

  void close_part() {
    opened_.reader.reset();
    opened_.kept.reset();
  }

  // The topic of the recording that a part's topic is. A part may hold some that were not known.
  std::size_t topic_here(std::size_t in_part) {
    while (topic_of_.size() <= in_part) {
      BagTopic topic = opened_.reader->topics()[topic_of_.size()];
      const auto same = std::find_if(parts_.topics.begin(), parts_.topics.end(), [&](const BagTopic& known) {
        return known.name == topic.name && known.type == topic.type && known.encoding == topic.encoding;
      });
      topic_of_.push_back(static_cast<std::size_t>(same - parts_.topics.begin()));
      topic.messages = 0;
      if (same == parts_.topics.end()) parts_.topics.push_back(std::move(topic));
    }
    return topic_of_[in_part];
  }

  void select_in_part() {
    std::vector<std::size_t> in_part;
    for (std::size_t topic = 0; topic < opened_.reader->topics().size(); ++topic)
      if (const std::size_t here = topic_here(topic); here < selected_->size() && (*selected_)[here])
        in_part.push_back(topic);
    opened_.reader->select(in_part);
  }

  BagParts parts_;
  std::vector<std::uint64_t> bytes_of_;  // each part
  std::uint64_t bytes_total_ = 0, bytes_before_ = 0;
  std::optional<std::vector<bool>> selected_;
  std::size_t part_ = 0;
  OpenedPart opened_;                  // the part; no reader before its first message
  std::vector<std::size_t> topic_of_;  // of the part's topics
};

}  // namespace

std::unique_ptr<BagReader> open_bag_parts(BagParts parts) { return std::make_unique<PartsReader>(std::move(parts)); }

}  // namespace mapweave::rawlog::ros
