#pragma once
// `mapweave explain`: why two maps were merged or stayed apart, on one page.

#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/compose_grid.h>

#include <filesystem>
#include <string>

namespace mapweave::runtime {

struct Explanation {
  std::string a, b;  // the two maps' names as in the verdict, a < b
  std::string text;  // decision, hypotheses with what speaks for and against each, what would help
  std::string png;   // the hypotheses side by side; empty where the maps have no walls to draw
};

// Of two maps of a folder of results of `run` or `merge`. Throws Error: kMissing where there is no merges.json, kUsage
// for names that are not in it (with those that are), kCorrupt for what cannot be read.
Explanation explain(const std::filesystem::path& results, const std::string& one, const std::string& other,
                    const fusion::ComposeOptions&, WorkerPool&);

}  // namespace mapweave::runtime
