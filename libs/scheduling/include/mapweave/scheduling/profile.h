#pragma once
// The latency model learnt from folders of results (`summary.json`, maps) of earlier runs.

#include <mapweave/scheduling/latency_model.h>
#include <mapweave/scheduling/regression.h>

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::scheduling {

struct ProfiledTerm {
  std::string name, basis, unit;  // "fusion on an edge", "maps", "s"
  Regression regression;
  struct Point {
    double at, value, half_width;  // of the 95 % prediction interval; infinite where it cannot be told
  };
  std::vector<Point> shown;
};

struct Profile {
  LatencyModel model;  // what the runs do not tell has its default
  std::vector<ProfiledTerm> terms;
  std::vector<std::string> notes;  // what was not told
};

// Throws Error kMissing, kCorrupt or kBadInput, naming the file, for a folder without a summary or a summary that cannot be one.
Profile profile_runs(const std::vector<std::filesystem::path>& folders);

}  // namespace mapweave::scheduling
