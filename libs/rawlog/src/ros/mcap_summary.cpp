#include "mcap_summary.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>

#include <algorithm>
#include <map>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::uint64_t kEndBytes = kRecordHeadBytes + kFooterBytes + 8;  // the footer and the magic after it
constexpr std::size_t kDataEndBytes = kRecordHeadBytes + 4;
constexpr std::size_t kCrcBytes = 4;

Error misfit(const std::string& what) { return Error(ErrorCode::kCorrupt, what); }

std::string bytes_at(const SeekableFile& file, std::uint64_t offset, std::uint64_t count) {
  if (count > file.bytes()) throw misfit("a record claims more than there is");
  std::string bytes(static_cast<std::size_t>(count), '\0');
  if (!file.read_at(offset, bytes.data(), bytes.size())) throw misfit("a record claims more than there is");
  return bytes;
}

std::optional<McapFooter> read_footer(const SeekableFile& file) {
  if (file.bytes() < mcap::kMagic.size() + kEndBytes) return std::nullopt;
  const std::string end = bytes_at(file, file.bytes() - kEndBytes, kEndBytes);
  const RecordHead head = parse_head(end.data());
  if (std::string_view(end).substr(end.size() - mcap::kMagic.size()) != mcap::kMagic ||
      head.opcode != Opcode::kFooter || head.bytes != kFooterBytes)
    return std::nullopt;
  return parse_footer(std::string_view(end).substr(kRecordHeadBytes, kFooterBytes));
}

void read_data_end(const SeekableFile& file, std::uint64_t after, McapSummary& summary) {
  if (after < mcap::kMagic.size() + kDataEndBytes) return;
  const std::string record = bytes_at(file, after - kDataEndBytes, kDataEndBytes);
  const RecordHead head = parse_head(record.data());
  if (head.opcode != Opcode::kDataEnd || head.bytes != kDataEndBytes - kRecordHeadBytes) return;
  summary.data_end = after - kDataEndBytes;
  for (std::size_t i = 0; i < kCrcBytes; ++i)
    summary.data_crc |= static_cast<std::uint32_t>(static_cast<unsigned char>(record[kRecordHeadBytes + i])) << 8 * i;
}

void parse_records(std::string_view records, McapSummary& summary) {
  std::map<std::uint16_t, std::uint64_t> counts;
  while (!records.empty()) {
    if (records.size() < kRecordHeadBytes) throw misfit("it ends within a record");
    const RecordHead head = parse_head(records.data());
    records.remove_prefix(kRecordHeadBytes);
    if (head.bytes > records.size()) throw misfit("it ends within a record");
    const auto fields = records.substr(0, static_cast<std::size_t>(head.bytes));
    records.remove_prefix(fields.size());
    if (head.opcode == Opcode::kSchema) summary.channels.add_schema(fields);
    if (head.opcode == Opcode::kChannel) summary.channels.add_channel(fields);
    if (head.opcode == Opcode::kChunkIndex) summary.chunks.push_back(parse_chunk_index(fields));
    if (head.opcode == Opcode::kStatistics) {
      counts = parse_message_counts(fields);
      summary.has_counts = true;
    }
  }
  summary.channels.set_counts(counts);
  summary.has_all_channels = summary.has_counts && std::all_of(counts.begin(), counts.end(), [&](const auto& count) {
                               return summary.channels.is_known(count.first);
                             });
}

// Walks over the records up to DataEnd, whole chunks at a time: whether all chunks are where the index says, and no
// message stands beside them.
bool covers_all_messages(const SeekableFile& file, McapSummary& summary) {
  std::map<std::uint64_t, const McapChunkIndex*> by_offset;
  for (const McapChunkIndex& chunk : summary.chunks) by_offset.emplace(chunk.offset, &chunk);
  std::size_t found = 0;
  for (std::uint64_t position = mcap::kMagic.size(); position < summary.data_end;) {
    const std::string start = bytes_at(file, position, kRecordHeadBytes);
    const RecordHead head = parse_head(start.data());
    const std::uint64_t left = file.bytes() - position - kRecordHeadBytes;
    if (head.bytes > left) throw misfit("a record claims more than there is");
    if (head.opcode == Opcode::kMessage) return false;
    if (head.opcode == Opcode::kSchema)
      summary.channels.add_schema(bytes_at(file, position + kRecordHeadBytes, head.bytes));
    if (head.opcode == Opcode::kChannel)
      summary.channels.add_channel(bytes_at(file, position + kRecordHeadBytes, head.bytes));
    position += kRecordHeadBytes + head.bytes;
    if (head.opcode != Opcode::kChunk) continue;
    const auto chunk = by_offset.find(position - kRecordHeadBytes - head.bytes);
    if (chunk == by_offset.end() || chunk->second->bytes != kRecordHeadBytes + head.bytes ||
        chunk->second->index_bytes > file.bytes() - position)
      throw misfit("its chunks are not those of the file");
    ++found;
    position += chunk->second->index_bytes;
  }
  if (found != summary.chunks.size()) throw misfit("its chunks are not those of the file");
  const bool all_are_known =
      std::all_of(summary.chunks.begin(), summary.chunks.end(), [&](const McapChunkIndex& chunk) {
        return !chunk.channels.empty() &&
               std::all_of(chunk.channels.begin(), chunk.channels.end(),
                           [&](std::uint16_t channel) { return summary.channels.is_known(channel); });
      });
  summary.has_all_channels = summary.has_all_channels || all_are_known;
  return summary.has_all_channels;
}

McapSummary read_sound_summary(const SeekableFile& file, std::uint64_t most_bytes) {
  McapSummary summary;
  const auto footer = read_footer(file);
  if (!footer) return summary;
  const std::uint64_t footer_start = file.bytes() - kEndBytes;
  const std::uint64_t start = footer->summary_start == 0 ? footer_start : footer->summary_start;
  if (start > footer_start) throw misfit("it would begin after the file's end");
  read_data_end(file, start, summary);
  if (footer->summary_start == 0) return summary;
  if (file.bytes() - start > most_bytes)
    throw misfit("it would be of " + std::to_string(file.bytes() - start) + " bytes");
  // The checksum is of the footer's beginning, too.
  const std::string bytes = bytes_at(file, start, file.bytes() - mcap::kMagic.size() - kCrcBytes - start);
  if (footer->summary_crc != 0 && crc_of(bytes) != footer->summary_crc) throw misfit("its checksum is wrong");
  parse_records(std::string_view(bytes).substr(0, static_cast<std::size_t>(footer_start - start)), summary);
  if (summary.chunks.empty()) return summary;
  if (summary.data_end == 0) throw misfit("no end of the data stands before it");
  if (!covers_all_messages(file, summary)) summary.chunks.clear();
  std::stable_sort(summary.chunks.begin(), summary.chunks.end(),
                   [](const McapChunkIndex& a, const McapChunkIndex& b) { return a.start_ns < b.start_ns; });
  return summary;
}

}  // namespace

McapSummary read_mcap_summary(const SeekableFile& file, std::uint64_t most_bytes) {
  try {
    return read_sound_summary(file, most_bytes);
  } catch (const Error& error) {
    log(LogLevel::warning, file.path().string() + ": the summary at the end of the file is of no use: " +
                               error.problem() + "; the file is read without it");
    return {};
  }
}

}  // namespace mapweave::rawlog::ros
