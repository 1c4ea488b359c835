#pragma once
// The end of an MCAP file: what it says of the whole.

#include "mcap_records.h"
#include "seekable_file.h"

#include <optional>

namespace mapweave::rawlog::ros {

struct McapSummary {
  McapChannels channels;
  // In the order of their first messages; empty where chunks cannot be read by their index alone: there are none, or
  // messages stand beside them.
  std::vector<McapChunkIndex> chunks;
  bool has_counts = false;  // of messages, in channels.topics()
  bool has_all_channels = false;
  std::uint32_t data_crc = 0;  // of all bytes before the record DataEnd; 0: not known
  std::uint64_t data_end = 0;  // where that record begins; 0: there is none
};

// `most_bytes`: a record of more bytes is damage. Without a summary an empty one; a summary that is damaged, or does
// not fit the file, is left out with a warning.
McapSummary read_mcap_summary(const SeekableFile& file, std::uint64_t most_bytes);

}  // namespace mapweave::rawlog::ros
