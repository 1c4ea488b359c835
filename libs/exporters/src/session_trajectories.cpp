#include <mapweave/exporters/session_trajectories.h>

#include <mapweave/core/error.h>

#include <algorithm>

namespace mapweave::exporters {

std::vector<SessionTrajectory> session_trajectories(const Map& map) {
  std::vector<SessionTrajectory> trajectories;
  for (const auto& [id, node] : map.nodes) {
    if (node.payload != nullptr && std::holds_alternative<OccupancyGrid>(*node.payload)) continue;
    MAPWEAVE_EXPECT(is_finite(node.map_from_node), "the pose of " + to_string(id) + " is not finite");
    if (trajectories.empty() || trajectories.back().session != id.session) trajectories.push_back({id.session, {}});
    trajectories.back().poses.push_back({node.stamp, node.map_from_node});
  }
  for (auto& trajectory : trajectories)
    std::stable_sort(trajectory.poses.begin(), trajectory.poses.end(),
                     [](const StampedPose& a, const StampedPose& b) { return a.stamp < b.stamp; });
  return trajectories;
}

}  // namespace mapweave::exporters
