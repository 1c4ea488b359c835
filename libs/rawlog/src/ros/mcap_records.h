#pragma once
// What is read of the records of an MCAP file.

#include "bag_reader.h"

#include <mapweave/core/mcap_format.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::rawlog::ros {

// The library that the header of a RosRecorder's recording names.
constexpr std::string_view kRecorderLibrary = "mapweave RosRecorder";

using mcap::Opcode;
constexpr std::size_t kRecordHeadBytes = 9;

struct RecordHead {
  Opcode opcode;
  std::uint64_t bytes;  // of the fields
};
RecordHead parse_head(const char* nine_bytes);

// before: of what comes before these bytes.
std::uint32_t crc_of(std::string_view bytes, std::uint32_t before = 0);

struct McapMessage {
  std::uint16_t channel;
  std::int64_t log_ns;
  std::string_view data;
};
struct McapChunk {
  std::uint64_t unpacked_bytes;
  std::uint32_t crc;  // of the unpacked records; 0: not known
  std::string_view compression, records;
  bool is_cut = false;  // the file ends within the records
};
struct McapChunkIndex {
  std::uint64_t start_ns, offset, bytes;  // of the first message; of the whole record
  std::uint64_t index_bytes;              // of the message indexes that follow the chunk
  std::vector<std::uint16_t> channels;    // that have messages in it; empty: not known
};
struct McapFooter {
  std::uint64_t summary_start;  // 0: there is none
  std::uint32_t summary_crc;    // 0: not known
};
constexpr std::size_t kFooterBytes = 20;

// Of the fields of a record. Throw Error kCorrupt without a place.
McapMessage parse_message(std::string_view fields);
McapChunk parse_chunk(std::string_view fields);
McapChunk parse_cut_chunk(std::string_view fields);  // as far as it goes
McapChunkIndex parse_chunk_index(std::string_view fields);
McapFooter parse_footer(std::string_view fields);
std::map<std::uint16_t, std::uint64_t> parse_message_counts(std::string_view statistics);

// The channels of a file, as topics: those of one name, type and encoding are one topic; those that hold no ROS
// messages are none.
class McapChannels {
 public:
  void add_schema(std::string_view fields);   // throw Error kCorrupt without a place
  void add_channel(std::string_view fields);  // a channel that is known already is left as it is
  bool is_known(std::uint16_t channel) const { return topic_of_.count(channel) != 0; }
  // nullopt for one that holds no ROS messages. Throws Error kCorrupt without a place for one that is not known.
  std::optional<std::size_t> topic_of(std::uint16_t channel) const;
  void set_counts(const std::map<std::uint16_t, std::uint64_t>& messages);

  const std::vector<BagTopic>& topics() const { return topics_; }
  const std::string& left_out() const { return left_out_; }  // "/a (protobuf), /b (json)"

 private:
  std::map<std::uint16_t, std::string> schemas_;  // names
  std::map<std::uint16_t, std::optional<std::size_t>> topic_of_;
  std::vector<BagTopic> topics_;
  std::string left_out_;
};

// "sensor_msgs/msg/LaserScan" without "msg/".
std::string type_without_msg(std::string_view type);

}  // namespace mapweave::rawlog::ros
