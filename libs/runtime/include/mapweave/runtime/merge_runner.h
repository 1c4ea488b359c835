#pragma once
// `mapweave merge`: maps that exist already -> team maps.

#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/merge_requests.h>

namespace mapweave::runtime {

struct MergeSettings {
  std::filesystem::path out;
  bool force = false;
  MergeRequests requests = {};
  bool forget_requests = false;  // forget requests of the merges and runs that made the given teams
  Origins origins =
      {};  // where the configuration's options come from: options given count, others are those of the given teams
};

// `paths`: stores (.mwdb), journals of camera map servers (.mwj), map_server grids (.yaml), folders of one map and
// folders of results; the first one gives the frame (team.frame), else their order changes nothing. A team's store, and
// a folder of results, stand for the robots' own maps that they were made of, under the same names; refusals, priors
// and options of fusion that a team was made with hold again, and notes say so, unless they are to be forgotten or said
// anew. Throws Error: what read_map_input(), without() and apply() throw, kCannotWrite; Interrupted.
Report run_merge(const RunConfiguration&, const std::vector<std::filesystem::path>& paths, const MergeSettings&,
                 WorkerPool&, Progress&);

}  // namespace mapweave::runtime
