#include "team_trajectories.h"

#include <algorithm>

namespace mapweave::runtime {

std::vector<StampedPose> carried_along(const CameraMap& part, const FrameTrajectory& trajectory, const Map& team,
                                       double scale) {
  std::vector<rig::MovedKeyframe> keyframes;
  for (const auto& [id, node] : part.map.nodes) {
    const Node* moved = team.nodes.find(id);
    if (moved == nullptr || id.session.client.sensor.str() != sensor_name(trajectory.label)) continue;
    const KeyframeFeatures* keyframe = keyframe_of(node);
    keyframes.push_back({node.stamp, node.map_from_node, moved->map_from_node, scale,
                         keyframe != nullptr ? keyframe->geometry->robot_from_camera : Pose3()});
  }
  std::stable_sort(keyframes.begin(), keyframes.end(), [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
  return rig::moved_with_keyframes(trajectory.frames, keyframes);
}

bool has_keyframes(const Map& map) {
  return std::any_of(map.nodes.begin(), map.nodes.end(),
                     [](const auto& entry) { return keyframe_of(entry.second) != nullptr; });
}

namespace {

bool is_of(const std::vector<CamerasOutcome>& cameras, const RobotId& robot) {
  return std::any_of(cameras.begin(), cameras.end(), [&](const CamerasOutcome& one) { return one.robot.id == robot; });
}

}  // namespace

std::vector<exporters::SessionTrajectory> team_trajectories(const fusion::Component& component,
                                                            const std::vector<CamerasOutcome>& cameras,
                                                            const RunConfiguration& configuration) {
  std::vector<exporters::SessionTrajectory> trajectories;
  std::size_t members = 0;
  for (const CamerasOutcome& outcome : cameras) {
    const rig::RobotTrajectoryOptions& options = configuration_of(configuration, outcome.robot).rig.trajectory;
    for (const CameraMap& part : outcome.maps) {
      if (!std::binary_search(component.members.begin(), component.members.end(), part.map.id)) continue;
      ++members;
      const double* scale = component.scales.find(part.map.id);
      std::vector<FrameTrajectory> moved = part.trajectories;
      for (FrameTrajectory& trajectory : moved)
        trajectory.frames = carried_along(part, trajectory, component.map, scale != nullptr ? *scale : 1.0);
      const auto frames = robot_trajectory_of(component.map, moved, outcome.odometry, options);
      if (frames.empty()) continue;
      const SessionId session{{part.map.robots().front(), SensorId(sensor_name(part.trajectories.front().label))}, 0};
      const auto known = std::find_if(trajectories.begin(), trajectories.end(),
                                      [&](const auto& trajectory) { return trajectory.session == session; });
      if (known == trajectories.end()) {
        trajectories.push_back({session, frames});
      } else {
        known->poses.insert(known->poses.end(), frames.begin(), frames.end());
        std::stable_sort(known->poses.begin(), known->poses.end(),
                         [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
      }
    }
  }
  if (members < component.members.size()) {
    // Maps of sessions before: their keyframes are all that is known.
    std::vector<exporters::SessionTrajectory> others = exporters::session_trajectories(component.map);
    if (members == 0) return others;
    others.erase(std::remove_if(others.begin(), others.end(),
                                [&](const auto& one) { return is_of(cameras, one.session.client.robot); }),
                 others.end());
    trajectories.insert(trajectories.end(), others.begin(), others.end());
  }
  std::sort(trajectories.begin(), trajectories.end(),
            [](const auto& a, const auto& b) { return a.session < b.session; });
  return trajectories;
}

}  // namespace mapweave::runtime
