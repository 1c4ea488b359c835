#include "configuration.h"

#include <nlohmann/json.hpp>

#include <iostream>

namespace mapweave::app {

LoadedConfiguration load_configuration(const std::filesystem::path& file, std::vector<std::string> first, const WritingFlags& flags) {
  ConfigurationSources sources;
  if (!file.empty()) sources.files.push_back(file);
  sources.environment = process_environment();
  sources.settings = std::move(first);
  sources.settings.insert(sources.settings.end(), flags.set.begin(), flags.set.end());
  if (flags.seed) sources.settings.push_back("seed=" + std::to_string(*flags.seed));
  LoadedConfiguration loaded;
  loaded.origins = load(loaded.configuration, sources);
  return loaded;
}

int tell(const runtime::Report& report, const std::filesystem::path& out, bool json) {
  if (json)
    std::cout << runtime::summary_json(report).dump(2) << '\n';
  else
    std::cout << runtime::in_words(report, out.string());
  return report.exit_code();
}

}  // namespace mapweave::app
