#include "team_ways.h"

#include <algorithm>

namespace mapweave::runtime {

std::vector<exporters::StampedPose> carried_along(const CameraMap& part, const CameraWay& way, const Map& team, double scale) {
  std::vector<const Node*> keyframes;
  for (const auto& [id, node] : part.map.nodes)
    if (id.session.client.sensor.str() == sensor_name(way.label) && team.nodes.contains(id)) keyframes.push_back(&node);
  std::stable_sort(keyframes.begin(), keyframes.end(), [](const Node* a, const Node* b) { return a->stamp < b->stamp; });
  std::vector<exporters::StampedPose> result;
  if (keyframes.empty()) return result;
  for (const exporters::StampedPose& frame : way.frames) {
    auto later = std::upper_bound(keyframes.begin(), keyframes.end(), frame.stamp, [](Stamp s, const Node* n) { return s < n->stamp; });
    const Node& keyframe = **(later == keyframes.begin() ? later : later - 1);
    Pose3 step = between(keyframe.map_from_node, frame.map_from_robot);
    step.t *= scale;
    result.push_back({frame.stamp, compose(team.nodes.find(keyframe.id)->map_from_node, step)});
  }
  return result;
}

bool has_keyframes(const Map& map) {
  return std::any_of(map.nodes.begin(), map.nodes.end(), [](const auto& entry) { return keyframe_of(entry.second) != nullptr; });
}

std::vector<exporters::SessionTrajectory> team_ways(const fusion::Component& component, const std::vector<CamerasOutcome>& cameras) {
  std::vector<exporters::SessionTrajectory> ways;
  std::size_t members = 0;
  for (const CamerasOutcome& outcome : cameras)
    for (const CameraMap& part : outcome.maps) {
      if (!std::binary_search(component.members.begin(), component.members.end(), part.map.id)) continue;
      ++members;
      const double* scale = component.scales.find(part.map.id);
      auto frames = carried_along(part, part.ways.front(), component.map, scale != nullptr ? *scale : 1.0);
      if (frames.empty()) continue;
      const SessionId session{{part.map.robots().front(), SensorId(sensor_name(part.ways.front().label))}, 0};
      const auto known = std::find_if(ways.begin(), ways.end(), [&](const auto& way) { return way.session == session; });
      if (known == ways.end()) {
        ways.push_back({session, std::move(frames)});
      } else {
        known->poses.insert(known->poses.end(), frames.begin(), frames.end());
        std::stable_sort(known->poses.begin(), known->poses.end(), [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
      }
    }
  if (members < component.members.size()) return exporters::session_trajectories(component.map);
  std::sort(ways.begin(), ways.end(), [](const auto& a, const auto& b) { return a.session < b.session; });
  return ways;
}

}  // namespace mapweave::runtime
