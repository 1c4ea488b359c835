#include "configuration.h"

#include <mapweave/core/renamed_options.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/simulation/world_options.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cctype>
#include <iostream>

namespace mapweave::app {

LoadedConfiguration load_configuration(const std::filesystem::path& file, std::vector<std::string> first,
                                       const WritingFlags& flags) {
  LoadedConfiguration loaded;
  ConfigurationSources sources;
  if (!file.empty()) sources.files.push_back(file);
  sources.environment = environment_for(fields_of(loaded.configuration));
  sources.settings = std::move(first);
  sources.settings.insert(sources.settings.end(), flags.set.begin(), flags.set.end());
  if (flags.seed) sources.settings.push_back("seed=" + std::to_string(*flags.seed));
  loaded.origins = load(loaded.configuration, sources);
  runtime::complete_starts(loaded.configuration, loaded.origins);
  runtime::read_vocabulary(loaded.configuration, loaded.origins);
  loaded.configuration.fusion.laser_cameras = loaded.configuration.laser_cameras;  // teams weigh cameras as robots do
  return loaded;
}

std::vector<std::pair<std::string, std::string>> environment_for(const OptionFields& options) {
  static constexpr std::string_view kPrefix = "MAPWEAVE_";
  const auto has = [](const OptionFields& fields, const std::string& name) {
    return std::any_of(fields.begin(), fields.end(), [&](const Option& option) { return option.name == name; });
  };
  runtime::RunConfiguration run;
  simulation::WorldOptions world;
  const OptionFields of_run = fields_of(run), of_world = fields_of(world);
  auto variables = process_environment();
  const auto is_for_others = [&](const std::pair<std::string, std::string>& variable) {
    if (variable.first.compare(0, kPrefix.size(), kPrefix) != 0) return false;
    std::string name = variable.first.substr(kPrefix.size(), variable.first.find("__") - kPrefix.size());
    std::transform(name.begin(), name.end(), name.begin(),
                   [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
    name = present_key(name);
    return !has(options, name) && (has(of_run, name) || has(of_world, name));
  };
  variables.erase(std::remove_if(variables.begin(), variables.end(), is_for_others), variables.end());
  return variables;
}

void add_start_flag(CLI::App& verb, std::vector<std::filesystem::path>& maps) {
  verb.add_option(
          "--map", maps,
          "begin with this map of a session before: a map.mwdb, a camera map server's journal (.mwj) or a folder of "
          "results; the new map joins it and has the frame of the first one; repeatable")
      ->type_name("MAP.mwdb|MAP.mwj|DIR")
      ->allow_extra_args(false);
}

void begin_with(const std::vector<std::filesystem::path>& maps, runtime::RunConfiguration& configuration) {
  for (const std::filesystem::path& map : maps)
    configuration.maps.push_back(std::filesystem::absolute(map).lexically_normal().string());
}

ExitCode report_result(const runtime::Report& report, const std::filesystem::path& out, bool json) {
  if (json)
    std::cout << runtime::json_text(runtime::summary_json(report)) << '\n';
  else
    std::cout << runtime::in_words(report, out.string());
  return report.exit_code();
}

}  // namespace mapweave::app
