#include "covisibility.h"
#include "visual_witness.h"

#include <mapweave/core/error.h>
#include <mapweave/fusion/siblings.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace mapweave::fusion {
namespace {

constexpr double kBridged_s = 3.0;  // between two keyframes: straight ways have few

const SessionId& session_of(const Map& map) { return map.nodes.front().first.session; }

struct OneRobot {
  std::vector<Map> maps;
  std::vector<SiblingMaps::Tied> tied;
  std::vector<std::string> notes;
};

// In the frame of the member whose client began first, and under its name.
SiblingMaps::Tied named_for_good(TiedMap& rig, const std::vector<RigMember>& members) {
  SiblingMaps::Tied names;
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

OneRobot tied_robot(const std::vector<const Map*>& maps, const RigOptions& options) {
  OneRobot result;
  std::vector<RigMember> members;
  for (const Map* map : maps) members.push_back({session_of(*map).client.sensor.str(), *map, {}});
  if (std::all_of(members.begin(), members.end(), [&](const RigMember& one) { return one.camera == members.front().camera; })) {
    for (RigMember& member : members) result.maps.push_back(std::move(member.map));
    return result;
  }
  TiedRig rig = tied(members, {}, options);
  for (TiedMap& one : rig.maps) {
    if (one.members.size() > 1) result.tied.push_back(named_for_good(one, members));
    result.maps.push_back(std::move(one.map));
  }
  for (const std::string& note : rig.notes) result.notes.push_back("robot '" + session_of(*maps.front()).client.robot.str() + "': " + note);
  return result;
}

// Lengths are those of a camera's way: the robot under it swings by metres whatever lengths its map has.
struct PlacedCamera {
  Pose3 in_map, in_team;
};
std::vector<PlacedCamera> placed_cameras(const Map& map, const Map& team) {
  std::vector<PlacedCamera> result;
  for (const auto& [id, node] : map.nodes) {
    const Node* placed = team.nodes.find(id);
    if (placed == nullptr) continue;
    const KeyframeFeatures* keyframe = keyframe_of(node);
    const Pose3 robot_from_camera = keyframe != nullptr ? keyframe->geometry->robot_from_camera : Pose3();
    result.push_back({compose(node.map_from_node, robot_from_camera), compose(placed->map_from_node, robot_from_camera)});
  }
  MAPWEAVE_EXPECT(!result.empty(), "a team has nodes of each member");
  return result;
}

// How far they lie from their middle, root mean square.
double spread_m(const std::vector<PlacedCamera>& cameras, Pose3 PlacedCamera::*pose) {
  const auto count = static_cast<double>(cameras.size());
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const PlacedCamera& camera : cameras) middle += (camera.*pose).t / count;
  double square = 0.0;
  for (const PlacedCamera& camera : cameras) square += ((camera.*pose).t - middle).squaredNorm() / count;
  return std::sqrt(square);
}

}  // namespace

SiblingMaps tied_siblings(const std::vector<Map>& maps, const RigOptions& options, WorkerPool& pool) {
  SiblingMaps result;
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
  for (OneRobot& robot : pool.map(robots.size(), [&](std::size_t i) { return tied_robot(robots[i], by_keyframes); })) {
    std::move(robot.maps.begin(), robot.maps.end(), std::back_inserter(result.maps));
    std::move(robot.tied.begin(), robot.tied.end(), std::back_inserter(result.tied));
    std::move(robot.notes.begin(), robot.notes.end(), std::back_inserter(result.notes));
  }
  std::stable_sort(result.maps.begin(), result.maps.end(), [](const Map& a, const Map& b) { return a.id < b.id; });
  std::sort(result.tied.begin(), result.tied.end(), [](const auto& a, const auto& b) { return a.map < b.map; });
  return result;
}

void tell_apart(FusionResult& result, const std::vector<SiblingMaps::Tied>& all, const std::vector<Map>& maps) {
  std::map<MapId, const Map*> by_id;
  for (const Map& map : maps) by_id.emplace(map.id, &map);
  for (Component& component : result.components) {
    for (const SiblingMaps::Tied& tied : all) {
      const auto known = std::find(component.members.begin(), component.members.end(), tied.map);
      if (known == component.members.end()) continue;
      component.members.erase(known);
      const double* scale_of_tied = component.scales.find(tied.map);
      const double whole = scale_of_tied != nullptr ? *scale_of_tied : 1.0;
      component.scales.erase(tied.map);
      for (const MapId& member : tied.members) {
        const Map& map = *by_id.at(member);
        const std::vector<PlacedCamera> cameras = placed_cameras(map, component.map);
        double scale = whole;
        if (const double own_m = spread_m(cameras, &PlacedCamera::in_map); own_m > 0.0 && !is_metric(map))
          scale = spread_m(cameras, &PlacedCamera::in_team) / own_m;
        component.members.push_back(member);
        component.team_from_map.set(member, transformed(inverse(cameras.front().in_map), Sim3{cameras.front().in_team, scale}));
        if (scale != 1.0) component.scales.set(member, scale);
      }
    }
    std::sort(component.members.begin(), component.members.end());
  }
}

}  // namespace mapweave::fusion
