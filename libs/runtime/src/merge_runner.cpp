#include "results.h"

#include <mapweave/exporters/map_server.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/mapdb/map_store.h>
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
  const std::string ending = path.extension().string();
  if (ending == ".yaml" || ending == ".yml") {
    inputs.maps.push_back(fusion::map_of_grid(name, exporters::read_map_server(path)));
  } else if (ending == ".mwdb") {
    mapdb::StoredMaps stored = mapdb::read_store(path);
    if (stored.maps.empty()) throw Error(ErrorCode::kBadInput, "there is no map in it", path.string(), "merge stores that hold maps");
    for (Map& map : stored.maps) {
      map.id = stored.maps.size() == 1 ? name : MapId(name.str() + "." + map.id.str());
      inputs.maps.push_back(std::move(map));
    }
  } else {
    throw Error(ErrorCode::kUsage, "neither a map store nor a map_server grid", path.string(), "give .mwdb or .yaml files");
  }
  if (name.str() != name_of_file(path)) inputs.notes.push_back(path.string() + " is called '" + name.str() + "' here");
  inputs.files.push_back({path.string(), hash_of_file(path)});
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
  Results results(settings.out, settings.force, configuration, pool);
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
  results.add_components(cloud_tier(), "team", "team-", "team", true, team, report);
  results.commit("merge", configuration, inputs.files, report);
  return report;
}

}  // namespace mapweave::runtime
