#pragma once
// The formats that are read. A new one is a file and a line here.

#include "record_source.h"

#include <mapweave/rawlog/observation_stream.h>

#include <memory>
#include <string_view>
#include <vector>

namespace mapweave::rawlog {

class ByteSource;

struct Format {
  const char* name;                                    // "MRPT rawlog"
  std::vector<std::string_view> extensions;            // with the dot; ".gz" aside
  bool (*recognises)(std::string_view start_of_file);  // unpacked
  std::unique_ptr<RecordSource> (*open)(std::unique_ptr<ByteSource> bytes, const ReadOptions& options);
};

const std::vector<Format>& formats();

// By content, then by extension; throws Error kUnsupported naming the formats.
const Format& recognise(ByteSource& bytes);

struct OpenedLog {
  const char* format = "";
  std::unique_ptr<RecordSource> source;
};
// Of a file or a folder.
OpenedLog open_source(const std::filesystem::path& path, const ReadOptions& options);

bool is_rawlog(std::string_view start);
bool is_carmen(std::string_view start);
bool is_g2o(std::string_view start);
std::unique_ptr<RecordSource> open_rawlog(std::unique_ptr<ByteSource> bytes, const ReadOptions& options);
std::unique_ptr<RecordSource> open_carmen(std::unique_ptr<ByteSource> bytes, const ReadOptions& options);
std::unique_ptr<RecordSource> open_g2o(std::unique_ptr<ByteSource> bytes, const ReadOptions& options);

}  // namespace mapweave::rawlog
