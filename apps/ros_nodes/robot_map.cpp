#include "robot_map.h"

#include <mapweave/exporters/session_trajectories.h>

#include <algorithm>

namespace mapweave::ros_nodes {
namespace {

Map nodes_of(const RobotId& robot, const Map& map) {
  Map own;
  own.id = MapId(robot.str());
  for (const auto& [id, node] : map.nodes)
    if (id.session.client.robot == robot) own.nodes.set(id, node);
  return own;
}

bool is_equal(const Pose3& one, const Pose3& other) { return one.t == other.t && one.q.coeffs() == other.q.coeffs(); }

}  // namespace

std::optional<RobotMap> robot_map(const Map& map, const RobotId& robot) {
  RobotMap own{nodes_of(robot, map), {}, 0, {}};
  auto trajectories = exporters::robot_trajectories(own.map);
  if (trajectories.empty()) return std::nullopt;
  own.trajectory = std::move(trajectories.begin()->second);
  own.part_from_robot_map = own.trajectory.front().map_from_robot;
  const Pose3 robot_map_from_part = inverse(own.part_from_robot_map);
  for (auto& [id, node] : own.map.nodes) node.map_from_node = compose(robot_map_from_part, node.map_from_node);
  for (StampedPose& pose : own.trajectory) pose.map_from_robot = compose(robot_map_from_part, pose.map_from_robot);
  return own;
}

std::optional<RobotMap> robot_map(const runtime::LivePreview& preview, const RobotId& robot) {
  std::optional<RobotMap> newest;
  for (std::size_t part = 0; part < preview.parts.size(); ++part) {
    auto own = robot_map(preview.parts[part].map, robot);
    if (!own || (newest && own->trajectory.back().stamp <= newest->trajectory.back().stamp)) continue;
    own->part = part;
    newest = std::move(own);
  }
  return newest;
}

bool looks_the_same(const Map& one, const Map& other) {
  return one.nodes.size() == other.nodes.size() &&
         std::equal(one.nodes.begin(), one.nodes.end(), other.nodes.begin(), [](const auto& a, const auto& b) {
           return a.first == b.first && a.second.stamp == b.second.stamp && a.second.payload == b.second.payload &&
                  is_equal(a.second.map_from_node, b.second.map_from_node);
         });
}

}  // namespace mapweave::ros_nodes
