#include <mapweave/rig/scale.h>

#include <algorithm>

namespace mapweave::rig {
namespace {

Pose3 extrinsics_at(const Map& map, const NodeId& id) {
  const Node* node = map.nodes.find(id);
  const KeyframeFeatures* keyframe = node != nullptr ? keyframe_of(*node) : nullptr;
  return keyframe != nullptr ? keyframe->geometry->robot_from_camera : Pose3();
}

}  // namespace

bool is_metric(const Map& map) {
  return std::any_of(map.nodes.begin(), map.nodes.end(),
                     [](const auto& entry) {
                       const KeyframeFeatures* keyframe = keyframe_of(entry.second);
                       return keyframe != nullptr && keyframe->geometry->baseline_m > 0.0;
                     }) ||
         std::any_of(map.landmarks.begin(), map.landmarks.end(), [](const auto& entry) {
           const auto& seen = entry.second.seen;
           return std::any_of(seen.begin(), seen.end(),
                              [](const LandmarkSighting& sighting) { return sighting.inverse_depth != 0; });
         });
}

Pose3 extrinsics_of(const Map& map) {
  for (const auto& [id, node] : map.nodes)
    if (const KeyframeFeatures* keyframe = keyframe_of(node)) return keyframe->geometry->robot_from_camera;
  return {};
}

Pose3 rescaled(const Pose3& map_from_node, const Pose3& robot_from_camera, double scale) {
  if (scale == 1.0) return map_from_node;
  const Eigen::Vector3d swing_m =
      map_from_node.q * robot_from_camera.t - robot_from_camera.t;  // of the camera, about where it started
  return {scale * map_from_node.t + (scale - 1.0) * swing_m, map_from_node.q};
}

Map rescaled(Map map, double scale) {
  if (scale == 1.0) return map;
  for (auto& [id, landmark] : map.landmarks)
    landmark.point_units =
        landmark_units(rescaled(landmark.point_in_anchor(), extrinsics_at(map, landmark.anchor), scale));
  const Pose3 robot_from_camera = extrinsics_of(map);
  for (auto& [id, node] : map.nodes) node.map_from_node = rescaled(node.map_from_node, robot_from_camera, scale);
  for (auto& [id, constraint] : map.constraints) constraint = rescaled(constraint, map, scale);
  return map;
}

Constraint rescaled(Constraint constraint, const Map& map, double scale) {
  if (scale != 1.0)
    constraint.from_from_to.pose =
        rescaled(constraint.from_from_to.pose, extrinsics_at(map, constraint.id.from), scale);
  return constraint;
}

Eigen::Vector3d rescaled(const Eigen::Vector3d& point_in_anchor, const Pose3& robot_from_camera, double scale) {
  if (scale == 1.0) return point_in_anchor;
  return robot_from_camera.t + scale * (point_in_anchor - robot_from_camera.t);
}

Pose3 moved_with_camera(const Sim3& there_from_map, const Pose3& map_from_node, const Pose3& robot_from_camera) {
  if (there_from_map.scale == 1.0) return transformed(map_from_node, there_from_map);
  return compose(transformed(compose(map_from_node, robot_from_camera), there_from_map), inverse(robot_from_camera));
}

Pose3 frame_by_node(const Pose3& there_from_node, const Pose3& map_from_node, const Pose3& robot_from_camera,
                    double scale) {
  if (scale == 1.0) return transformed(inverse(map_from_node), Sim3{there_from_node, scale});
  return transformed(inverse(compose(map_from_node, robot_from_camera)),
                     Sim3{compose(there_from_node, robot_from_camera), scale});
}

}  // namespace mapweave::rig
