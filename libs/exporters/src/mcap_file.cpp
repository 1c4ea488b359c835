// MCAP, version 0: https://mcap.dev/spec

#include "ros_message.h"

#include <mapweave/core/error.h>
#include <mapweave/core/mcap_format.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <limits>
#include <map>

namespace mapweave::exporters {
namespace {

using mcap::append_record;
using mcap::append_text;
using mcap::Opcode;

constexpr std::size_t kChunkBytes = std::size_t{1} << 20;
constexpr int kCompressionLevel = 3;

// As rosbag2 describes who published: kept for those who come later, reliable.
constexpr const char* kLatched =
    "- history: 1\n  depth: 1\n  reliability: 1\n  durability: 1\n  deadline:\n    sec: 0\n    nsec: 0\n  lifespan:\n"
    "    sec: 0\n    nsec: 0\n  liveliness: 0\n  liveliness_lease_duration:\n    sec: 0\n    nsec: 0\n"
    "  avoid_ros_namespace_conventions: false";

std::uint32_t crc_of(std::string_view bytes) {
  return static_cast<std::uint32_t>(::crc32_z(0, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

std::string compressed(std::string_view plain) {
  std::string packed(::ZSTD_compressBound(plain.size()), '\0');
  const std::size_t size = ::ZSTD_compress(packed.data(), packed.size(), plain.data(), plain.size(), kCompressionLevel);
  if (ZSTD_isError(size) != 0U) throw Error(ErrorCode::kInternal, std::string("zstd: ") + ::ZSTD_getErrorName(size));
  packed.resize(size);
  return packed;
}

// The channel of topic N is N; each type is a schema, from 1.
std::uint16_t schema_of(RosType type) { return static_cast<std::uint16_t>(static_cast<int>(type) + 1); }

void append_schema(std::string& to, RosType type) {
  mcap::append_schema(to, schema_of(type), ros_type_name(type, RosGeneration::ros2), "ros2msg",
                      ros_definition(type, RosGeneration::ros2));
}

void append_channel(std::string& to, std::uint16_t number, const RosTopic& topic) {
  std::string metadata;
  append_text(metadata, "offered_qos_profiles");
  append_text(metadata, topic.latched ? kLatched : "");
  mcap::append_channel(to, number, schema_of(topic.type), topic.name, "cdr", metadata);
}

class McapWriter {
 public:
  explicit McapWriter(const RosRecording& recording) : recording_(recording), known_(recording.topics.size(), false) {
    bytes_.assign(mcap::kMagic);
    mcap::append_header(bytes_, "ros2", "mapweave");
    for (const RosMessage& message : recording.messages) {
      add(message);
      if (chunk_.size() >= kChunkBytes) end_chunk();
    }
    if (!chunk_.empty()) end_chunk();
    mcap::append_data_end(bytes_);
  }

  std::string take() {
    const std::uint64_t start = bytes_.size();
    for (const RosTopic& topic : recording_.topics)
      if (&topic == &*first_of(topic.type)) append_schema(bytes_, topic.type);
    for (std::uint16_t topic = 0; topic < recording_.topics.size(); ++topic)
      append_channel(bytes_, topic, recording_.topics[topic]);
    append_statistics();
    bytes_ += indexes_;
    std::string footer;
    append_number(footer, start);
    append_number(footer, std::uint64_t{0});  // no offsets of the summary's groups
    std::string end(1, static_cast<char>(Opcode::kFooter));
    append_number(end, static_cast<std::uint64_t>(footer.size() + sizeof(std::uint32_t)));
    bytes_ += end + footer;
    append_number(bytes_, crc_of(std::string_view(bytes_).substr(static_cast<std::size_t>(start))));
    bytes_ += mcap::kMagic;
    return std::move(bytes_);
  }

 private:
  struct Entry {
    std::uint64_t time_ns, offset;
  };

  std::vector<RosTopic>::const_iterator first_of(RosType type) const {
    return std::find_if(recording_.topics.begin(), recording_.topics.end(),
                        [&](const RosTopic& topic) { return topic.type == type; });
  }

  void add(const RosMessage& message) {
    const auto channel = static_cast<std::uint16_t>(message.topic);
    const auto time_ns = static_cast<std::uint64_t>(message.time_ns);
    if (!known_[channel]) {
      append_schema(chunk_, recording_.topics[channel].type);
      append_channel(chunk_, channel, recording_.topics[channel]);
    }
    known_[channel] = true;
    entries_[channel].push_back({time_ns, chunk_.size()});
    std::string fields;
    append_number(fields, channel);
    append_number(fields, static_cast<std::uint32_t>(counts_[channel]));
    append_number(fields, time_ns);
    append_number(fields, time_ns);
    append_record(chunk_, Opcode::kMessage, fields + message.bytes);
    ++counts_[channel];
    chunk_first_ns_ = std::min(chunk_first_ns_, time_ns);
    chunk_last_ns_ = std::max(chunk_last_ns_, time_ns);
  }

  void end_chunk() {
    const std::uint64_t place = bytes_.size();
    const std::string packed = compressed(chunk_);
    std::string fields;
    append_number(fields, chunk_first_ns_);
    append_number(fields, chunk_last_ns_);
    append_number(fields, static_cast<std::uint64_t>(chunk_.size()));
    append_number(fields, crc_of(chunk_));
    append_text(fields, "zstd");
    append_number(fields, static_cast<std::uint64_t>(packed.size()));
    append_record(bytes_, Opcode::kChunk, fields + packed);

    const std::uint64_t end = bytes_.size();
    std::string offsets;
    for (const auto& [channel, entries] : entries_) {
      append_number(offsets, channel);
      append_number(offsets, static_cast<std::uint64_t>(bytes_.size()));
      std::string places;
      for (const Entry& entry : entries) {
        append_number(places, entry.time_ns);
        append_number(places, entry.offset);
      }
      std::string index;
      append_number(index, channel);
      append_text(index, places);
      append_record(bytes_, Opcode::kMessageIndex, index);
    }
    std::string about;
    append_number(about, chunk_first_ns_);
    append_number(about, chunk_last_ns_);
    append_number(about, place);
    append_number(about, end - place);
    append_text(about, offsets);
    append_number(about, static_cast<std::uint64_t>(bytes_.size()) - end);
    append_text(about, "zstd");
    append_number(about, static_cast<std::uint64_t>(packed.size()));
    append_number(about, static_cast<std::uint64_t>(chunk_.size()));
    append_record(indexes_, Opcode::kChunkIndex, about);
    first_ns_ = std::min(first_ns_, chunk_first_ns_);
    last_ns_ = std::max(last_ns_, chunk_last_ns_);
    ++chunk_count_;
    chunk_.clear();
    entries_.clear();
    chunk_first_ns_ = kLatest;
    chunk_last_ns_ = 0;
  }

  void append_statistics() {
    std::string counts;
    for (const auto& [channel, count] : counts_) {
      append_number(counts, channel);
      append_number(counts, count);
    }
    std::uint16_t schemas = 0;
    for (const RosTopic& topic : recording_.topics) schemas += &topic == &*first_of(topic.type) ? 1 : 0;
    std::string fields;
    append_number(fields, static_cast<std::uint64_t>(recording_.messages.size()));
    append_number(fields, schemas);
    append_number(fields, static_cast<std::uint32_t>(recording_.topics.size()));
    append_number(fields, std::uint32_t{0});  // attachments
    append_number(fields, std::uint32_t{0});  // metadata
    append_number(fields, chunk_count_);
    append_number(fields, chunk_count_ == 0 ? std::uint64_t{0} : first_ns_);
    append_number(fields, last_ns_);
    append_text(fields, counts);
    append_record(bytes_, Opcode::kStatistics, fields);
  }

  static constexpr std::uint64_t kLatest = std::numeric_limits<std::uint64_t>::max();
  const RosRecording& recording_;
  std::vector<bool> known_;  // channels that stand in a chunk
  std::string bytes_, chunk_, indexes_;
  std::map<std::uint16_t, std::vector<Entry>> entries_;
  std::map<std::uint16_t, std::uint64_t> counts_;
  std::uint64_t chunk_first_ns_ = kLatest, chunk_last_ns_ = 0, first_ns_ = kLatest, last_ns_ = 0;
  std::uint32_t chunk_count_ = 0;
};

}  // namespace

std::string mcap_of(const RosRecording& recording) { return McapWriter(recording).take(); }

}  // namespace mapweave::exporters
