#pragma once
// What a run teaches of a team, for planning the next one.

#include <mapweave/scheduling/problem.h>

#include <filesystem>

namespace mapweave::runtime {

// Of a folder of results of `mapweave run`: its robots with their scans and with what their maps shared, and the edges,
// links and processors that its config.yaml has (state of the links at the beginning). Throws Error: kMissing and
// kCorrupt for files that are not there or no such results, kBadInput for a run that was interrupted.
scheduling::Problem problem_of_run(const std::filesystem::path& folder);

}  // namespace mapweave::runtime
