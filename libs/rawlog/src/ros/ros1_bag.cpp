#include "ros1_bag.h"

#include "../byte_source.h"
#include "../say_once.h"
#include "chunk_unpacking.h"
#include "ros1_records.h"
#include "ros1_topics.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>

#include <algorithm>
#include <fstream>
#include <utility>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::string_view kMagic = "#ROSBAG V", kVersion = "#ROSBAG V2.0\n";
constexpr std::uint32_t kMostHeaderBytes = 1 << 20;
constexpr const char* kRemedy = "copy the bag again, or map what precedes this with --keep-going";

// The end of the file within a record.
struct CutShort {
  std::uint64_t place;  // of the record
};

// The records of a file, one after the other.
class RecordFile {
 public:
  RecordFile(const std::filesystem::path& file, std::uint64_t most_bytes) : source_(file), most_bytes_(most_bytes) {}

  ByteSource& source() { return source_; }
  const ByteSource& source() const { return source_; }
  std::uint64_t most_bytes() const { return most_bytes_; }
  std::uint64_t place() const { return place_; }  // of the record whose header was taken last

  [[noreturn]] void fail(const std::string& what, std::uint64_t place) const {
    source_.throw_damage();
    throw Error(ErrorCode::kCorrupt, what, source_.place(place), kRemedy);
  }

  // The next record's header; its fields are views into `bytes`. The place of the record is kept in place_.
  Ros1Fields take_header(std::string& bytes) {
    place_ = source_.position();
    const std::uint32_t length = take_length();
    if (length > kMostHeaderBytes) fail("a record's header has " + std::to_string(length) + " bytes", place_);
    bytes.resize(length);
    if (!source_.take(bytes.data(), length)) cut_short();
    const auto fields = parse_ros1_fields(bytes);
    if (!fields || !fields->op) fail("a record's header cannot be decoded", place_);
    return *fields;
  }

  std::uint32_t take_length() {
    char bytes[4];
    if (!source_.take(bytes, sizeof bytes)) cut_short();
    return read_u32(bytes);
  }

  bool is_beyond_end(std::uint64_t length) const {
    return !source_.packed() && length > source_.file_bytes() - std::min(source_.position(), source_.file_bytes());
  }

  // Lengths are compared with what is left of the file before memory is made.
  void expect_length(std::uint64_t length) const {
    if (is_beyond_end(length)) cut_short();
    if (length > most_bytes_)
      fail("a record has " + std::to_string(length) + " bytes; at most " + std::to_string(most_bytes_) +
               " were expected (reading.max_object_mb)",
           place_);
  }

  void take_data(std::uint32_t length, std::string& to) {
    expect_length(length);
    to.resize(length);
    if (!source_.take(to.data(), length)) cut_short();
  }

  void skip_data(std::uint64_t length) {
    expect_length(length);
    while (length > 0) {
      const auto some = std::min<std::uint64_t>(length, source_.ahead(1).size());
      if (some == 0) cut_short();
      source_.skip(some);
      length -= some;
    }
  }

  [[noreturn]] void cut_short() const {
    source_.throw_damage();
    throw CutShort{place_};
  }

  // Everything that is left, as far as it may be held.
  void take_rest(std::string& to) {
    to.clear();
    while (!source_.at_end() && to.size() < most_bytes_) {
      const auto view = source_.ahead(1);
      to.append(view);
      source_.skip(view.size());
    }
  }

 private:
  ByteSource source_;
  std::uint64_t most_bytes_, place_ = 0;
};

class Ros1Bag final : public BagReader {
 public:
  Ros1Bag(const std::filesystem::path& file, std::uint64_t most_bytes) : file_(file, most_bytes) {
    try {
      read_start();
    } catch (const CutShort& cut) {
      file_.fail("the bag ends within its header", cut.place);
    }
    if (!read_index()) find_topics();
  }

  const std::vector<BagTopic>& topics() const override { return topics_.topics(); }

  void select(const std::vector<std::size_t>& topics) override {
    selects_ = true;
    selected_.assign(topics_.topics().size(), false);
    for (const std::size_t topic : topics) selected_.at(topic) = true;
  }

  bool next(BagMessage& message) override {
    for (;;) {
      if (rest_.empty() && !read_record(message)) return false;
      if (has_message_) {
        has_message_ = false;
        return true;
      }
      while (!rest_.empty())
        if (read_in_chunk(message)) return true;
      throw_if_interrupted();
    }
  }

  std::string place_name(std::uint64_t place) const override { return file_.source().place(place); }
  std::uint64_t bytes_read() const override { return file_.source().file_bytes_read(); }
  std::uint64_t bytes_total() const override { return file_.source().file_bytes(); }

 private:
  // The magic line and the bag's header.
  void read_start() {
    const auto start = file_.source().ahead(kVersion.size());
    if (start.substr(0, kVersion.size()) != kVersion) {
      file_.source().throw_damage();
      throw Error(ErrorCode::kUnsupported,
                  "is a bag of another version than 2.0; it begins with '" +
                      std::string(start.substr(0, std::min(start.find('\n'), kVersion.size() - 1))) + "'",
                  file_.source().path().string(), "convert it with `rosbag fix`");
    }
    file_.source().skip(kVersion.size());
    std::string header;
    const Ros1Fields fields = file_.take_header(header);
    if (fields.op != static_cast<std::uint8_t>(Ros1Op::bag_header))
      file_.fail("the bag's header was expected here", file_.place());
    if (!fields.encryptor.empty())
      throw Error(ErrorCode::kUnsupported, "is encrypted with '" + std::string(fields.encryptor) + "'",
                  file_.source().path().string(), "decrypt it with `rosbag decrypt`");
    index_position_ = fields.index_position.value_or(0);
    file_.skip_data(file_.take_length());
  }

  // Reads a record of the file: a chunk, or a message outside of chunks. False at the end.
  bool read_record(BagMessage& message) {
    if (ended_ || file_.source().at_end()) return end(file_.source().position());
    try {
      std::string header;
      const Ros1Fields fields = file_.take_header(header);
      if (fields.op == static_cast<std::uint8_t>(Ros1Op::chunk)) {
        read_chunk(fields);
      } else if (fields.op == static_cast<std::uint8_t>(Ros1Op::message)) {
        file_.take_data(file_.take_length(), chunk_);
        has_message_ = accept({fields, chunk_}, message);
      } else if (fields.op == static_cast<std::uint8_t>(Ros1Op::connection)) {
        file_.take_data(file_.take_length(), chunk_);
        add({fields, chunk_});
      } else {
        file_.skip_data(file_.take_length());
      }
    } catch (const CutShort& cut) {
      ended_ = true;
      was_cut_ = true;
      return end(cut.place);
    }
    return true;
  }

  // A bag whose recorder crashed has no index and may end anywhere.
  bool end(std::uint64_t place) {
    ended_ = true;
    if (index_position_ != 0) {
      if (was_cut_ || place < index_position_)
        file_.fail("the bag is cut short; its index was expected at byte " + std::to_string(index_position_) +
                       " and the records to be whole",
                   place);
      return false;
    }
    if (!is_looking_)
      say_once(file_.source().place(place) +
               ": the bag was not closed, as after a crash of the recorder; it is read up to here");
    return false;
  }

  void read_chunk(const Ros1Fields& fields) {
    const std::uint32_t length = file_.take_length();
    const std::size_t size = fields.size.value_or(0);
    if (size > file_.most_bytes())
      file_.fail("a chunk has " + std::to_string(size) + " bytes; at most " + std::to_string(file_.most_bytes()) +
                     " were expected (reading.max_object_mb)",
                 file_.place());
    const bool is_plain = fields.compression == "none" || fields.compression.empty();
    // While a chunk is written its sizes are 0; the records of one that is not compressed follow as if they were not in
    // one.
    const bool is_unfinished = length == 0 && size == 0 && index_position_ == 0;
    if (is_unfinished && is_plain) return;
    std::string& bytes = is_plain ? chunk_ : packed_;
    is_last_ = is_unfinished || file_.is_beyond_end(length);
    was_cut_ = is_last_ && !is_unfinished;
    if (is_last_)
      file_.take_rest(bytes);
    else
      file_.take_data(length, bytes);
    if (!is_plain) {
      if (fields.compression != "bz2" && fields.compression != "lz4")
        throw Error(
            ErrorCode::kUnsupported,
            "a chunk is compressed with '" + std::string(fields.compression) + "'; none, bz2 or lz4 were expected",
            file_.source().place(file_.place()), "record again with another compression");
      const std::size_t most = is_unfinished ? file_.most_bytes() : size;
      UnpackedChunk unpacked = fields.compression == "bz2" ? unpack_bz2(packed_, most) : unpack_lz4(packed_, most);
      chunk_ = std::move(unpacked.bytes);
      chunk_problem_ = std::move(unpacked.problem);
    }
    if (!is_last_ && chunk_problem_.empty() && chunk_.size() != size)
      chunk_problem_ =
          "it has " + std::to_string(chunk_.size()) + " bytes, not " + std::to_string(size) + " as it says";
    rest_ = chunk_;
    if (rest_.empty()) end_chunk();
  }

  // True for a message that is delivered. What came of a chunk before it was damaged is good.
  bool read_in_chunk(BagMessage& message) {
    const auto record = take_ros1_record(rest_);
    if (!record || !record->fields.op) {
      if (chunk_problem_.empty() && !is_last_) chunk_problem_ = "a record in it is cut short or cannot be decoded";
      rest_ = {};
      end_chunk();
      return false;
    }
    bool is_delivered = false;
    if (*record->fields.op == static_cast<std::uint8_t>(Ros1Op::connection))
      add(*record);
    else if (*record->fields.op == static_cast<std::uint8_t>(Ros1Op::message))
      is_delivered = accept(*record, message);
    else
      file_.fail("a chunk holds a record of kind " + std::to_string(*record->fields.op) +
                     "; messages and connections were expected",
                 file_.place());
    if (rest_.empty() && !is_delivered) end_chunk();
    return is_delivered;
  }

  void end_chunk() {
    if (is_last_) {
      ended_ = true;
      is_last_ = false;
      chunk_problem_.clear();
      return;
    }
    if (!chunk_problem_.empty()) {
      const std::string problem = std::exchange(chunk_problem_, {});
      file_.fail("a chunk is damaged: " + problem, file_.place());
    }
  }

  void add(const Ros1Record& record) {
    try {
      topics_.add(record);
    } catch (const Error& error) {
      file_.fail(error.problem(), file_.place());
    }
  }

  bool accept(const Ros1Record& record, BagMessage& message) {
    if (!record.fields.connection || !record.fields.time_ns)
      file_.fail("a message without connection or time", file_.place());
    const auto topic = topics_.topic_of(*record.fields.connection);
    if (!topic)
      file_.fail("a message of connection " + std::to_string(*record.fields.connection) + ", which no record describes",
                 file_.place());
    if (is_looking_) topics_.count_message(*topic);
    const bool is_selected = !selects_ || (*topic < selected_.size() && selected_[*topic]);
    if (is_looking_ || !is_selected) return false;
    message.topic = *topic;
    message.received_ns = *record.fields.time_ns;
    const auto* bytes = reinterpret_cast<const std::byte*>(record.data.data());
    message.data.assign(bytes, bytes + record.data.size());
    message.place = file_.place();
    return true;
  }

  // Topics and numbers of messages by the index at the file's end. False where there is none, or it makes no sense.
  bool read_index() {
    const std::uint64_t bytes = file_.source().file_bytes();
    if (index_position_ == 0 || file_.source().packed() || index_position_ >= bytes ||
        bytes - index_position_ > file_.most_bytes())
      return false;
    std::string index(bytes - index_position_, '\0');
    std::ifstream file(file_.source().path(), std::ios::binary);
    file.seekg(static_cast<std::streamoff>(index_position_));
    if (!file.read(index.data(), static_cast<std::streamsize>(index.size()))) return false;
    return topics_.add_index(index);
  }

  // Reads everything to learn the topics; damage is reported when reading comes to it again.
  void find_topics() {
    is_looking_ = true;
    BagMessage unused;
    try {
      while (next(unused)) {}
    } catch (const Error&) {
      if (topics_.topics().empty()) throw;
    }
    file_.source().rewind();
    rest_ = {};
    chunk_problem_.clear();
    ended_ = is_last_ = was_cut_ = is_looking_ = has_message_ = false;
    read_start();
  }

  RecordFile file_;
  std::uint64_t index_position_ = 0;
  Ros1Topics topics_;
  std::vector<bool> selected_;
  bool selects_ = false, ended_ = false, is_last_ = false, was_cut_ = false, is_looking_ = false;
  bool has_message_ = false;
  std::string chunk_, packed_, chunk_problem_;
  std::string_view rest_;  // of chunk_
};

}  // namespace

bool is_ros1_bag(std::string_view start_of_file) { return start_of_file.substr(0, kMagic.size()) == kMagic; }

std::unique_ptr<BagReader> open_ros1_bag(const std::filesystem::path& file, std::uint64_t most_bytes) {
  return std::make_unique<Ros1Bag>(file, most_bytes);
}

}  // namespace mapweave::rawlog::ros
