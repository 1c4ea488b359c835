#include <mapweave/core/error.h>
#include <mapweave/fusion/split_rigs.h>
#include <mapweave/rig/scale.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace mapweave::fusion {
namespace {

// The scale is that of a camera's trajectory, not of its robot's: extrinsics are in metres whatever the scale of the
// map.
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
    result.push_back(
        {compose(node.map_from_node, robot_from_camera), compose(placed->map_from_node, robot_from_camera)});
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

void split_rigs(FusionResult& result, const std::vector<rig::RobotRigs::Rig>& all, const std::vector<Map>& maps) {
  std::map<MapId, const Map*> by_id;
  for (const Map& map : maps) by_id.emplace(map.id, &map);
  for (Component& component : result.components) {
    for (const rig::RobotRigs::Rig& merged : all) {
      const auto known = std::find(component.members.begin(), component.members.end(), merged.map);
      if (known == component.members.end()) continue;
      component.members.erase(known);
      const double* scale_of_rig = component.scales.find(merged.map);
      const double whole = scale_of_rig != nullptr ? *scale_of_rig : 1.0;
      component.scales.erase(merged.map);
      for (const MapId& member : merged.members) {
        const Map& map = *by_id.at(member);
        const std::vector<PlacedCamera> cameras = placed_cameras(map, component.map);
        double scale = whole;
        if (const double own_m = spread_m(cameras, &PlacedCamera::in_map); own_m > 0.0 && !rig::is_metric(map))
          scale = spread_m(cameras, &PlacedCamera::in_team) / own_m;
        component.members.push_back(member);
        component.team_from_map.set(member,
                                    transformed(inverse(cameras.front().in_map), Sim3{cameras.front().in_team, scale}));
        if (scale != 1.0) component.scales.set(member, scale);
      }
    }
    std::sort(component.members.begin(), component.members.end());
  }
}

}  // namespace mapweave::fusion
