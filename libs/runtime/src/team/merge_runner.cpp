#include "given_maps.h"
#include "kept_requests.h"
#include "results/results.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/renamed_options.h>
#include <mapweave/runtime/map_input.h>
#include <mapweave/runtime/map_names.h>
#include <mapweave/runtime/merge_runner.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <tuple>

namespace mapweave::runtime {
namespace {

struct Inputs {
  std::vector<Map> maps;
  std::vector<GivenMap> given;  // in that order
  std::vector<InputFile> files;
  std::vector<std::string> notes;
  std::vector<KeptRequests> kept;          // of each team's store
  std::set<Hash> vetoed;                   // of journals
  std::map<MapId, std::string> cut_short;  // where an interruption ended the log of a map
};

struct NamedInput {
  std::filesystem::path path;
  MapId name;  // of the file
  MapInput content;
  std::string given_as;               // as people call it: of a folder of results that one's name
  std::vector<MapId> held = {};       // its maps, as they are called here
  std::optional<GivenMap> team = {};  // where it holds the robots' own maps
};

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

// Where a team's map has the nodes of the robots' own maps that it was made of, first of the one by which it got its
// frame.
GivenMap given_team(const NamedInput& input, const std::function<MapId(const MapId&)>& renamed) {
  GivenMap given{input.given_as, input.content.identity, {}};
  const MapId first = frame_kept_by(input.content.metadata);
  for (const Map& own : input.content.members) {
    GivenMap::Member member{renamed(own.id), {}};
    std::size_t place = 0;
    for (const auto& [id, node] : own.nodes) {
      if (const Node* in_team = input.content.maps.front().nodes.find(id))
        member.poses.emplace_back(place, in_team->map_from_node);
      ++place;
    }
    given.members.insert(own.id == first ? given.members.begin() : given.members.end(), std::move(member));
  }
  return given;
}

// What its store says of a map whose log an interruption cut short goes on with the map.
void take_cut_short(const MapInput& content, const std::string& key, const MapId& id, Inputs& inputs) {
  if (const auto found = content.metadata.find(key); found != content.metadata.end())
    inputs.cut_short[id] = found->second;
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
    if (input.content.members.empty()) continue;
    if (input.content.maps.size() == 1) input.team = given_team(input, renamed);
    inputs.kept.push_back(runtime::renamed(kept_in(input.content.metadata, input.path.string()), renamed));
    for (Map& member : input.content.members) {
      take_cut_short(input.content, cut_short_key(member.id), renamed(member.id), inputs);
      member.id = renamed(member.id);
      input.held.push_back(member.id);
      inputs.maps.push_back(std::move(member));
    }
  }
}

// In the order in which maps were given, of what was not left out. Maps of robots that got other names have the order
// of their nodes.
std::vector<GivenMap> given_in_order(std::vector<NamedInput>& read, const std::vector<Map>& maps) {
  std::vector<GivenMap> given;
  for (NamedInput& input : read) {
    if (input.team) {
      given.push_back(std::move(*input.team));
      continue;
    }
    for (const MapId& id : input.held) {
      const auto map = std::find_if(maps.begin(), maps.end(), [&](const Map& one) { return one.id == id; });
      if (map != maps.end()) given.push_back(given_map(*map, id.str(), input.content.identity));
    }
  }
  return given;
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
  std::vector<std::string> given_as;
  std::vector<std::filesystem::path> paths;
  for (const GivenPath& one : with_teams_of_results(given)) {
    paths.push_back(one.path);
    given_as.push_back(one.given_as);
  }
  const std::vector<MapId> names = names_of(paths);
  std::vector<NamedInput> read;
  for (std::size_t i = 0; i < paths.size(); ++i)
    read.push_back(
        {paths[i], names[i], read_map_input(paths[i], names[i]), given_as[i].empty() ? names[i].str() : given_as[i]});
  for (NamedInput& input : read) {
    inputs.notes.insert(inputs.notes.end(), input.content.notes.begin(), input.content.notes.end());
    for (const std::filesystem::path& file : input.content.files)
      inputs.files.push_back({file.string(), hash_of_file(file)});
    inputs.vetoed.insert(input.content.vetoed.begin(), input.content.vetoed.end());
    if (!input.content.members.empty()) continue;
    expect_one_robot_each(input, requests);
    std::vector<Map>& maps = input.content.maps;
    for (Map& map : maps) {
      map.id = maps.size() == 1 ? input.name : MapId(input.name.str() + "." + map.id.str());
      take_cut_short(input.content, kCutShortKey, map.id, inputs);
      input.held.push_back(map.id);
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
  for (const Map& map : inputs.maps)
    if (const auto found = inputs.cut_short.find(map.id); found != inputs.cut_short.end())
      inputs.notes.push_back(map.id.str() + ": its log was cut short by an interruption, " + found->second);
  inputs.maps = with_robots_apart(std::move(inputs.maps), inputs.notes);
  inputs.given = given_in_order(read, inputs.maps);
  return inputs;
}

MergeRequests refused_by(const TeamMapOptions& team, const Origins& origins) {
  MergeRequests requests;
  for (std::size_t i = 0; i < team.refuse.size(); ++i)
    requests.refused.push_back(
        parse_pair(team.refuse[i], {ErrorCode::kBadInput, origins.place_of("team.refuse." + std::to_string(i))}));
  return requests;
}

// Those that say nothing. Where maps stay apart by one veto, places of theirs that others name are not looked at.
void note_vetoes(const std::set<Hash>& vetoed, const KeptRequests& said, const fusion::FusionResult& team,
                 std::vector<std::string>& notes) {
  if (std::any_of(team.verdicts.begin(), team.verdicts.end(),
                  [](const Verdict& verdict) { return verdict.reason == Reason::vetoed; }))
    return;
  for (const Hash& id : vetoed)
    if (said.vetoed.count(id) == 0)
      notes.push_back("judgement " + to_hex(id) +
                      " is none of these maps: its veto (--veto) changes nothing; take it from `witnesses` in "
                      "merges.json of a merge of the same maps");
}

FrameRequest frame_request(const std::string& text, const Inputs& inputs) {
  return parse_frame(text, with_names_of(inputs.given, inputs.maps), {ErrorCode::kUsage, "--frame"});
}

}  // namespace

Report run_merge(const RunConfiguration& given, const std::vector<std::filesystem::path>& paths,
                 const MergeSettings& settings, WorkerPool& pool, Progress& progress) {
  RunConfiguration configuration = given;
  Results results(settings.out, settings.force, configuration, pool, progress);
  Inputs inputs = read_inputs(paths, settings.requests);
  if (settings.forget_requests) {
    inputs.kept.clear();
    inputs.vetoed.clear();
  }
  Report report;
  report.notes = inputs.notes;
  apply_options(inputs.kept, settings.origins, configuration, report.notes);

  const FrameChoice frame{frame_request(configuration.team.frame, inputs), inputs.given};

  fusion::FusionInput input;
  input.by = cloud_tier();
  input.maps = inputs.maps;
  apply(settings.requests, input);
  apply(refused_by(configuration.team, settings.origins), input, "team.refuse");
  input.vetoed.insert(inputs.vetoed.begin(), inputs.vetoed.end());
  for (const KeptRequests& kept : inputs.kept) {
    apply(kept, input, report.notes);
    note_vocabulary(kept, configuration.fusion, report.notes);
  }
  // What is said counts the same in any order.
  std::sort(input.priors.begin(), input.priors.end(),
            [](const auto& l, const auto& r) { return std::tie(l.a, l.b) < std::tie(r.a, r.b); });
  input.early_end = std::make_shared<std::atomic<bool>>(false);
  fusion::Memo memo;
  const auto interrupted_early = [&] {
    return Interrupted("interrupted while " + std::to_string(input.maps.size()) +
                       " maps were compared: nothing was written; the maps given, and what is in " +
                       settings.out.string() + ", are as they were");
  };
  fusion::FusionResult team;
  try {
    team = fusion::fuse(input, configuration.fusion, memo, pool, progress);
  } catch (const Interrupted&) {
    throw interrupted_early();
  }
  if (*input.early_end) {
    if (team.components.size() == input.maps.size()) throw interrupted_early();
    report.interrupted = true;
    report.notes.push_back(
        "an interruption ended the comparison of maps early: what was found until then decides, and maps that stay "
        "apart may belong together; merge again to compare the rest");
  }

  results.set_cut_short(inputs.cut_short);
  for (const Map& map : inputs.maps)
    results.add_map("robots/" + map.id.str(), "map " + map.id.str(), MapOf::robot, map);
  std::vector<const Map*> own_maps;
  for (const Map& map : inputs.maps) own_maps.push_back(&map);
  const std::vector<TeamFrame> frames = choose_frames(frame, own_maps, team);
  report.team = Results::report_of(cloud_tier(), team, frames);
  results.set_own_maps(own_maps);
  KeptRequests said = kept_requests(input, configuration.fusion);
  said.vetoed = vetoes_of(input.vetoed, own_maps, team);
  note_vetoes(settings.requests.vetoed, said, team, report.notes);
  results.set_requests(std::move(said));
  results.add_components(team_place(frames), team, {}, report);
  results.commit("merge", configuration, inputs.files, report);
  return report;
}

}  // namespace mapweave::runtime
