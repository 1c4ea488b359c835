#include <mapweave/runtime/map_names.h>

#include <mapweave/core/error.h>
#include <mapweave/runtime/run_configuration.h>

#include <algorithm>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kLongestName = 64;  // is_valid_name

// The base, or where it is taken the base with a number; the base is cut where the name would be too long. Takes it.
template <class Id>
Id take_name(const std::string& base, std::set<Id>& taken) {
  for (int number = 1;; ++number) {
    const std::string ending = number == 1 ? "" : "-" + std::to_string(number);
    const Id id(base.substr(0, kLongestName - ending.size()) + ending);
    if (taken.insert(id).second) return id;
  }
}

}  // namespace

std::vector<MapId> names_of(const std::vector<std::filesystem::path>& paths) {
  std::vector<std::filesystem::path> full;
  std::map<std::string, int> with_stem;
  std::map<std::string, std::set<std::filesystem::path>> folders_of_stem;
  for (const auto& path : paths) {
    full.push_back(std::filesystem::weakly_canonical(path));
    ++with_stem[name_of_file(path)];
    folders_of_stem[name_of_file(path)].insert(full.back().parent_path());
  }
  std::vector<std::size_t> order(paths.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return full[a] < full[b]; });

  std::vector<MapId> names(paths.size());
  std::set<MapId> taken;
  for (std::size_t place = 0; place < order.size(); ++place) {
    const std::size_t i = order[place];
    if (place > 0 && full[i] == full[order[place - 1]])
      throw Error(ErrorCode::kBadInput, "this map is given twice", paths[i].string(), "name each map once");
    std::string name = name_of_file(paths[i]);
    const bool folder_says_more = name == "map" || folders_of_stem[name].size() > 1;
    if ((with_stem[name] > 1 && folder_says_more) || name.empty()) name = name_of_file(full[i].parent_path());
    if (!is_valid_name(name)) name = "map";
    names[i] = take_name(name, taken);
  }
  return names;
}

Map rekeyed(const Map& map, MapId id, const std::function<RobotId(RobotId)>& renamed) {
  const auto session_of = [&](SessionId session) {
    session.client.robot = renamed(session.client.robot);
    return session;
  };
  const auto node_of = [&](NodeId node) {
    node.session = session_of(node.session);
    return node;
  };
  Map result;
  result.id = id;
  for (const auto& [old_id, old_node] : map.nodes) {
    Node node = old_node;
    node.id = node_of(old_id);
    const NodeId node_id = node.id;
    result.nodes.set(node_id, std::move(node));
  }
  for (const auto& [old_id, old_submap] : map.submaps) {
    Submap submap = old_submap;
    submap.id.session = session_of(old_id.session);
    for (auto& [node, pose] : submap.submap_from_node) node = node_of(node);
    if (submap.frozen) submap.content = content_hash(submap, result.nodes);
    const SubmapId submap_id = submap.id;
    result.submaps.set(submap_id, std::move(submap));
  }
  for (const auto& [old_id, old_constraint] : map.constraints) {
    Constraint constraint = old_constraint;
    constraint.id.from = node_of(old_id.from);
    constraint.id.to = node_of(old_id.to);
    const ConstraintId constraint_id = constraint.id;
    result.constraints.set(constraint_id, std::move(constraint));
  }
  for (const auto& [old_id, old_landmark] : map.landmarks) {
    Landmark landmark = old_landmark;
    landmark.id.session = session_of(old_id.session);
    landmark.anchor = node_of(old_landmark.anchor);
    for (LandmarkSighting& sighting : landmark.seen) sighting.node = node_of(sighting.node);
    std::sort(landmark.seen.begin(), landmark.seen.end(), [](const auto& a, const auto& b) { return a.node < b.node; });
    const LandmarkId landmark_id = landmark.id;
    result.landmarks.set(landmark_id, std::move(landmark));
  }
  return result;
}

namespace {

// "alpha.2" of robot alpha: a part of its log, which another edge mapped (partial offloading).
bool is_part_of(const Map& map, const RobotId& robot) {
  const std::string &id = map.id.str(), start = robot.str() + ".";
  return id.size() > start.size() && id.compare(0, start.size(), start) == 0 &&
         id.find_first_not_of("0123456789", start.size()) == std::string::npos;
}

std::pair<Stamp, Stamp> time_of(const Map& map) {
  const auto [first, last] = std::minmax_element(
      map.nodes.begin(), map.nodes.end(), [](const auto& a, const auto& b) { return a.second.stamp < b.second.stamp; });
  return {first->second.stamp, last->second.stamp};
}

// Parts of one log come one after the other. Their robot is one, and keeps its name.
bool are_parts(std::vector<const Map*> maps, const RobotId& robot) {
  for (const Map* map : maps)
    if (map->robots().size() != 1 || !is_part_of(*map, robot)) return false;
  std::sort(maps.begin(), maps.end(), [](const Map* a, const Map* b) { return time_of(*a) < time_of(*b); });
  for (std::size_t i = 0; i + 1 < maps.size(); ++i)
    if (!(time_of(*maps[i]).second < time_of(*maps[i + 1]).first)) return false;
  return true;
}

}  // namespace

std::vector<Map> with_robots_apart(std::vector<Map> maps, std::vector<std::string>& notes) {
  std::sort(maps.begin(), maps.end(), [](const Map& a, const Map& b) { return a.id < b.id; });
  std::map<RobotId, std::vector<const Map*>> holders;
  for (const Map& map : maps)
    for (const RobotId robot : map.robots()) holders[robot].push_back(&map);
  std::set<RobotId> taken, shared;
  for (const auto& [robot, holding] : holders) {
    taken.insert(robot);
    if (holding.size() > 1 && !are_parts(holding, robot)) shared.insert(robot);
  }
  for (Map& map : maps) {
    const std::vector<RobotId> robots = map.robots();
    std::map<RobotId, RobotId> renamed;
    for (const RobotId robot : robots) {
      if (shared.count(robot) == 0 || (robots.size() == 1 && map.id.str() == robot.str())) continue;
      const std::string base = robots.size() == 1 ? map.id.str() : map.id.str() + "." + robot.str();
      const RobotId name = take_name(base, taken);
      renamed.emplace(robot, name);
      notes.push_back("robot '" + robot.str() + "' of map '" + map.id.str() + "' is called '" + name.str() +
                      "' here: another map has a robot of that name too");
    }
    if (!renamed.empty())
      map = rekeyed(map, map.id, [&](RobotId robot) {
        const auto other = renamed.find(robot);
        return other == renamed.end() ? robot : other->second;
      });
  }
  return maps;
}

}  // namespace mapweave::runtime
