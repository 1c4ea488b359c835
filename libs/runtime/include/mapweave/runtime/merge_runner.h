#pragma once
// `mapweave merge`: maps that exist already -> team maps.

#include <mapweave/runtime/batch_runner.h>

namespace mapweave::runtime {

struct MergeSettings {
  std::filesystem::path out;
  bool force = false;
};

// `paths`: stores (.mwdb), journals of live map servers (.mwj), map_server grids (.yaml) and folders of one map, in any order. Throws
// Error: what read_map_input() throws, kCannotWrite, kInterrupted.
Report run_merge(const RunConfiguration&, const std::vector<std::filesystem::path>& paths, const MergeSettings&, WorkerPool&, Progress&);

}  // namespace mapweave::runtime
