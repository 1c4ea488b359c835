#include <mapweave/exporters/session_trajectories.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <set>

namespace mapweave::exporters {

std::vector<SessionTrajectory> session_trajectories(const Map& map) {
  std::vector<SessionTrajectory> trajectories;
  std::set<SessionId> seeing, scanning;
  for (const auto& [id, node] : map.nodes) {
    if (node.payload != nullptr && std::holds_alternative<OccupancyGrid>(*node.payload)) continue;
    MAPWEAVE_EXPECT(is_finite(node.map_from_node), "the pose of " + to_string(id) + " is not finite");
    if (trajectories.empty() || trajectories.back().session != id.session) trajectories.push_back({id.session, {}});
    trajectories.back().poses.push_back({node.stamp, node.map_from_node});
    (keyframe_of(node) != nullptr ? seeing : scanning).insert(id.session);
  }
  // The trajectory of a robot that has a laser too is written once.
  const auto is_known = [&](const SessionTrajectory& trajectory) {
    return seeing.count(trajectory.session) != 0 &&
           std::any_of(scanning.begin(), scanning.end(), [&](const SessionId& session) {
             return session.client.robot == trajectory.session.client.robot && seeing.count(session) == 0;
           });
  };
  trajectories.erase(std::remove_if(trajectories.begin(), trajectories.end(), is_known), trajectories.end());
  for (auto& trajectory : trajectories)
    std::stable_sort(trajectory.poses.begin(), trajectory.poses.end(),
                     [](const StampedPose& a, const StampedPose& b) { return a.stamp < b.stamp; });
  return trajectories;
}

std::map<RobotId, std::vector<StampedPose>> robot_trajectories(const Map& map) {
  std::map<RobotId, std::vector<StampedPose>> robots;
  for (const SessionTrajectory& trajectory : session_trajectories(map)) {
    auto& poses = robots[trajectory.session.client.robot];
    poses.insert(poses.end(), trajectory.poses.begin(), trajectory.poses.end());
  }
  for (auto& [robot, poses] : robots)
    std::stable_sort(poses.begin(), poses.end(),
                     [](const StampedPose& a, const StampedPose& b) { return a.stamp < b.stamp; });
  return robots;
}

}  // namespace mapweave::exporters
