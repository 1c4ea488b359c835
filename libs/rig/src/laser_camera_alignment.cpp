#include <mapweave/core/stamped_pose.h>
#include <mapweave/rig/aligned_trajectories.h>
#include <mapweave/rig/covisibility.h>
#include <mapweave/rig/laser_camera_alignment.h>
#include <mapweave/rig/scale.h>

#include <algorithm>
#include <map>
#include <optional>

namespace mapweave::rig {
namespace {

// The robot's poses by the laser.
class LaserTrajectory {
 public:
  explicit LaserTrajectory(const Map& laser) {
    for (const auto& [id, node] : laser.nodes) nodes_.push_back(&node);
    std::stable_sort(nodes_.begin(), nodes_.end(), [](const Node* a, const Node* b) { return a->stamp < b->stamp; });
  }
  struct LaserPose {
    const Node* before;
    Pose3 map_from_robot;
  };
  std::optional<LaserPose> at(Stamp stamp, double longest_gap_s) const {
    const auto later = std::lower_bound(nodes_.begin(), nodes_.end(), stamp,
                                        [](const Node* node, Stamp s) { return node->stamp < s; });
    if (later == nodes_.end()) return std::nullopt;
    if ((*later)->stamp == stamp) return LaserPose{*later, (*later)->map_from_node};
    if (later == nodes_.begin()) return std::nullopt;
    const Node &before = **(later - 1), &after = **later;
    const double gap_s = seconds_between(before.stamp, after.stamp);
    if (gap_s > longest_gap_s) return std::nullopt;
    return LaserPose{
        &before, interpolated(before.map_from_node, after.map_from_node, seconds_between(before.stamp, stamp) / gap_s)};
  }

 private:
  std::vector<const Node*> nodes_;
};

struct MatchedKeyframe {
  const Node* keyframe;
  LaserTrajectory::LaserPose laser;
};

// The pose of the camera's map after it is rescaled, and by which scale. The robot turns about its base, the camera
// does not: the scale is that of the camera's trajectory.
Sim3 laser_from_camera_map(const std::vector<MatchedKeyframe>& matches, const Map& camera) {
  std::vector<CommonPose> pairs;
  double scale = 1.0;
  if (!is_metric(camera)) {
    const Pose3 robot_from_camera = extrinsics_of(camera);
    for (const MatchedKeyframe& match : matches)
      pairs.push_back({compose(match.laser.map_from_robot, robot_from_camera),
                       compose(match.keyframe->map_from_node, robot_from_camera)});
    scale = scale_of_trajectories(pairs).value_or(1.0);
    pairs.clear();
    for (const MatchedKeyframe& match : matches)
      pairs.push_back({match.laser.map_from_robot, rescaled(match.keyframe->map_from_node, robot_from_camera, scale)});
  } else {
    for (const MatchedKeyframe& match : matches)
      pairs.push_back({match.laser.map_from_robot, match.keyframe->map_from_node});
  }
  return {aligned(pairs, 1.0).pose, scale};
}

Constraint constraint_in_plane(ConstraintKind kind, const NodeId& from, const NodeId& to, const Pose3& from_from_to,
                               double sigma_m, double sigma_rad) {
  const double m = 1.0 / (sigma_m * sigma_m), rad = 1.0 / (sigma_rad * sigma_rad);
  return planar_constraint({kind, from, to, 0}, planar(from_from_to), Eigen::Vector3d(m, m, rad).asDiagonal());
}

}  // namespace

std::vector<Constraint> covisibility_constraints(const Map& map, const LaserCameraOptions& options) {
  std::vector<Constraint> result;
  for (const CovisibilityEdge& edge : covisibility_edges(covisibility(map), options.least_shared)) {
    const Pose3 motion = between(edge.from->map_from_node, edge.to->map_from_node);
    result.push_back(
        constraint_in_plane(ConstraintKind::scan_match, edge.from->id, edge.to->id, motion,
                            options.covisibility_sigma_m + options.covisibility_sigma_per_m * motion.t.norm(),
                            options.covisibility_sigma_rad));
  }
  return result;
}

LaserCameraMap align_cameras(Map laser, const std::vector<Map>& cameras, const LaserCameraOptions& options,
                             const graph::SolveOptions& solve) {
  LaserCameraMap result;
  const LaserTrajectory trajectory(laser);
  std::map<NodeId, Node> nodes;
  std::map<ConstraintId, Constraint> constraints;
  std::map<LandmarkId, Landmark> landmarks;
  for (const Map& camera : cameras) {
    std::vector<MatchedKeyframe> matches;
    for (const auto& [id, node] : camera.nodes)
      if (const auto pose = trajectory.at(node.stamp, options.longest_gap_s)) matches.push_back({&node, *pose});
    if (matches.empty()) {
      result.apart.push_back(camera.id);
      continue;
    }
    const Sim3 laser_from_map = laser_from_camera_map(matches, camera);
    Map placed = rescaled(camera, laser_from_map.scale);
    for (auto& [id, node] : placed.nodes) {
      node.map_from_node = compose(laser_from_map.pose, node.map_from_node);
      nodes.emplace(id, node);
    }
    landmarks.insert(placed.landmarks.begin(), placed.landmarks.end());
    const auto add = [&](const Constraint& constraint) { constraints.emplace(constraint.id, constraint); };
    for (const MatchedKeyframe& match : matches)
      add(constraint_in_plane(ConstraintKind::extrinsic, match.laser.before->id, match.keyframe->id,
                              between(match.laser.before->map_from_node, match.laser.map_from_robot),
                              options.extrinsic_sigma_m, options.extrinsic_sigma_rad));
    for (const Constraint& covisible : covisibility_constraints(placed, options)) add(covisible);
    for (const auto& [id, constraint] : placed.constraints)
      if (id.kind == ConstraintKind::extrinsic) add(constraint);  // between cameras of the robot
  }
  for (auto& [id, node] : laser.nodes) nodes.emplace(id, std::move(node));
  for (auto& [id, constraint] : laser.constraints) constraints.emplace(id, std::move(constraint));
  result.map.id = laser.id;
  result.map.submaps = std::move(laser.submaps);
  for (auto& [id, node] : nodes) result.map.nodes.set(id, std::move(node));
  for (auto& [id, constraint] : constraints) result.map.constraints.set(id, std::move(constraint));
  for (auto& [id, landmark] : landmarks) result.map.landmarks.set(id, std::move(landmark));
  if (result.apart.size() < cameras.size()) graph::optimise(result.map, solve);
  return result;
}

}  // namespace mapweave::rig
