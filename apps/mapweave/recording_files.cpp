#include "recording_files.h"

#include "output_file.h"

#include <mapweave/core/error.h>
#include <mapweave/exporters/session_trajectories.h>

#include <algorithm>
#include <utility>

namespace mapweave::app {
namespace {

constexpr std::string_view kBag = ".bag", kMcap = ".mcap";

bool holds_anything(const exporters::RecordedMap& one) {
  return (one.grid != nullptr && !one.grid->empty()) || !one.points.empty() ||
         !exporters::session_trajectories(*one.map).empty();
}

}  // namespace

void expect_free(const RecordingFiles& files, const std::vector<std::filesystem::path>& inputs, bool force) {
  if (!files.bag.empty() && files.bag == files.mcap)
    throw Error(ErrorCode::kUsage, "--bag and --mcap name the same file", files.bag.string(), "name two files");
  for (const auto& [path, ending] : {std::pair(files.bag, kBag), std::pair(files.mcap, kMcap)}) {
    if (path.empty()) continue;
    expect_free(OutputFile{path, inputs, ending});
    std::error_code ignored;
    if (!force && std::filesystem::exists(path, ignored))
      throw Error(ErrorCode::kCannotWrite, "something of that name is there already", path.string(),
                  "name another file, or replace it with --force");
  }
}

std::vector<RecordingBytes> recordings_of(const std::vector<exporters::RecordedMap>& maps,
                                          const RecordingFiles& files) {
  std::vector<RecordingBytes> recordings;
  if (!files.any()) return recordings;
  if (std::none_of(maps.begin(), maps.end(), holds_anything))
    throw Error(ErrorCode::kBadInput, "needs a grid, a cloud or poses of robots, and the map has none",
                files.bag.empty() ? "--mcap" : "--bag", "leave the flag out");
  if (!files.bag.empty()) recordings.push_back({files.bag, kBag, exporters::ros1_bag_bytes(maps)});
  if (!files.mcap.empty()) recordings.push_back({files.mcap, kMcap, exporters::ros2_mcap_bytes(maps)});
  return recordings;
}

}  // namespace mapweave::app
