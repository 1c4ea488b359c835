#include "kept_requests.h"
#include "results.h"

#include <mapweave/core/renamed_options.h>
#include <mapweave/runtime/map_input.h>
#include <mapweave/runtime/map_names.h>
#include <mapweave/runtime/merge_runner.h>

#include <algorithm>
#include <functional>
#include <map>
#include <tuple>

namespace mapweave::runtime {
namespace {

struct Inputs {
  std::vector<Map> maps;
  std::vector<InputFile> files;
  std::vector<std::string> notes;
  std::vector<KeptRequests> kept;  // of each team's store
};

// Of a folder of results: the stores of its teams, which hold the robots' own maps.
std::vector<std::filesystem::path> with_teams_of_results(const std::vector<std::filesystem::path>& paths) {
  std::vector<std::filesystem::path> result;
  for (const std::filesystem::path& path : paths) {
    std::error_code ignored;
    if (!std::filesystem::exists(path / "team/map.mwdb", ignored)) {
      result.push_back(path);
      continue;
    }
    result.push_back(path / "team/map.mwdb");
    for (int i = 1; std::filesystem::exists(path / ("team-" + std::to_string(i)) / "map.mwdb", ignored); ++i)
      result.push_back(path / ("team-" + std::to_string(i)) / "map.mwdb");
  }
  return result;
}

struct NamedInput {
  std::filesystem::path path;
  MapId name;  // of the file
  MapInput content;
};

KeptRequests renamed_in(const KeptRequests& kept, const std::function<MapId(const MapId&)>& renamed) {
  KeptRequests result = kept;
  result.refused.clear();
  for (const auto& [a, b] : kept.refused) result.refused.insert(std::minmax(renamed(a), renamed(b)));
  for (fusion::MapPrior& prior : result.priors) {
    prior.a = renamed(prior.a);
    prior.b = renamed(prior.b);
  }
  return result;
}

// Options that all teams were made with, where they were not given anew.
void apply_options(const std::vector<KeptRequests>& kept, const Origins& origins, RunConfiguration& configuration,
                   std::vector<std::string>& notes) {
  for (const KeptRequests& one : kept)
    if (one.options != kept.front().options) {
      notes.push_back("the teams were made with different options of fusion: none of them counts here");
      return;
    }
  if (kept.empty()) return;
  for (const std::string& setting : kept.front().options) {
    if (!origins.place_of(present_key(setting.substr(0, setting.find('=')))).empty()) continue;
    try {
      load(configuration, {{}, {}, {setting}});
      notes.push_back("as before: " + setting);
    } catch (const Error& error) {
      notes.push_back("the team was made with " + setting + ", which counts no longer: " + error.problem());
    }
  }
}

// Members of teams keep their names, unless something else has the same.
void take_members(std::vector<NamedInput>& read, Inputs& inputs) {
  std::map<MapId, int> holders;
  for (const NamedInput& input : read) {
    if (input.content.members.empty()) ++holders[input.name];
    for (const Map& member : input.content.members) ++holders[member.id];
  }
  for (NamedInput& input : read) {
    const auto renamed = [&](const MapId& id) {
      return holders[id] > 1 ? MapId(input.name.str() + "." + id.str()) : id;
    };
    if (!input.content.members.empty())
      inputs.kept.push_back(renamed_in(kept_in(input.content.metadata, input.path.string()), renamed));
    for (Map& member : input.content.members) {
      member.id = renamed(member.id);
      inputs.maps.push_back(std::move(member));
    }
  }
}

void expect_one_robot_each(const NamedInput& input, const MergeRequests& requests) {
  const auto is_left_out = [&](const RobotId& robot) {
    return std::find(requests.without.begin(), requests.without.end(), robot.str()) != requests.without.end();
  };
  for (const Map& map : input.content.maps)
    if (const auto robots = map.robots(); robots.size() > 1 && std::any_of(robots.begin(), robots.end(), is_left_out))
      throw Error(ErrorCode::kBadInput, "this team map does not hold its robots' own maps", input.path.string(),
                  "give the robots' own maps (robots/*/map.mwdb of the same results), or make the team again with this "
                  "version");
}

Inputs read_inputs(const std::vector<std::filesystem::path>& given, const MergeRequests& requests) {
  Inputs inputs;
  const std::vector<std::filesystem::path> paths = with_teams_of_results(given);
  const std::vector<MapId> names = names_of(paths);
  std::vector<NamedInput> read;
  for (std::size_t i = 0; i < paths.size(); ++i)
    read.push_back({paths[i], names[i], read_map_input(paths[i], names[i])});
  for (NamedInput& input : read) {
    inputs.notes.insert(inputs.notes.end(), input.content.notes.begin(), input.content.notes.end());
    for (const std::filesystem::path& file : input.content.files)
      inputs.files.push_back({file.string(), hash_of_file(file)});
    if (!input.content.members.empty()) continue;
    expect_one_robot_each(input, requests);
    std::vector<Map>& maps = input.content.maps;
    for (Map& map : maps) {
      map.id = maps.size() == 1 ? input.name : MapId(input.name.str() + "." + map.id.str());
      inputs.maps.push_back(std::move(map));
    }
    if (input.name.str() != name_of_file(input.path))
      inputs.notes.push_back(input.path.string() + " is called '" + input.name.str() + "' here");
  }
  take_members(read, inputs);
  const std::size_t count = inputs.maps.size();
  inputs.maps = without(std::move(inputs.maps), requests.without);
  if (inputs.maps.size() < count) {
    std::string left_out;
    for (const std::string& name : requests.without) left_out += (left_out.empty() ? "" : ", ") + name;
    inputs.notes.push_back("left out: " + left_out);
  }
  inputs.maps = with_robots_apart(std::move(inputs.maps), inputs.notes);
  std::sort(inputs.files.begin(), inputs.files.end(),
            [](const InputFile& a, const InputFile& b) { return a.path < b.path; });
  return inputs;
}

}  // namespace

Report run_merge(const RunConfiguration& given, const std::vector<std::filesystem::path>& paths,
                 const MergeSettings& settings, WorkerPool& pool, Progress& progress) {
  RunConfiguration configuration = given;
  Results results(settings.out, settings.force, configuration, pool, progress);
  Inputs inputs = read_inputs(paths, settings.requests);
  if (settings.forget_requests) inputs.kept.clear();
  Report report;
  report.notes = inputs.notes;
  apply_options(inputs.kept, settings.origins, configuration, report.notes);

  fusion::FusionInput input;
  input.by = cloud_tier();
  input.maps = inputs.maps;
  apply(settings.requests, input);
  for (const KeptRequests& kept : inputs.kept) {
    apply(kept, input, report.notes);
    note_vocabulary(kept, configuration.fusion, report.notes);
  }
  // What is said counts the same in any order.
  std::sort(input.priors.begin(), input.priors.end(),
            [](const auto& l, const auto& r) { return std::tie(l.a, l.b) < std::tie(r.a, r.b); });
  fusion::Memo memo;
  const fusion::FusionResult team = fusion::fuse(input, configuration.fusion, memo, pool, progress);
  report.team = Results::report_of(cloud_tier(), team);

  for (const Map& map : inputs.maps) results.add_map("robots/" + map.id.str(), "map " + map.id.str(), map);
  std::vector<const Map*> own_maps;
  for (const Map& map : inputs.maps) own_maps.push_back(&map);
  results.set_own_maps(own_maps);
  results.set_requests(kept_requests(input, configuration.fusion));
  results.add_components(team_place(), team, {}, report);
  results.commit("merge", configuration, inputs.files, report);
  return report;
}

}  // namespace mapweave::runtime
