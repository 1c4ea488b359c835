#pragma once
// The latency model learnt from folders of results of earlier runs: from the "timeline" in their `summary.json`
// (libs/runtime, timeline.h), which says what each tier did in seconds of one core, and what was sent.

#include <mapweave/scheduling/latency_model.h>
#include <mapweave/scheduling/regression.h>

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::scheduling {

struct ProfiledTerm {
  std::string name, basis, unit;  // "fusion on an edge", "scans", "s"
  Regression regression;          // fit_relative
  double median_off = 0.0;        // half of the samples are predicted within this share of what was measured
  struct Point {
    double at, value, half_width;  // of the 95 % prediction interval; infinite where it is unknown
  };
  std::vector<Point> shown;  // at the smallest, the middle and the largest sample
  struct Sample {
    double at, measured, half_width;  // as of points
  };
  std::vector<Sample> samples;  // in the order of the residuals
};

struct Profile {
  LatencyModel model;  // what the runs do not measure has its default
  std::vector<ProfiledTerm> terms;
  std::vector<std::string> notes;  // what was not measured
};

// Seconds are of this machine's core at speed 1. Modes measure what they can: only `offload` packs; `cloud-only` has no
// edges, so the cloud fuses robots' maps. Runs that were interrupted have no timeline: a note says so. Throws Error
// kMissing, kCorrupt or kBadInput, naming the file, for a folder without a summary, a summary that cannot be one, or
// where no run has a timeline.
Profile profile_runs(const std::vector<std::filesystem::path>& folders);

}  // namespace mapweave::scheduling
