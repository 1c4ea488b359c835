#include "results.h"

#include <mapweave/runtime/map_input.h>
#include <mapweave/runtime/map_names.h>
#include <mapweave/runtime/merge_runner.h>

#include <algorithm>

namespace mapweave::runtime {
namespace {

struct Inputs {
  std::vector<Map> maps;
  std::vector<InputFile> files;
  std::vector<std::string> notes;
};

void read_input(const std::filesystem::path& path, MapId name, Inputs& inputs) {
  MapInput input = read_map_input(path, name);
  for (Map& map : input.maps) {
    map.id = input.maps.size() == 1 ? name : MapId(name.str() + "." + map.id.str());
    inputs.maps.push_back(std::move(map));
  }
  if (name.str() != name_of_file(path)) inputs.notes.push_back(path.string() + " is called '" + name.str() + "' here");
  for (const std::filesystem::path& file : input.files) inputs.files.push_back({file.string(), hash_of_file(file)});
}

Inputs read_inputs(const std::vector<std::filesystem::path>& paths) {
  Inputs inputs;
  const std::vector<MapId> names = names_of(paths);
  for (std::size_t i = 0; i < paths.size(); ++i) read_input(paths[i], names[i], inputs);
  inputs.maps = with_robots_apart(std::move(inputs.maps), inputs.notes);
  std::sort(inputs.files.begin(), inputs.files.end(), [](const InputFile& a, const InputFile& b) { return a.path < b.path; });
  return inputs;
}

}  // namespace

Report run_merge(const RunConfiguration& configuration, const std::vector<std::filesystem::path>& paths, const MergeSettings& settings,
                 WorkerPool& pool, Progress& progress) {
  Results results(settings.out, settings.force, configuration, pool, progress);
  const Inputs inputs = read_inputs(paths);
  Report report;
  report.notes = inputs.notes;

  fusion::FusionInput input;
  input.by = cloud_tier();
  input.maps = inputs.maps;
  fusion::Memo memo;
  const fusion::FusionResult team = fusion::fuse(input, configuration.fusion, memo, pool, progress);
  report.team = Results::report_of(cloud_tier(), team);

  for (const Map& map : inputs.maps) results.add_map("robots/" + map.id.str(), "map " + map.id.str(), map);
  results.add_components(cloud_tier(), "team", "team-", "team", true, team, {}, report);
  results.commit("merge", configuration, inputs.files, report);
  return report;
}

}  // namespace mapweave::runtime
