#include <mapweave/runtime/run_configuration.h>

#include "refused_robots.h"

#include <mapweave/core/error.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/runtime/team_frame.h>
#include <mapweave/scheduling/latency_model.h>

#include <algorithm>
#include <cctype>
#include <map>
#include <set>

namespace mapweave::runtime {
namespace {

std::string key(const char* list, std::size_t index, const char* field) {
  return std::string(list) + "." + std::to_string(index) + "." + field;
}

std::string name_of(const RobotEntry& robot) { return robot.id.empty() ? name_of_file(robot.log) : robot.id; }

void expect_name(const std::string& name, const std::string& what, const std::string& where) {
  if (!is_valid_name(name))
    throw Error(ErrorCode::kBadInput, what + " '" + name + "' cannot be a name", where,
                "use 1 to 64 letters, digits, '_', '-' and '.', not '.' first");
}

// The names of all edges; those under `edges` come first in the order of robots without one.
std::vector<std::string> edge_names(const RunConfiguration& configuration, const Origins& origins) {
  std::vector<std::string> listed;
  for (std::size_t i = 0; i < configuration.edges.size(); ++i) {
    const std::string& id = configuration.edges[i].id;
    const std::string where = origins.place_of(key("edges", i, "id"));
    expect_name(id, "edge", where);
    if (id == cloud_tier().str())
      throw Error(ErrorCode::kBadInput, "'" + id + "' is the tier above all edges", where,
                  "give the edge another name");
    if (std::find(listed.begin(), listed.end(), id) != listed.end())
      throw Error(ErrorCode::kBadInput, "two edges are called '" + id + "'", where, "remove one of them");
    listed.push_back(id);
  }
  if (!listed.empty()) return listed;
  std::set<std::string> named;
  for (const RobotEntry& robot : configuration.robots) {
    if (!robot.edge.empty()) named.insert(robot.edge);
    named.insert(robot.edges.begin(), robot.edges.end());
  }
  if (named.empty()) named.insert("edge");
  return {named.begin(), named.end()};
}

// Where edges are listed, a robot's edge that is not among them is a slip of the pen.
void expect_listed(const std::string& edge, const std::vector<EdgeEntry>& edges, const std::string& where) {
  std::vector<std::string> names;
  for (const EdgeEntry& entry : edges) names.push_back(entry.id);
  if (names.empty() || std::find(names.begin(), names.end(), edge) != names.end()) return;
  const auto nearest = nearest_name(edge, names);
  throw Error(ErrorCode::kBadInput, "edge '" + edge + "' is not among the edges", where,
              nearest ? "did you mean '" + *nearest + "'?" : "list it: edges: [{id: " + edge + "}]");
}

void expect_edge(const std::string& edge, const RunConfiguration& configuration, const std::string& where) {
  expect_name(edge, "edge", where);
  if (edge == cloud_tier().str())
    throw Error(ErrorCode::kBadInput, "'" + edge + "' is the tier above all edges", where,
                "give the edge another name");
  expect_listed(edge, configuration.edges, where);
}

// Partial offloading: edges that map parts of one robot's log.
void expect_edges_of(const RobotEntry& robot, const RunConfiguration& configuration, const std::string& key_of_edges,
                     const Origins& origins) {
  if (robot.edges.empty()) return;
  const std::string where = origins.place_of(key_of_edges);
  for (std::size_t i = 0; i < robot.edges.size(); ++i)
    expect_edge(robot.edges[i], configuration, origins.place_of(key_of_edges + "." + std::to_string(i)));
  if (!robot.edge.empty())
    throw Error(ErrorCode::kBadInput, "robot '" + name_of(robot) + "' has both `edge` and `edges`", where,
                "leave out one of them");
  if (configuration.coordinator.method)
    throw Error(ErrorCode::kBadInput, "a coordinator gives each robot one edge", where,
                "leave out the robot's `edges`, or the coordinator");
  if (configuration.mode != Mode::offload && robot.edges.size() > 1)
    throw Error(ErrorCode::kBadInput,
                "several edges map a robot's data only in mode offload; here the robot maps itself", where,
                "leave out the robot's `edges`, or set mode: offload");
}

std::string listed(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

// Throws Error kBadInput for a name that is none of them.
void expect_known(const std::string& name, const std::vector<std::string>& known, const std::string& what,
                  const std::string& where, const std::string& remedy) {
  if (std::find(known.begin(), known.end(), name) != known.end()) return;
  const auto nearest = nearest_name(name, known);
  throw Error(ErrorCode::kBadInput, "unknown " + what + " '" + name + "'; the configuration has: " + listed(known),
              where, nearest ? "did you mean '" + *nearest + "'?" : remedy);
}

std::vector<std::string> names_of(const std::vector<TierId>& edges) {
  std::vector<std::string> names;
  for (const TierId& edge : edges) names.push_back(edge.str());
  return names;
}

constexpr double kSlowestLink_bytes_per_s = 1e-3;

// A log is read several times.
void expect_log(const std::filesystem::path& log, const std::string& where, bool is_of_file) {
  std::error_code problem;
  const auto status = std::filesystem::status(log, problem);
  if (std::filesystem::is_regular_file(status) || std::filesystem::is_directory(status)) return;
  if (status.type() == std::filesystem::file_type::not_found)
    throw Error(ErrorCode::kMissing, "there is no log " + log.string(), where,
                is_of_file ? "paths are relative to the configuration file" : "check its path");
  if (problem)
    throw Error(ErrorCode::kMissing, "the log " + log.string() + " cannot be read: " + problem.message(), where,
                "check its path and its permissions");
  throw Error(ErrorCode::kBadInput, "the log " + log.string() + " is a pipe or a device; a file was expected", where,
              "save it to a file first: it is read more than once");
}

// As they are listed, and their parts.
std::vector<std::string> names_with_parts(const RunPlan& plan) {
  std::set<std::string> names;
  for (const PlannedRobot& robot : plan.robots) names.insert({robot.id.str(), robot.robot().str()});
  return {names.begin(), names.end()};
}

// Each part of a robot's log has the wires of the robot, unless it has its own.
void add_links_of_parts(const RunPlan& plan, std::vector<LinkEntry>& links) {
  const auto is_named = [&](const std::string& from, const std::string& to) {
    return std::any_of(links.begin(), links.end(),
                       [&](const LinkEntry& link) { return link.from == from && link.to == to; });
  };
  for (const PlannedRobot& robot : plan.robots) {
    if (!robot.part) continue;
    const std::vector<LinkEntry> named = links;
    for (LinkEntry link : named) {
      if (link.from != robot.part->robot.str() || is_named(robot.id.str(), link.to)) continue;
      link.from = robot.id.str();
      links.push_back(link);
    }
  }
}

// Wires between those that there are, with traces by their full paths.
NetworkOptions network_of(NetworkOptions network, const RunPlan& plan, const Origins& origins) {
  const std::vector<std::string> robots = names_with_parts(plan);
  std::vector<std::string> tiers = names_of(plan.edges);
  tiers.push_back(cloud_tier().str());
  std::vector<std::string> all = robots;
  all.insert(all.end(), tiers.begin(), tiers.end());
  const auto locate = [&](transport::LinkModelOptions& link, const std::string& where) {
    if (link.bytes_per_s > 0.0 && link.bytes_per_s < kSlowestLink_bytes_per_s)
      throw Error(ErrorCode::kBadInput, "so slow a link never delivers anything",
                  origins.place_of(where + ".bytes_per_s"), "give bytes per second, or 0 for those of the profile");
    if (link.trace.empty()) return;
    const auto path =
        std::filesystem::absolute(origins.file_of(where + ".trace").parent_path() / link.trace).lexically_normal();
    link.trace = path.string();
    transport::LinkModel(link, 0);  // says now what is wrong with it
  };
  locate(network.robot_edge, "network.robot_edge");
  locate(network.robot_cloud, "network.robot_cloud");
  locate(network.edge_cloud, "network.edge_cloud");
  for (std::size_t i = 0; i < network.links.size(); ++i) {
    const std::string where = "network.links." + std::to_string(i);
    const std::string &from = network.links[i].from, &to = network.links[i].to;
    expect_known(from, all, "robot or edge", origins.place_of(where + ".from"), "name a robot or an edge of this run");
    const bool is_of_robot = std::find(robots.begin(), robots.end(), from) != robots.end();
    expect_known(to, is_of_robot ? tiers : all, "robot or edge", origins.place_of(where + ".to"),
                 "name an edge of this run, or cloud");
    locate(network.links[i], where);
  }
  add_links_of_parts(plan, network.links);
  return network;
}

// Who merges, coordinates and receives the team's map, and whether edges can hold everyone.
void expect_tiers(const RunConfiguration& configuration, const RunPlan& plan, const Origins& origins) {
  const std::vector<std::string> edges = names_of(plan.edges), robots = names_with_parts(plan);
  const auto expect_edge = [&](const std::string& name, const std::string& key) {
    if (name.empty()) return;
    expect_known(name, edges, "edge", origins.place_of(key), "name an edge of this run, or leave it empty");
    if (edge_entry(configuration, TierId(name)).until_s > 0.0)
      throw Error(ErrorCode::kBadInput, key + " names edge '" + name + "', which goes before the end (until_s)",
                  origins.place_of(key), "name an edge that stays, or leave it empty");
  };
  expect_edge(configuration.cloud.at, "cloud.at");
  expect_edge(configuration.coordinator.at, "coordinator.at");
  for (std::size_t i = 0; i < configuration.cloud.push_to.size(); ++i)
    expect_known(configuration.cloud.push_to[i], robots, "robot",
                 origins.place_of("cloud.push_to." + std::to_string(i)), "name a robot of this run");
  if (configuration.coordinator.method && configuration.mode == Mode::cloud_only)
    throw Error(ErrorCode::kBadInput, "a coordinator gives robots to edges, and mode cloud-only has none",
                origins.place_of("coordinator.method"), "leave out one of them");
  constexpr double kShortestRound_s = 0.1;  // about a scan
  if (const double period_s = configuration.cloud.rounds.period_s; period_s > 0.0 && period_s < kShortestRound_s)
    throw Error(ErrorCode::kBadInput, "rounds come faster than scans", origins.place_of("cloud.rounds.period_s"),
                "give at least 0.1 seconds, or 0 for none");
  std::uint64_t room = 0;
  for (std::size_t i = 0; i < plan.edges.size(); ++i) {
    const EdgeEntry entry = edge_entry(configuration, plan.edges[i]);
    room += entry.capacity == 0 ? plan.robots.size() : static_cast<std::uint64_t>(entry.capacity);
    if (entry.until_s > 0.0 && entry.until_s <= entry.from_s)
      throw Error(ErrorCode::kBadInput, "edge '" + entry.id + "' goes before it comes", origins.place_of("edges"),
                  "let until_s be later than from_s, or 0 where it stays");
    if (configuration.coordinator.method) continue;
    std::uint64_t robots_there = 0;
    for (const PlannedRobot& robot : plan.robots) robots_there += robot.edge == plan.edges[i];
    if (entry.capacity > 0 && robots_there > static_cast<std::uint64_t>(entry.capacity))
      throw Error(ErrorCode::kBadInput,
                  "edge '" + entry.id + "' takes " + std::to_string(entry.capacity) + " robots, and " +
                      std::to_string(robots_there) + " use it",
                  origins.place_of("edges"),
                  "raise its capacity, or let a coordinator place robots: coordinator: {method: default}");
  }
  if (room < plan.robots.size())
    throw Error(
        ErrorCode::kBadInput,
        "the edges' capacities hold " + std::to_string(room) + " of " + std::to_string(plan.robots.size()) + " robots",
        origins.place_of("edges"), "raise capacities, or add an edge");
}

}  // namespace

TierId cloud_tier() { return TierId("cloud"); }

namespace {

// Null where the entry says nothing for its robot alone.
std::shared_ptr<const RunConfiguration> own_configuration(const RunConfiguration& configuration,
                                                          const RobotEntry& robot) {
  if (robot.own.empty()) return nullptr;
  for (const OptionSetting& setting : robot.own)
    if (setting.key == "visual.vocabulary") {
      const auto other = std::find_if(configuration.robots.begin(), configuration.robots.end(),
                                      [&](const RobotEntry& one) { return name_of(one) != name_of(robot); });
      throw Error(
          ErrorCode::kBadInput,
          "robot '" + name_of(robot) + "' has a vocabulary of its own" +
              (other == configuration.robots.end() ? ""
                                                   : ", by which robot '" + name_of(*other) + "' does not know places"),
          setting.place, "cameras of a team share their words: set visual.vocabulary for all");
    }
  auto own = std::make_shared<RunConfiguration>(configuration);
  override_options(*own, robot.own);
  return own;
}

// By their full paths; reading them says what else is wrong.
std::vector<std::filesystem::path> start_maps_of(const RunConfiguration& configuration, const Origins& origins,
                                                 LogsAre logs) {
  std::vector<std::filesystem::path> paths;
  for (std::size_t i = 0; i < configuration.maps.size(); ++i) {
    const std::filesystem::path given = configuration.maps[i];
    const std::string map_key = "maps." + std::to_string(i);
    const std::string where = given.is_absolute() ? "" : origins.place_of(map_key);
    const std::filesystem::path folder = origins.file_of(map_key).parent_path();
    paths.push_back(std::filesystem::absolute(folder / given).lexically_normal());
    std::error_code ignored;
    if (given.empty() || (logs == LogsAre::here && !std::filesystem::exists(paths.back(), ignored)))
      throw Error(
          ErrorCode::kMissing, "there is no map " + paths.back().string(), where,
          given.is_absolute() || folder.empty() ? "check its path" : "paths are relative to the configuration file");
  }
  return paths;
}

// And says now what is wrong with the frame; of a run that begins with maps, these have names too.
void take_start_maps(const RunConfiguration& configuration, const Origins& origins, LogsAre logs, RunPlan& plan) {
  plan.maps = start_maps_of(configuration, origins, logs);
  if (plan.maps.empty())
    parse_frame(configuration.team.frame, names_with_parts(plan),
                {ErrorCode::kBadInput, origins.place_of("team.frame")});
}

}  // namespace

RunPlan make_plan(const RunConfiguration& configuration, const Origins& origins, LogsAre logs) {
  if (configuration.robots.empty())
    throw Error(ErrorCode::kBadInput, "no robots", origins.place_of("robots"),
                "list them: robots: [{id: alpha, log: alpha.rawlog}]");
  RunPlan plan;
  std::map<std::string, std::size_t> seen;  // id -> its place in the list
  std::set<std::string> parts;
  for (std::size_t i = 0; i < configuration.robots.size(); ++i) {
    const RobotEntry& robot = configuration.robots[i];
    const std::string where = origins.place_of(key("robots", i, "id")), log_key = key("robots", i, "log");
    if (robot.log.empty())
      throw Error(ErrorCode::kMissing, "a robot without a log", origins.place_of(log_key), "add: log: FILE.rawlog");
    const std::string id = name_of(robot);
    expect_name(id, "robot", where);
    if (const auto [other, is_new] = seen.emplace(id, i); !is_new)
      throw Error(ErrorCode::kBadInput,
                  "two robots are called '" + id + "'; the other one is at " +
                      origins.place_of(key("robots", other->second, "id")),
                  where, "give one of them another id");
    if (!robot.edge.empty()) expect_edge(robot.edge, configuration, origins.place_of(key("robots", i, "edge")));
    expect_edges_of(robot, configuration, key("robots", i, "edges"), origins);
    const std::filesystem::path log =
        std::filesystem::absolute(origins.file_of(log_key).parent_path() / robot.log).lexically_normal();
    if (logs == LogsAre::here) expect_log(log, origins.place_of(log_key), !origins.file_of(log_key).empty());
    const auto own = own_configuration(configuration, robot);
    if (robot.edges.size() < 2) {
      plan.robots.push_back({RobotId(id), TierId(robot.edges.empty() ? robot.edge : robot.edges.front()), log});
      plan.robots.back().configuration = own;
      continue;
    }
    for (std::size_t part = 1; part <= robot.edges.size(); ++part) {
      const std::string name = id + "." + std::to_string(part);
      expect_name(name, "robot", where);
      parts.insert(name);
      plan.robots.push_back({RobotId(name),
                             TierId(robot.edges[part - 1]),
                             log,
                             {},
                             {},
                             LogPart{RobotId(id), part, robot.edges.size()},
                             own});
    }
  }
  for (const std::string& part : parts)
    if (const auto robot = seen.find(part); robot != seen.end())
      throw Error(ErrorCode::kBadInput,
                  "robot '" + part + "' is called as a part of another robot, which has several edges",
                  origins.place_of(key("robots", robot->second, "id")), "give it another id");
  std::sort(plan.robots.begin(), plan.robots.end(),
            [](const PlannedRobot& a, const PlannedRobot& b) { return a.id < b.id; });

  const std::vector<std::string> edges = edge_names(configuration, origins);
  const bool is_coordinated = configuration.coordinator.method.has_value();
  std::size_t turn = 0;
  std::set<TierId> used;
  for (PlannedRobot& robot : plan.robots) {
    if (robot.edge.empty() && !is_coordinated) robot.edge = TierId(edges[turn++ % edges.size()]);
    used.insert(robot.edge);
  }
  if (is_coordinated) used = std::set<TierId>();
  for (const std::string& edge : edges)
    if (is_coordinated) used.insert(TierId(edge));
  for (std::size_t i = 0; i < configuration.edges.size(); ++i)
    if (used.count(TierId(configuration.edges[i].id)) == 0)
      throw Error(ErrorCode::kBadInput, "no robot uses edge '" + configuration.edges[i].id + "'",
                  origins.place_of(key("edges", i, "id")),
                  "remove it, or give it a robot: {id: ..., log: ..., edge: " + configuration.edges[i].id + "}");
  plan.edges.assign(used.begin(), used.end());
  plan.network = network_of(configuration.network, plan, origins);
  expect_tiers(configuration, plan, origins);
  plan.refused = refused_robots(configuration.team.refuse, plan.robots, origins);
  take_start_maps(configuration, origins, logs, plan);
  if (is_coordinated && !configuration.coordinator.model.empty()) {
    const std::string where = "coordinator.model";
    plan.model = std::filesystem::absolute(origins.file_of(where).parent_path() / configuration.coordinator.model)
                     .lexically_normal();
    if (logs == LogsAre::here) scheduling::read_model(plan.model);  // says now what is wrong with it
  }
  return plan;
}

RobotEntry robot_entry(const RunConfiguration& configuration, const RobotId& robot) {
  const auto entry = std::find_if(configuration.robots.begin(), configuration.robots.end(),
                                  [&](const RobotEntry& one) { return name_of(one) == robot.str(); });
  MAPWEAVE_EXPECT(entry != configuration.robots.end(), "robot '" + robot.str() + "' is of this run");
  return *entry;
}

void complete_starts(RunConfiguration& configuration, const Origins& origins) {
  for (std::size_t i = 0; i < configuration.robots.size(); ++i) {
    const std::string start = key("robots", i, "start");
    const auto is_said = [&](const char* field) { return origins.is_given(start + "." + field); };
    if (!is_said("sigma_m") && (is_said("x_m") || is_said("y_m") || is_said("yaw_rad")))
      configuration.robots[i].start.sigma_m = kStartSigma_m;
  }
}

void read_vocabulary(RunConfiguration& configuration, const Origins& origins) {
  constexpr const char* kKey = "visual.vocabulary";
  VisualOptions& visual = configuration.visual;
  if (visual.vocabulary.empty()) return;
  const auto path =
      std::filesystem::absolute(origins.file_of(kKey).parent_path() / visual.vocabulary).lexically_normal();
  std::error_code unreadable;
  if (!std::filesystem::is_regular_file(path, unreadable))
    throw Error(ErrorCode::kMissing, "there is no vocabulary " + path.string(), origins.place_of(kKey),
                origins.file_of(kKey).empty() ? "check its path" : "paths are relative to the configuration file");
  visual.vocabulary = path.string();
  visual.chosen_vocabulary = matching::ChosenVocabulary(matching::load_vocabulary(path));
  configuration.fusion.visual.vocabulary = visual.chosen_vocabulary;
}

EdgeEntry edge_entry(const RunConfiguration& configuration, const TierId& edge) {
  for (const EdgeEntry& entry : configuration.edges)
    if (entry.id == edge.str()) return entry;
  EdgeEntry entry;
  entry.id = edge.str();
  return entry;
}

LiveOptions live_at(const RunConfiguration& configuration, const TierId& edge) {
  LiveOptions live = configuration.live;
  if (const std::string broker = edge_entry(configuration, edge).broker; !broker.empty()) live.broker = broker;
  return live;
}

RunConfiguration effective(RunConfiguration configuration, const RunPlan& plan) {
  for (RobotEntry& entry : configuration.robots) {
    entry.id = name_of(entry);
    const auto robot = std::find_if(plan.robots.begin(), plan.robots.end(),
                                    [&](const PlannedRobot& one) { return one.robot().str() == entry.id; });
    entry.log = robot->log.string();
    if (entry.edges.empty()) entry.edge = robot->edge.str();
  }
  std::vector<EdgeEntry> edges;
  for (const TierId& edge : plan.edges) edges.push_back(edge_entry(configuration, edge));
  configuration.edges = std::move(edges);
  configuration.maps.clear();
  for (const std::filesystem::path& map : plan.maps) configuration.maps.push_back(map.string());
  configuration.network = plan.network;
  configuration.coordinator.model = plan.model.string();
  return configuration;
}

exporters::MapFolderOptions folder_options(const OutputOptions& output, const std::string& title) {
  exporters::MapFolderOptions options{
      {output.png, output.pgm, output.pcd, output.tum, false, output.g2o}, output.picture, output.cloud};
  if (options.picture.title.empty()) options.picture.title = title;
  return options;
}

std::string made_valid(std::string name) {
  for (char& letter : name)
    if (std::isalnum(static_cast<unsigned char>(letter)) == 0 && letter != '_' && letter != '-' && letter != '.')
      letter = '-';
  while (!name.empty() && name.front() == '.') name.erase(0, 1);
  constexpr std::size_t kLongest = 64;
  name.resize(std::min(name.size(), kLongest));
  return name;
}

std::string name_of_file(const std::filesystem::path& path) {
  const auto normal = path.lexically_normal();
  std::string name =
      (normal.has_filename() ? normal : normal.parent_path()).filename().string();  // "walk/" is the folder walk
  const auto cut_one_of = [&name](std::initializer_list<std::string_view> endings) {
    for (const std::string_view ending : endings) {
      if (name.size() <= ending.size() || name.compare(name.size() - ending.size(), ending.size(), ending) != 0)
        continue;
      name.resize(name.size() - ending.size());
      return;
    }
  };
  cut_one_of({".gz", ".zip"});
  cut_one_of({".rawlog", ".bag", ".mcap", ".db3", ".clf", ".log", ".g2o", ".mwdb", ".mwj", ".yaml", ".yml"});
  return made_valid(std::move(name));
}

}  // namespace mapweave::runtime
