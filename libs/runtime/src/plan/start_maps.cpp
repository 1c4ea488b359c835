#include "start_maps.h"
#include "results/results.h"
#include "results/team_trajectories.h"

#include <mapweave/core/error.h>
#include <mapweave/rig/scale.h>
#include <mapweave/runtime/map_input.h>
#include <mapweave/runtime/map_names.h>

#include <algorithm>
#include <set>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kLongestName = 64;  // is_valid_name

struct ReadSource {
  std::filesystem::path path;
  std::string name;  // as people call it
  MapInput content;
  bool is_team() const { return !content.members.empty(); }
  const std::vector<Map>& own() const { return is_team() ? content.members : content.maps; }
};

// "alpha-1" for base alpha, or the first number that is free. Takes it.
std::string take_numbered(const std::string& base, std::set<std::string>& taken) {
  for (int number = 1;; ++number) {
    const std::string ending = "-" + std::to_string(number);
    std::string name = base.substr(0, kLongestName - ending.size()) + ending;
    if (taken.insert(name).second) return name;
  }
}

// "alpha.2" of alpha: a part of its log, or a map that stayed apart.
bool is_piece_of(const std::string& map, const std::string& robot) {
  return map.size() > robot.size() && map.compare(0, robot.size(), robot) == 0 && map[robot.size()] == '.';
}

// A robot of the run keeps its name: what it mapped in sessions before is alpha-1, alpha-2 ... here. Of robots of
// several sources that share a name the first source's keeps it.
class SessionNames {
 public:
  SessionNames(const RunPlan& plan, const std::vector<ReadSource>& sources) {
    for (const PlannedRobot& robot : plan.robots)
      for (const RobotId& name : {robot.id, robot.robot()}) of_run_.insert(name.str());
    for (const std::string& name : of_run_) owners_.emplace(name, kRun);
    for (std::size_t i = 0; i < sources.size(); ++i)
      for (const Map& map : sources[i].own())
        for (const RobotId& robot : map.robots()) owners_.emplace(robot.str(), i);
    std::set<std::string> taken;
    for (const auto& entry : owners_) taken.insert(entry.first);
    for (std::size_t i = 0; i < sources.size(); ++i) name_robots(i, sources[i], taken);
    map_names_ = of_run_;
    map_names_.insert("team");
    for (std::size_t i = 0; i < sources.size(); ++i)
      for (const Map& map : sources[i].own()) name_map(i, map);
  }

  RobotId robot(std::size_t source, const RobotId& robot) const { return robots_.at({source, robot}); }
  MapId map(std::size_t source, const MapId& map) const {
    const auto found = maps_.find({source, map});
    return found == maps_.end() ? map : found->second;
  }
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  static constexpr std::size_t kRun = static_cast<std::size_t>(-1);

  void name_robots(std::size_t source, const ReadSource& read, std::set<std::string>& taken) {
    std::set<RobotId> robots;
    for (const Map& map : read.own())
      for (const RobotId& robot : map.robots()) robots.insert(robot);
    for (const RobotId& robot : robots) {
      const std::size_t owner = owners_.at(robot.str());
      if (owner == source) {
        robots_[{source, robot}] = robot;
        continue;
      }
      const std::string name = take_numbered(robot.str(), taken);
      robots_[{source, robot}] = RobotId(name);
      notes_.push_back("robot '" + robot.str() + "' of " + read.path.string() + " is called '" + name + "' here: " +
                       (owner == kRun ? "a session of that robot before this run"
                                      : "another map that the run begins with has a robot of that name"));
    }
  }

  void name_map(std::size_t source, const Map& map) {
    const std::vector<RobotId> robots = map.robots();
    std::string name = map.id.str();
    if (robots.size() == 1) {
      const std::string& robot = robots.front().str();
      if (name == robot || is_piece_of(name, robot))
        name = robots_.at({source, robots.front()}).str() + name.substr(robot.size());
    }
    const bool may_be_of_run =
        std::any_of(of_run_.begin(), of_run_.end(), [&](const std::string& robot) { return is_piece_of(name, robot); });
    if (may_be_of_run || !is_valid_name(name) || !map_names_.insert(name).second)
      name = take_numbered(name, map_names_);
    maps_[{source, map.id}] = MapId(name);
  }

  std::set<std::string> of_run_, map_names_;
  std::map<std::string, std::size_t> owners_;  // of robots' names: the first source, or the run
  std::map<std::pair<std::size_t, RobotId>, RobotId> robots_;
  std::map<std::pair<std::size_t, MapId>, MapId> maps_;
  std::vector<std::string> notes_;
};

// The maps that a robot's folder names as its start.
std::vector<std::filesystem::path> maps_of_next_run(const std::filesystem::path& file) {
  RunConfiguration configuration;
  const Origins origins = load(configuration, {{file}, {}, {}});
  if (configuration.maps.empty())
    throw Error(ErrorCode::kBadInput, "names no maps", file.string(), "name a map (.mwdb) itself");
  std::vector<std::filesystem::path> maps;
  for (const std::string& map : configuration.maps)
    maps.push_back(std::filesystem::absolute(file.parent_path() / map).lexically_normal());
  return maps;
}

std::vector<GivenPath> all_paths(const std::vector<std::filesystem::path>& given) {
  std::vector<std::filesystem::path> paths;
  for (const std::filesystem::path& path : given) {
    std::error_code ignored;
    const std::filesystem::path next = path.filename() == kNextRun ? path : path / kNextRun;
    if (!std::filesystem::is_regular_file(next, ignored)) {
      paths.push_back(path);
      continue;
    }
    const auto named = maps_of_next_run(next);
    paths.insert(paths.end(), named.begin(), named.end());
  }
  return with_teams_of_results(paths);
}

void expect_unit(const MapInput& input, const std::filesystem::path& path) {
  for (const Map& map : input.maps)
    if (map.submaps.empty() && !rig::is_metric(map))
      throw Error(ErrorCode::kBadInput,
                  "map '" + map.id.str() +
                      "' of it is a single camera's and has no unit of length: nothing can keep "
                      "its frame",
                  path.string(), "begin with a map of a laser, a depth camera or a stereo pair; merge joins this one");
}

std::vector<ReadSource> read_sources(const std::vector<std::filesystem::path>& given) {
  std::vector<std::filesystem::path> paths;
  std::vector<ReadSource> sources;
  for (const GivenPath& one : all_paths(given)) {
    std::error_code ignored;
    const std::filesystem::path of_folder = one.path / "map.mwdb";
    paths.push_back(std::filesystem::is_regular_file(of_folder, ignored) ? of_folder : one.path);
    sources.push_back({paths.back(), one.given_as, {}});
  }
  const std::vector<MapId> names = names_of(paths);  // says what is given twice
  for (std::size_t i = 0; i < sources.size(); ++i) {
    ReadSource& source = sources[i];
    if (source.name.empty()) source.name = names[i].str();
    const std::string ending = source.path.extension().string();
    if (ending == ".yaml" || ending == ".yml")
      throw Error(ErrorCode::kBadInput, "a run does not begin with a map_server grid", source.path.string(),
                  "begin with a map store (.mwdb) or a journal (.mwj); mapweave merge joins grids");
    source.content = read_map_input(source.path, names[i]);
    expect_unit(source.content, source.path);
  }
  return sources;
}

// Where the team's map has the nodes of one of the maps that it was made of, in the order that they have by their names
// here.
GivenMap::Member given_member(const Map& own, const Map& team, std::size_t source, const SessionNames& names) {
  std::vector<std::pair<NodeId, const Node*>> places;
  for (const auto& entry : own.nodes) {
    NodeId id = entry.first;
    id.session.client.robot = names.robot(source, id.session.client.robot);
    places.emplace_back(id, team.nodes.find(entry.first));
  }
  std::sort(places.begin(), places.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
  GivenMap::Member member{names.map(source, own.id), {}};
  for (std::size_t place = 0; place < places.size(); ++place)
    if (places[place].second != nullptr) member.poses.emplace_back(place, places[place].second->map_from_node);
  return member;
}

GivenMap given_team(const ReadSource& read, std::size_t source, const SessionNames& names) {
  GivenMap given{read.name, read.content.identity, {}};
  const MapId first = frame_kept_by(read.content.metadata);
  for (const Map& own : read.content.members) {
    GivenMap::Member member = given_member(own, read.content.maps.front(), source, names);
    given.members.insert(own.id == first ? given.members.begin() : given.members.end(), std::move(member));
  }
  return given;
}

// Its maps under their names here.
void take(ReadSource& read, std::size_t source, const SessionNames& names, StartMaps& starts) {
  StartMaps::Source& kind = starts.sources.emplace_back();
  kind.path = read.path;
  if (read.is_team() && read.content.maps.size() == 1) starts.given.push_back(given_team(read, source, names));
  for (const Map& own : read.own()) {
    const MapId id = names.map(source, own.id);
    const std::string key = read.is_team() ? cut_short_key(own.id) : kCutShortKey;
    if (const auto cut = read.content.metadata.find(key); cut != read.content.metadata.end()) {
      starts.cut_short[id] = cut->second;
      starts.notes.push_back(id.str() + ": its log was cut short by an interruption, " + cut->second);
    }
    kind.has_scans = kind.has_scans || !own.submaps.empty();
    kind.has_keyframes = kind.has_keyframes || has_keyframes(own);
    starts.maps.push_back(rekeyed(own, id, [&](const RobotId& robot) { return names.robot(source, robot); }));
    if (!read.is_team() || read.content.maps.size() != 1)
      starts.given.push_back(given_map(starts.maps.back(), id.str(), read.content.identity));
  }
}

// What was said when the teams were made still holds; their options do not, since the run has its own.
void apply_kept(const std::vector<KeptRequests>& kept, const RunConfiguration& configuration, StartMaps& starts) {
  fusion::FusionInput input;
  input.maps = std::move(starts.maps);
  input.vetoed = std::move(starts.vetoed);
  const std::vector<std::string> here = kept_requests(input, configuration.fusion).options;
  for (const KeptRequests& one : kept) {
    apply(one, input, starts.notes);
    note_vocabulary(one, configuration.fusion, starts.notes);
    for (const std::string& option : one.options)
      if (std::find(here.begin(), here.end(), option) == here.end())
        starts.notes.push_back("maps that the run begins with were merged with " + option +
                               "; this run merges by its own options");
  }
  starts.maps = std::move(input.maps);
  starts.priors = std::move(input.priors);
  starts.refused = std::move(input.refused);
  starts.vetoed = std::move(input.vetoed);
}

}  // namespace

std::string next_run_text(const RobotId& robot) {
  return "# The team's map as robot " + robot.str() +
         " received it. Its next run begins with that map and has its frame:\n"
         "#   mapweave slam LOG --robot " +
         robot.str() +
         " --map THIS_FOLDER --out DIR\n"
         "# or, in the configuration of a run:  maps: [THIS_FOLDER]\n"
         "maps: [team/map.mwdb]\n";
}

StartMaps read_start_maps(const RunConfiguration& configuration, const RunPlan& plan) {
  StartMaps starts;
  std::vector<ReadSource> sources = read_sources(plan.maps);
  const SessionNames names(plan, sources);
  starts.notes = names.notes();
  std::vector<KeptRequests> kept;
  for (std::size_t i = 0; i < sources.size(); ++i) {
    for (const std::filesystem::path& file : sources[i].content.files)
      starts.files.push_back({file.string(), hash_of_file(file)});
    kept.push_back(renamed(kept_in(sources[i].content.metadata, sources[i].path.string()),
                           [&](const MapId& map) { return names.map(i, map); }));
    starts.vetoed.insert(sources[i].content.vetoed.begin(), sources[i].content.vetoed.end());
    take(sources[i], i, names, starts);
    sources[i].content = {};
  }
  std::sort(starts.maps.begin(), starts.maps.end(), [](const Map& a, const Map& b) { return a.id < b.id; });
  apply_kept(kept, configuration, starts);
  return starts;
}

void expect_same_senses(const StartMaps& starts, const RunPlan& plan) {
  bool have_scans = false, have_cameras = false;
  for (const PlannedRobot& robot : plan.robots) {
    if (robot.trouble) return;  // is said instead
    have_scans = have_scans || robot.sensors.scans != nullptr;
    have_cameras = have_cameras || !robot.sensors.cameras.empty();
  }
  for (const StartMaps::Source& source : starts.sources) {
    if ((source.has_scans && have_scans) || (source.has_keyframes && have_cameras)) continue;
    const bool is_seen = source.has_keyframes;
    throw Error(ErrorCode::kBadInput,
                is_seen ? "there is no map of a laser in it, only of cameras; the robots map with lasers"
                        : "there is no map of a camera in it, only of lasers; the robots map with cameras",
                source.path.string(),
                is_seen ? "map with cameras (sensor: cameras), or begin with a map of a laser"
                        : "map with lasers (sensor: laser), or begin with a map of a camera");
  }
}

}  // namespace mapweave::runtime
