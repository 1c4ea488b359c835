#include <mapweave/rig/robot_rigs.h>

#include <algorithm>
#include <map>

namespace mapweave::rig {
namespace {

constexpr double kBridged_s = 3.0;  // between two keyframes: a straight trajectory has few

const SessionId& session_of(const Map& map) { return map.nodes.front().first.session; }

struct OneRobot {
  std::vector<Map> maps;
  std::vector<RobotRigs::Rig> rigs;
  std::vector<std::string> notes;
};

// In the frame of the member whose client began first, and under its name.
RobotRigs::Rig renamed(RigMap& rig, const std::vector<RigMember>& members) {
  RobotRigs::Rig names;
  const Map* first = nullptr;
  const auto rank = [](const Map& map) { return std::make_pair(session_of(map).run, map.id); };
  for (const std::size_t m : rig.members) {
    const Map& map = members[m].map;
    names.members.push_back(map.id);
    if (first == nullptr || rank(map) < rank(*first)) first = &map;
  }
  std::sort(names.members.begin(), names.members.end());
  rig.map.id = names.map = first->id;
  const auto& [id, node] = first->nodes.front();
  const Pose3 shift = compose(node.map_from_node, inverse(rig.map.nodes.find(id)->map_from_node));
  for (auto& entry : rig.map.nodes) entry.second.map_from_node = compose(shift, entry.second.map_from_node);
  return names;
}

OneRobot merged_robot(const std::vector<const Map*>& maps, const RigOptions& options) {
  OneRobot result;
  std::vector<RigMember> members;
  for (const Map* map : maps) members.push_back({session_of(*map).client.sensor.str(), *map, {}});
  if (std::all_of(members.begin(), members.end(),
                  [&](const RigMember& one) { return one.camera == members.front().camera; })) {
    for (RigMember& member : members) result.maps.push_back(std::move(member.map));
    return result;
  }
  RigMerge rig = merge_rig(members, {}, options);
  for (RigMap& one : rig.maps) {
    if (one.members.size() > 1) result.rigs.push_back(renamed(one, members));
    result.maps.push_back(std::move(one.map));
  }
  for (const std::string& note : rig.notes)
    result.notes.push_back("robot '" + session_of(*maps.front()).client.robot.str() + "': " + note);
  return result;
}

}  // namespace

RobotRigs merge_rigs(const std::vector<Map>& maps, const RigOptions& options, WorkerPool& pool) {
  RobotRigs result;
  RigOptions by_keyframes = options;
  by_keyframes.longest_gap_s = std::max(options.longest_gap_s, kBridged_s);
  std::map<RobotId, std::vector<const Map*>> of_robot;
  for (const Map& map : maps) {
    if (map.nodes.empty())
      result.maps.push_back(map);
    else
      of_robot[session_of(map).client.robot].push_back(&map);
  }
  std::vector<std::vector<const Map*>> robots;
  for (auto& [robot, own] : of_robot) {
    std::sort(own.begin(), own.end(), [](const Map* a, const Map* b) { return a->id < b->id; });
    robots.push_back(std::move(own));
  }
  for (OneRobot& robot :
       pool.map(robots.size(), [&](std::size_t i) { return merged_robot(robots[i], by_keyframes); })) {
    std::move(robot.maps.begin(), robot.maps.end(), std::back_inserter(result.maps));
    std::move(robot.rigs.begin(), robot.rigs.end(), std::back_inserter(result.rigs));
    std::move(robot.notes.begin(), robot.notes.end(), std::back_inserter(result.notes));
  }
  std::stable_sort(result.maps.begin(), result.maps.end(), [](const Map& a, const Map& b) { return a.id < b.id; });
  std::sort(result.rigs.begin(), result.rigs.end(), [](const auto& a, const auto& b) { return a.map < b.map; });
  return result;
}

}  // namespace mapweave::rig
