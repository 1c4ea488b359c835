#include "mcap_reader.h"

#include "chunk_unpacking.h"
#include "mcap_records.h"
#include "mcap_summary.h"
#include "message_reader.h"
#include "seekable_file.h"
#include "zstd_file.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>

#include <algorithm>
#include <exception>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::size_t kWindowBytes = std::size_t{1} << 20;
constexpr const char* kCopyAgain = "copy the recording again, or map what precedes this with --keep-going";

Error damage(const std::string& what) { return Error(ErrorCode::kCorrupt, what, {}, kCopyAgain); }

// The file's bytes through one buffer.
class FileWindow {
 public:
  FileWindow(const SeekableFile& file, std::uint64_t most_bytes) : file_(file), most_bytes_(most_bytes) {}
  std::uint64_t most_bytes() const { return most_bytes_; }

  // `count` bytes of the file, valid until the next call. Throws where it ends before.
  std::string_view bytes_at(std::uint64_t offset, std::uint64_t count, const char* what) {
    const std::uint64_t left = file_.bytes() - std::min(offset, file_.bytes());
    if (count > left)
      throw damage(std::string("the file ends within ") + what + ": it should go on for " + std::to_string(count) +
                   " bytes, and " + std::to_string(left) + " are there");
    if (count > most_bytes_)
      throw damage(std::string(what) + " claims " + std::to_string(count) + " bytes; at most " +
                   std::to_string(most_bytes_) + " are read");
    if (offset < start_ || offset + count > start_ + held_) {
      held_ = 0;
      const auto wanted =
          static_cast<std::size_t>(std::min<std::uint64_t>(left, std::max<std::uint64_t>(count, kWindowBytes)));
      if (bytes_.size() < wanted) bytes_.resize(wanted);
      if (!file_.read_at(offset, bytes_.data(), wanted)) throw damage("the file became shorter while it was read");
      start_ = offset;
      held_ = wanted;
    }
    return {bytes_.data() + (offset - start_), static_cast<std::size_t>(count)};
  }

 private:
  const SeekableFile& file_;
  std::uint64_t most_bytes_, start_ = 0;
  std::size_t held_ = 0;
  std::vector<char> bytes_;
};

Error ends_within_record(const RecordHead& head, std::uint64_t left) {
  return damage("the file ends within a record: it should go on for " + std::to_string(head.bytes) + " bytes, and " +
                std::to_string(left) + " are there");
}

// What a chunk holds, in it or in `unpacked`; of one that is cut its beginning.
std::string_view records_of(const McapChunk& chunk, std::uint64_t most_bytes, UnpackedChunk& unpacked) {
  if (chunk.unpacked_bytes > most_bytes)
    throw damage("a chunk claims " + std::to_string(chunk.unpacked_bytes) + " bytes unpacked; at most " +
                 std::to_string(most_bytes) + " are read");
  std::string_view records = chunk.records;
  if (!chunk.compression.empty()) {
    const auto most = static_cast<std::size_t>(chunk.unpacked_bytes);
    if (chunk.compression == "lz4")
      unpacked = unpack_lz4(chunk.records, most);
    else if (chunk.compression == "zstd")
      unpacked = unpack_zstd(chunk.records, most);
    else
      throw Error(ErrorCode::kUnsupported,
                  "a chunk is compressed by '" + std::string(chunk.compression.substr(0, 32)) +
                      "'; lz4, zstd and none are read",
                  {}, "compress it anew: mcap compress");
    if (!unpacked.problem.empty() && !chunk.is_cut) throw damage("a chunk cannot be unpacked: " + unpacked.problem);
    records = unpacked.bytes;
  }
  if (chunk.is_cut) return records;
  if (records.size() != chunk.unpacked_bytes)
    throw damage("a chunk holds " + std::to_string(records.size()) + " bytes; " + std::to_string(chunk.unpacked_bytes) +
                 " were expected");
  if (chunk.crc != 0 && crc_of(records) != chunk.crc)
    throw damage("the checksum of a chunk is wrong: " + std::to_string(records.size()) + " bytes are lost");
  return records;
}

void check_magic(const SeekableFile& file) {
  std::string found(mcap::kMagic.size(), '\0');
  file.read_at(0, found.data(), static_cast<std::size_t>(std::min<std::uint64_t>(found.size(), file.bytes())));
  if (found == mcap::kMagic) return;
  if (is_mcap(found))
    throw Error(ErrorCode::kUnsupported, "is of another version of MCAP; version 0 is read", file.path().string(),
                "convert it with the program that wrote it");
  throw Error(ErrorCode::kBadInput, "is no MCAP recording: it does not begin as one", file.path().string(),
              "check the path; where it was one, copy it again");
}

void expect_ros_messages(const McapChannels& channels, const SeekableFile& file) {
  if (!channels.topics().empty() || channels.left_out().empty()) return;
  throw Error(ErrorCode::kUnsupported, "holds no messages of ROS (encodings ros1 and cdr), but " + channels.left_out(),
              file.path().string(), "record with ROS, or convert it");
}

// Of a RosRecorder, which describes all topics before the first message.
bool is_of_recorder(const SeekableFile& file) {
  constexpr std::uint64_t kMostHeaderBytes = 128;
  std::string start(static_cast<std::size_t>(std::min(file.bytes(), kMostHeaderBytes)), '\0');
  return file.read_at(0, start.data(), start.size()) && start.find(kRecorderLibrary) != std::string::npos;
}

// Or will be: the file ends there.
bool is_message_at(const SeekableFile& file, std::uint64_t position) {
  char opcode = 0;
  return !file.read_at(position, &opcode, 1) || static_cast<Opcode>(opcode) == Opcode::kMessage;
}

// Of a recording that is still written. A RosRecorder describes all topics before the first message, other programs a
// topic when its first message comes: those of the first seconds count.
class BeginningOfRecording {
 public:
  void pass(std::int64_t log_ns) {
    newest_ns_ = std::max(first_ns_ ? newest_ns_ : log_ns, log_ns);
    if (!first_ns_) first_ns_ = log_ns;
  }
  bool shows_topics(const McapChannels& channels, const SeekableFile& file, std::uint64_t position) const {
    constexpr std::int64_t kTopicsWithin_ns = 2'000'000'000;
    if (channels.topics().empty()) return false;
    if (is_of_recorder(file)) return is_message_at(file, position);
    return first_ns_.has_value() && newest_ns_ - *first_ns_ >= kTopicsWithin_ns;
  }
  void name_late(const std::string& topic, const SeekableFile& file) {
    if (late_.insert(topic).second)
      log(LogLevel::warning, file.path().string() + ": topic " + topic +
                                 " came late, and is left out while the recording is written; the finished one has it");
  }

 private:
  std::optional<std::int64_t> first_ns_;
  std::int64_t newest_ns_ = 0;
  std::set<std::string> late_;
};

class McapReader final : public BagReader {
 public:
  McapReader(const std::filesystem::path& path, std::uint64_t most_bytes, bool follows)
      : file_(path), window_(file_, most_bytes), follows_(follows) {
    check_magic(file_);
    McapSummary summary = read_mcap_summary(file_, most_bytes);
    channels_ = std::move(summary.channels);
    has_counts_ = summary.has_counts;
    by_index_ = !summary.chunks.empty();
    chunks_ = std::move(summary.chunks);
    data_end_ = summary.data_end;
    data_crc_ = by_index_ ? 0 : summary.data_crc;
    if (!summary.has_all_channels) find_topics();
    expect_ros_messages(channels_, file_);
  }

  const std::vector<BagTopic>& topics() const override { return channels_.topics(); }

  void select(const std::vector<std::size_t>& topics) override {
    selected_.emplace(channels_.topics().size(), false);
    for (const std::size_t topic : topics) selected_->at(topic) = true;
    has_counts_ = has_counts_ && !began_;
  }

  bool next(BagMessage& message) override {
    began_ = true;
    if (ended_) return false;
    try {
      while (next_in_chunk_ == in_chunk_.size()) {
        if (pending_) std::rethrow_exception(std::exchange(pending_, nullptr));
        in_chunk_.clear();
        next_in_chunk_ = 0;
        if (by_index_ ? !advance_by_index() : !advance()) {
          ended_ = true;
          report_end();
          return false;
        }
      }
      const MessageInChunk& found = in_chunk_[next_in_chunk_++];
      message.topic = found.topic;
      message.received_ns = found.log_ns;
      message.place = place_;
      const auto* data = reinterpret_cast<const std::byte*>(found.data.data());
      if (channels_.topics()[found.topic].encoding == MessageEncoding::cdr)
        unpack_message(found.data, window_.most_bytes(), message.data);
      else
        message.data.assign(data, data + found.data.size());
    } catch (const Error& error) {
      ended_ = true;
      if (!error.where().empty()) throw;
      throw placed(error, file_.place(place_));
    }
    ++delivered_;
    return true;
  }

  std::string place_name(std::uint64_t place) const override { return file_.place(place); }
  std::string doubt() const override {
    return has_unchecked_chunks_ ? "the chunk that begins there has no checksum and may be damaged" : "";
  }
  std::uint64_t bytes_read() const override { return position_; }
  std::uint64_t bytes_total() const override { return file_.bytes(); }

 private:
  struct MessageInChunk {
    std::size_t topic;
    std::int64_t log_ns;
    std::string_view data;  // in window_ or unpacked_
  };

  // Reads the whole file once; of one that is still written its beginning. What is wrong with it is said when it is
  // read again.
  void find_topics() {
    selected_.emplace();
    try {
      while (!(follows_ && file_.look_again() && beginning_.shows_topics(channels_, file_, position_)) && advance()) {
        if (std::exchange(pending_, nullptr)) break;
      }
    } catch (const Error&) {}
    selected_.reset();
    position_ = 0;
    crc_so_far_ = 0;
  }

  bool advance_by_index() {
    throw_if_interrupted();
    while (next_chunk_ < chunks_.size() && !may_hold_selected(chunks_[next_chunk_])) pass_chunk();
    if (next_chunk_ == chunks_.size()) return false;
    const McapChunkIndex& chunk = chunks_[next_chunk_];
    place_ = chunk.offset;
    take_chunk(parse_chunk(window_.bytes_at(chunk.offset, chunk.bytes, "a chunk").substr(kRecordHeadBytes)));
    pass_chunk();
    return true;
  }

  void pass_chunk() {
    position_ += chunks_[next_chunk_].bytes + chunks_[next_chunk_].index_bytes;
    ++next_chunk_;
  }

  bool may_hold_selected(const McapChunkIndex& chunk) const {
    if (!selected_ || chunk.channels.empty()) return true;
    return std::any_of(chunk.channels.begin(), chunk.channels.end(), [&](std::uint16_t channel) {
      const auto topic = channels_.topic_of(channel);
      return topic && is_selected(*topic);
    });
  }
  bool is_selected(std::size_t topic) const { return !selected_ || (topic < selected_->size() && (*selected_)[topic]); }

  // The next record of the file; false at its end.
  bool advance() {
    if (position_ == 0) pass(window_.bytes_at(0, mcap::kMagic.size(), "its first bytes"));
    place_ = position_;
    if (follows_) file_.await(position_ + kRecordHeadBytes);
    if (position_ == file_.bytes()) {
      if (began_)
        log(LogLevel::warning,
            file_.path().string() +
                ": the recording was not finished (it has no end mark); it is read as far as it goes");
      return false;
    }
    const RecordHead head = parse_head(window_.bytes_at(position_, kRecordHeadBytes, "a record").data());
    if (head.opcode == Opcode::kFooter || head.opcode == Opcode::kDataEnd) {
      check_data_end();
      return false;
    }
    if (head.opcode == Opcode{})
      throw damage("no record begins here: opcode 0 is none; was the end of the file never written?");
    const bool is_used = head.opcode == Opcode::kSchema || head.opcode == Opcode::kChannel ||
                         head.opcode == Opcode::kMessage || head.opcode == Opcode::kChunk;
    if (!is_used) {
      skip_record(head);
      return true;
    }
    throw_if_interrupted();
    if (follows_) file_.await(position_ + kRecordHeadBytes + std::min(head.bytes, window_.most_bytes()));
    if (const std::uint64_t left = file_.bytes() - position_ - kRecordHeadBytes; head.bytes > left) {
      take_end(head, left);
      return true;
    }
    const std::string_view record = window_.bytes_at(position_, kRecordHeadBytes + head.bytes, "a record");
    pass(record);
    take_record(head, record.substr(kRecordHeadBytes));
    return true;
  }

  // The file ends within a record. Of a chunk, what is whole in it is delivered before that is said.
  void take_end(const RecordHead& head, std::uint64_t left) {
    try {
      if (head.opcode == Opcode::kChunk)
        take_chunk(parse_cut_chunk(window_.bytes_at(position_ + kRecordHeadBytes, left, "a chunk")));
    } catch (const Error&) {  // of what is said here
    }
    pending_ = std::make_exception_ptr(ends_within_record(head, left));
  }

  void skip_record(const RecordHead& head) {
    const std::uint64_t left = file_.bytes() - position_ - kRecordHeadBytes;
    if (head.bytes > left) throw ends_within_record(head, left);
    const std::uint64_t end = position_ + kRecordHeadBytes + head.bytes;
    while (data_crc_ != 0 && position_ < end)
      pass(window_.bytes_at(position_, std::min<std::uint64_t>(end - position_, kWindowBytes), "a record"));
    position_ = end;
  }

  void pass(std::string_view bytes) {
    position_ += bytes.size();
    if (data_crc_ != 0) crc_so_far_ = crc_of(bytes, crc_so_far_);
  }

  void take_record(const RecordHead& head, std::string_view fields) {
    switch (head.opcode) {
      case Opcode::kSchema: channels_.add_schema(fields); break;
      case Opcode::kChannel: channels_.add_channel(fields); break;
      case Opcode::kMessage: take_message(fields); break;
      case Opcode::kChunk: take_chunk(parse_chunk(fields)); break;
      default: break;
    }
  }

  void take_message(std::string_view fields) {
    const McapMessage message = parse_message(fields);
    beginning_.pass(message.log_ns);
    const auto topic = channels_.topic_of(message.channel);
    if (topic && is_selected(*topic)) in_chunk_.push_back({*topic, message.log_ns, message.data});
    if (topic && began_ && selected_ && *topic >= selected_->size())
      beginning_.name_late(channels_.topics()[*topic].name, file_);
  }

  void take_chunk(const McapChunk& chunk) {
    has_unchecked_chunks_ = has_unchecked_chunks_ || chunk.crc == 0;
    std::string_view records = records_of(chunk, window_.most_bytes(), unpacked_);
    try {
      while (!records.empty()) {
        if (records.size() < kRecordHeadBytes) throw damage("a chunk ends within a record");
        const RecordHead head = parse_head(records.data());
        records.remove_prefix(kRecordHeadBytes);
        if (head.bytes > records.size())
          throw damage("a chunk ends within a record: it should go on for " + std::to_string(head.bytes) +
                       " bytes, and " + std::to_string(records.size()) + " are there");
        if (head.opcode == Opcode::kChunk || head.opcode == Opcode{})
          throw damage("a chunk holds a record that it cannot hold (opcode " +
                       std::to_string(static_cast<int>(head.opcode)) + ")");
        take_record(head, records.substr(0, static_cast<std::size_t>(head.bytes)));
        records.remove_prefix(static_cast<std::size_t>(head.bytes));
      }
    } catch (const Error&) {
      pending_ = std::current_exception();  // what came before is good
    }
    const auto by_time = [](const MessageInChunk& a, const MessageInChunk& b) { return a.log_ns < b.log_ns; };
    if (!std::is_sorted(in_chunk_.begin(), in_chunk_.end(), by_time))
      std::stable_sort(in_chunk_.begin(), in_chunk_.end(), by_time);
  }

  void check_data_end() const {
    if (data_end_ != 0 && position_ != data_end_)
      throw damage("the data seem to end here, and they should end at byte " + std::to_string(data_end_));
    if (data_crc_ != 0 && crc_so_far_ != data_crc_)
      throw damage("the checksum of all data before this place is wrong: something in the recording is damaged");
  }

  void report_end() const {
    expect_ros_messages(channels_, file_);
    if (!channels_.left_out().empty())
      log(LogLevel::warning,
          file_.path().string() + ": topics that hold no messages of ROS were left out: " + channels_.left_out());
    if (!has_counts_) return;
    std::uint64_t expected = 0;
    for (std::size_t topic = 0; topic < channels_.topics().size(); ++topic)
      if (is_selected(topic)) expected += channels_.topics()[topic].messages;
    if (expected != delivered_)
      log(LogLevel::warning, file_.path().string() + ": holds " + std::to_string(delivered_) +
                                 " messages of the topics that are read; its summary says " + std::to_string(expected));
  }

  SeekableFile file_;
  FileWindow window_;
  const bool follows_;
  McapChannels channels_;
  bool has_counts_ = false, began_ = false, ended_ = false, by_index_ = false, has_unchecked_chunks_ = false;
  std::optional<std::vector<bool>> selected_;
  std::vector<McapChunkIndex> chunks_;
  std::size_t next_chunk_ = 0, next_in_chunk_ = 0;
  std::uint64_t position_ = 0, place_ = 0, delivered_ = 0, data_end_ = 0;  // data_end_ of 0: not known
  std::uint32_t data_crc_ = 0, crc_so_far_ = 0;
  UnpackedChunk unpacked_;
  std::vector<MessageInChunk> in_chunk_;  // of the chunk, or the one message
  BeginningOfRecording beginning_;
  std::exception_ptr pending_;  // damage after what is in in_chunk_
};

}  // namespace

bool is_mcap(std::string_view start_of_file) {
  return start_of_file.size() >= mcap::kMagic.size() && start_of_file.substr(0, 5) == mcap::kMagic.substr(0, 5) &&
         start_of_file.substr(6, 2) == mcap::kMagic.substr(6);
}

std::unique_ptr<BagReader> open_mcap(const std::filesystem::path& path, std::uint64_t most_bytes, bool follows) {
  return std::make_unique<McapReader>(path, most_bytes, follows);
}

}  // namespace mapweave::rawlog::ros
