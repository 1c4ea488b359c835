#include "lengths.h"

namespace mapweave::fusion {
namespace {

const Pose3& mounting(const VisualMap& map, std::size_t keyframe) { return map.keyframes()[keyframe].content->geometry->robot_from_camera; }

Pose3 camera_on(const Map& map, const NodeId& id) {
  const Node* node = map.nodes.find(id);
  const KeyframeFeatures* keyframe = node != nullptr ? keyframe_of(*node) : nullptr;
  return keyframe != nullptr ? keyframe->geometry->robot_from_camera : Pose3();
}

}  // namespace

Pose3 mounting_of(const Map& map) {
  for (const auto& [id, node] : map.nodes)
    if (const KeyframeFeatures* keyframe = keyframe_of(node)) return keyframe->geometry->robot_from_camera;
  return {};
}

Pose3 in_lengths(const Pose3& map_from_node, const Pose3& robot_from_camera, double scale) {
  if (scale == 1.0) return map_from_node;
  const Eigen::Vector3d swung_m = map_from_node.q * robot_from_camera.t - robot_from_camera.t;  // of the camera, about where it began
  return {scale * map_from_node.t + (scale - 1.0) * swung_m, map_from_node.q};
}

Map in_lengths(Map map, double scale) {
  if (scale == 1.0) return map;
  for (auto& [id, landmark] : map.landmarks)
    landmark.point_units = landmark_units(in_lengths(landmark.point_in_anchor(), camera_on(map, landmark.anchor), scale));
  const Pose3 robot_from_camera = mounting_of(map);
  for (auto& [id, node] : map.nodes) node.map_from_node = in_lengths(node.map_from_node, robot_from_camera, scale);
  for (auto& [id, constraint] : map.constraints) constraint = in_lengths(constraint, map, scale);
  return map;
}

Constraint in_lengths(Constraint constraint, const Map& map, double scale) {
  if (scale != 1.0) constraint.from_from_to.pose = in_lengths(constraint.from_from_to.pose, camera_on(map, constraint.id.from), scale);
  return constraint;
}

Eigen::Vector3d in_lengths(const Eigen::Vector3d& point_in_anchor, const Pose3& robot_from_camera, double scale) {
  if (scale == 1.0) return point_in_anchor;
  return robot_from_camera.t + scale * (point_in_anchor - robot_from_camera.t);
}

Pose3 carried(const Sim3& there_from_map, const Pose3& map_from_node, const Pose3& robot_from_camera) {
  if (there_from_map.scale == 1.0) return transformed(map_from_node, there_from_map);
  return compose(transformed(compose(map_from_node, robot_from_camera), there_from_map), inverse(robot_from_camera));
}

Pose3 frame_there(const Pose3& there_from_node, const Pose3& map_from_node, const Pose3& robot_from_camera, double scale) {
  if (scale == 1.0) return transformed(inverse(map_from_node), Sim3{there_from_node, scale});
  return transformed(inverse(compose(map_from_node, robot_from_camera)), Sim3{compose(there_from_node, robot_from_camera), scale});
}

MetricWitness in_lengths(const VisualWitness& w, const VisualMap& a, const VisualMap& b, double scale_a, double scale_b) {
  MetricWitness result{w.node_a_from_node_b.pose, w.information};
  const Pose3& here = w.node_a_from_node_b.pose;
  const Eigen::Vector3d &camera_a = mounting(a, w.keyframe_a).t, &camera_b = mounting(b, w.keyframe_b).t;
  if (scale_a != 1.0 || w.node_a_from_node_b.scale != 1.0) {
    const Eigen::Vector3d b_in_a = transformed(camera_b, w.node_a_from_node_b);  // b's camera, in a's lengths
    result.node_a_from_node_b.t = camera_a + scale_a * (b_in_a - camera_a) - here.q * camera_b;
  }
  // Of a small motion of b, in b's lengths.
  result.information.topRows<3>() /= scale_b;
  result.information.leftCols<3>() /= scale_b;
  return result;
}

}  // namespace mapweave::fusion
