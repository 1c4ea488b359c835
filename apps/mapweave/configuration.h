#pragma once
// The run configuration from all its layers, as run, slam and merge take it.

#include "command.h"

#include <mapweave/core/options.h>
#include <mapweave/runtime/report.h>
#include <mapweave/runtime/run_configuration.h>

namespace mapweave::app {

struct LoadedConfiguration {
  runtime::RunConfiguration configuration;
  Origins origins;
};

// Defaults < file (none where empty) < environment < `first` < --set and --seed. `first`: settings that a verb's own
// arguments stand for.
LoadedConfiguration load_configuration(const std::filesystem::path& file, std::vector<std::string> first,
                                       const WritingFlags& flags);

// The environment as far as it is for a verb with `options`: what only other verbs know (one environment serves a whole
// deployment) is left out; what none knows stays, so that loading refuses it.
std::vector<std::pair<std::string, std::string>> environment_for(const OptionFields& options);

// --map of run and slam: `maps` of the configuration, by paths relative to where the program was started; after those
// of its file.
void add_start_flag(CLI::App& verb, std::vector<std::filesystem::path>& maps);
void begin_with(const std::vector<std::filesystem::path>& maps, runtime::RunConfiguration&);

// Prints the report of what was written to `out`; returns its exit code.
ExitCode report_result(const runtime::Report&, const std::filesystem::path& out, bool json);

}  // namespace mapweave::app
