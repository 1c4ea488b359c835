#pragma once
// What summary.json, manifest.json and config.yaml say of a run, as the page shows it.

#include "encoding.h"
#include "result_files.h"

#include <string>
#include <vector>

namespace mapweave::report {

// For each of `robots` what the summary says of it.
Json robots_json(const std::vector<std::string>& robots, const Json& summary);

// Outcome, time and memory; null without a summary.
Json summary_data(const Json& summary);

// Shell commands with which the folder can be made again. `options`: those that differ from defaults.
std::vector<std::string> commands(const Json& manifest, const Json& options);

// A word of a shell, quoted where that is needed.
std::string shell_word(const std::string& text);

}  // namespace mapweave::report
