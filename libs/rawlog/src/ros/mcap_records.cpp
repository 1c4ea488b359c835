#include "mcap_records.h"

#include "message_reader.h"

#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <limits>

namespace mapweave::rawlog::ros {
namespace {

constexpr const char* kCopyAgain = "copy the recording again, or record again";

MessageReader fields_of(std::string_view record) {
  return {reinterpret_cast<const std::byte*>(record.data()), record.size(), MessageEncoding::ros1, "record"};
}

}  // namespace

std::uint32_t crc_of(std::string_view bytes, std::uint32_t before) {
  return static_cast<std::uint32_t>(::crc32_z(before, reinterpret_cast<const Bytef*>(bytes.data()), bytes.size()));
}

RecordHead parse_head(const char* nine_bytes) {
  RecordHead head{static_cast<Opcode>(nine_bytes[0]), 0};
  std::memcpy(&head.bytes, nine_bytes + 1, sizeof head.bytes);
  return head;
}

McapMessage parse_message(std::string_view fields) {
  MessageReader reader = fields_of(fields);
  McapMessage message{};
  message.channel = reader.read<std::uint16_t>();
  reader.skip<std::uint32_t>();  // sequence
  const auto log_ns = reader.read<std::uint64_t>();
  reader.skip<std::uint64_t>();  // when it was published
  if (log_ns > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()))
    throw Error(ErrorCode::kCorrupt, "a message's time is after the year 2262", {}, kCopyAgain);
  message.log_ns = static_cast<std::int64_t>(log_ns);
  message.data = fields.substr(reader.position());
  return message;
}

McapChunk parse_chunk(std::string_view fields) {
  const McapChunk chunk = parse_cut_chunk(fields);
  if (chunk.is_cut)
    throw Error(ErrorCode::kCorrupt,
                "a chunk claims more bytes than the " + std::to_string(chunk.records.size()) + " that are there", {},
                kCopyAgain);
  return chunk;
}

McapChunk parse_cut_chunk(std::string_view fields) {
  MessageReader reader = fields_of(fields);
  McapChunk chunk{};
  reader.skip<std::uint64_t>(2);  // times of the first and last message
  chunk.unpacked_bytes = reader.read<std::uint64_t>();
  chunk.crc = reader.read<std::uint32_t>();
  chunk.compression = reader.string();
  const auto bytes = reader.read<std::uint64_t>();
  chunk.is_cut = bytes > reader.left();
  chunk.records = fields.substr(reader.position(), static_cast<std::size_t>(bytes));
  return chunk;
}

McapChunkIndex parse_chunk_index(std::string_view fields) {
  MessageReader reader = fields_of(fields);
  McapChunkIndex index{};
  index.start_ns = reader.read<std::uint64_t>();
  reader.skip<std::uint64_t>();
  index.offset = reader.read<std::uint64_t>();
  index.bytes = reader.read<std::uint64_t>();
  MessageReader offsets = fields_of(reader.bytes());
  while (offsets.left() > 0) {
    index.channels.push_back(offsets.read<std::uint16_t>());
    offsets.skip<std::uint64_t>();
  }
  index.index_bytes = reader.read<std::uint64_t>();
  return index;
}

McapFooter parse_footer(std::string_view fields) {
  MessageReader reader = fields_of(fields);
  McapFooter footer{};
  footer.summary_start = reader.read<std::uint64_t>();
  reader.skip<std::uint64_t>();
  footer.summary_crc = reader.read<std::uint32_t>();
  return footer;
}

std::map<std::uint16_t, std::uint64_t> parse_message_counts(std::string_view statistics) {
  MessageReader reader = fields_of(statistics);
  reader.skip<std::uint64_t>();   // messages
  reader.skip<std::uint16_t>();   // schemas
  reader.skip<std::uint32_t>(4);  // channels, attachments, metadata, chunks
  reader.skip<std::uint64_t>(2);  // times
  std::map<std::uint16_t, std::uint64_t> counts;
  MessageReader pairs = fields_of(reader.bytes());
  while (pairs.left() > 0) {
    const auto channel = pairs.read<std::uint16_t>();
    counts[channel] = pairs.read<std::uint64_t>();
  }
  return counts;
}

void McapChannels::add_schema(std::string_view fields) {
  MessageReader reader = fields_of(fields);
  const auto id = reader.read<std::uint16_t>();
  schemas_.emplace(id, type_without_msg(reader.string()));
}

void McapChannels::add_channel(std::string_view fields) {
  MessageReader reader = fields_of(fields);
  const auto id = reader.read<std::uint16_t>();
  const auto schema = reader.read<std::uint16_t>();
  BagTopic topic;
  topic.name = reader.string();
  const std::string_view encoding = reader.string();
  if (is_known(id)) return;
  const auto type = schemas_.find(schema);
  const bool is_ros = (encoding == "ros1" || encoding == "cdr") && schema != 0;
  if (is_ros && type == schemas_.end())
    throw Error(ErrorCode::kCorrupt,
                "topic '" + topic.name + "' is of schema " + std::to_string(schema) + ", which the file does not hold",
                {}, kCopyAgain);
  if (!is_ros) {
    topic_of_.emplace(id, std::nullopt);
    left_out_ += (left_out_.empty() ? "" : ", ") + topic.name + " (" + std::string(encoding) + ")";
    return;
  }
  topic.encoding = encoding == "cdr" ? MessageEncoding::cdr : MessageEncoding::ros1;
  topic.type = type->second;
  const auto same = std::find_if(topics_.begin(), topics_.end(), [&](const BagTopic& known) {
    return known.name == topic.name && known.type == topic.type && known.encoding == topic.encoding;
  });
  topic_of_.emplace(id, static_cast<std::size_t>(same - topics_.begin()));
  if (same == topics_.end()) topics_.push_back(std::move(topic));
}

std::optional<std::size_t> McapChannels::topic_of(std::uint16_t channel) const {
  const auto found = topic_of_.find(channel);
  if (found == topic_of_.end())
    throw Error(ErrorCode::kCorrupt,
                "a message is of channel " + std::to_string(channel) + ", which the file does not describe before it",
                {}, kCopyAgain);
  return found->second;
}

void McapChannels::set_counts(const std::map<std::uint16_t, std::uint64_t>& messages) {
  for (const auto& [channel, count] : messages)
    if (const auto found = topic_of_.find(channel); found != topic_of_.end() && found->second)
      topics_[*found->second].messages += count;
}

std::string type_without_msg(std::string_view type) {
  std::string plain(type);
  if (const auto place = plain.find("/msg/"); place != std::string::npos) plain.erase(place, 4);
  return plain;
}

}  // namespace mapweave::rawlog::ros
