// Bags of ROS 1, version 2.0: http://wiki.ros.org/Bags/Format/2.0

#include "ros_message.h"

#include <algorithm>
#include <map>

namespace mapweave::exporters {
namespace {

constexpr std::size_t kHeaderRecordBytes = 4096, kChunkBytes = 768 * 1024;
constexpr std::int64_t kNanoseconds = 1'000'000'000;

enum Operation : std::uint8_t {
  kMessageData = 2,
  kBagHeader = 3,
  kIndexData = 4,
  kChunk = 5,
  kChunkInfo = 6,
  kConnection = 7
};

class Fields {
 public:
  Fields& text(std::string_view name, std::string_view value) {
    append_number(bytes_, static_cast<std::uint32_t>(name.size() + 1 + value.size()));
    bytes_.append(name).append("=").append(value);
    return *this;
  }
  template <class Number>
  Fields& number(std::string_view name, Number value) {
    std::string raw;
    append_number(raw, value);
    return text(name, raw);
  }
  Fields& time(std::string_view name, std::int64_t ns) { return text(name, time_text(ns)); }
  static std::string time_text(std::int64_t ns) {
    std::string raw;
    append_number(raw, static_cast<std::uint32_t>(ns / kNanoseconds));
    append_number(raw, static_cast<std::uint32_t>(ns % kNanoseconds));
    return raw;
  }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

Fields operation(Operation code) { return Fields().number("op", static_cast<std::uint8_t>(code)); }

void append_record(std::string& to, const Fields& header, std::string_view data) {
  append_number(to, static_cast<std::uint32_t>(header.bytes().size()));
  to += header.bytes();
  append_number(to, static_cast<std::uint32_t>(data.size()));
  to += data;
}

void append_connection(std::string& to, std::uint32_t number, const RosTopic& topic) {
  Fields about;
  about.text("topic", topic.name)
      .text("type", ros_type_name(topic.type, RosGeneration::ros1))
      .text("md5sum", ros1_md5(topic.type))
      .text("message_definition", ros_definition(topic.type, RosGeneration::ros1))
      .text("callerid", "/mapweave");
  if (topic.latched) about.text("latching", "1");
  append_record(to, operation(kConnection).number("conn", number).text("topic", topic.name), about.bytes());
}

class Chunks {
 public:
  explicit Chunks(const RosRecording& recording) : recording_(recording), known_(recording.topics.size(), false) {
    bytes_.assign("#ROSBAG V2.0\n");
    start_ = bytes_.size();
    bytes_.append(kHeaderRecordBytes, ' ');
    for (const RosMessage& message : recording.messages) {
      add(message);
      if (chunk_.size() >= kChunkBytes) end_chunk();
    }
    if (!chunk_.empty()) end_chunk();
  }

  std::string take() {
    const std::uint64_t index = bytes_.size();
    for (std::uint32_t topic = 0; topic < recording_.topics.size(); ++topic)
      append_connection(bytes_, topic, recording_.topics[topic]);
    bytes_ += infos_;
    const Fields header = operation(kBagHeader)
                              .number("index_pos", index)
                              .number("conn_count", static_cast<std::uint32_t>(recording_.topics.size()))
                              .number("chunk_count", chunk_count_);
    const std::size_t padding = kHeaderRecordBytes - 2 * sizeof(std::uint32_t) - header.bytes().size();
    std::string record;
    append_record(record, header, std::string(padding, ' '));
    bytes_.replace(start_, kHeaderRecordBytes, record);
    return std::move(bytes_);
  }

 private:
  struct Entry {
    std::int64_t time_ns;
    std::uint32_t offset;
  };

  void add(const RosMessage& message) {
    const auto topic = static_cast<std::uint32_t>(message.topic);
    if (!known_[topic]) append_connection(chunk_, topic, recording_.topics[topic]);
    known_[topic] = true;
    entries_[topic].push_back({message.time_ns, static_cast<std::uint32_t>(chunk_.size())});
    append_record(chunk_, operation(kMessageData).number("conn", topic).time("time", message.time_ns), message.bytes);
    if (entries_.size() == 1 && entries_[topic].size() == 1) first_ns_ = last_ns_ = message.time_ns;
    first_ns_ = std::min(first_ns_, message.time_ns);
    last_ns_ = std::max(last_ns_, message.time_ns);
  }

  void end_chunk() {
    const std::uint64_t place = bytes_.size();
    append_record(
        bytes_, operation(kChunk).text("compression", "none").number("size", static_cast<std::uint32_t>(chunk_.size())),
        chunk_);
    std::string counts;
    for (const auto& [topic, entries] : entries_) {
      const auto count = static_cast<std::uint32_t>(entries.size());
      std::string data;
      for (const Entry& entry : entries) {
        data += Fields::time_text(entry.time_ns);
        append_number(data, entry.offset);
      }
      append_record(bytes_,
                    operation(kIndexData).number("ver", std::uint32_t{1}).number("conn", topic).number("count", count),
                    data);
      append_number(counts, topic);
      append_number(counts, count);
    }
    append_record(infos_,
                  operation(kChunkInfo)
                      .number("ver", std::uint32_t{1})
                      .number("chunk_pos", place)
                      .time("start_time", first_ns_)
                      .time("end_time", last_ns_)
                      .number("count", static_cast<std::uint32_t>(entries_.size())),
                  counts);
    ++chunk_count_;
    chunk_.clear();
    entries_.clear();
  }

  const RosRecording& recording_;
  std::vector<bool> known_;  // topics whose connection stands in a chunk
  std::string bytes_, chunk_, infos_;
  std::size_t start_ = 0;  // of the bag's header
  std::map<std::uint32_t, std::vector<Entry>> entries_;
  std::int64_t first_ns_ = 0, last_ns_ = 0;  // of the chunk
  std::uint32_t chunk_count_ = 0;
};

}  // namespace

std::string ros1_bag_of(const RosRecording& recording) { return Chunks(recording).take(); }

}  // namespace mapweave::exporters
