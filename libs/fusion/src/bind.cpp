#include "covisibility.h"

#include <mapweave/fusion/bind.h>

#include <mapweave/matching/rigid_from_points.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace mapweave::fusion {
namespace {

using Eigen::Vector3d;

// Where the laser has the robot, by time.
class LaserWay {
 public:
  explicit LaserWay(const Map& laser) {
    for (const auto& [id, node] : laser.nodes) nodes_.push_back(&node);
    std::stable_sort(nodes_.begin(), nodes_.end(), [](const Node* a, const Node* b) { return a->stamp < b->stamp; });
  }
  struct Place {
    const Node* before;
    Pose3 map_from_robot;
  };
  std::optional<Place> at(Stamp stamp, double longest_gap_s) const {
    const auto later = std::lower_bound(nodes_.begin(), nodes_.end(), stamp, [](const Node* node, Stamp s) { return node->stamp < s; });
    if (later == nodes_.end()) return std::nullopt;
    if ((*later)->stamp == stamp) return Place{*later, (*later)->map_from_node};
    if (later == nodes_.begin()) return std::nullopt;
    const Node &before = **(later - 1), &after = **later;
    const double gap_s = seconds_between(before.stamp, after.stamp);
    if (gap_s > longest_gap_s) return std::nullopt;
    const double share = seconds_between(before.stamp, stamp) / gap_s;
    return Place{&before,
                 {before.map_from_node.t + share * (after.map_from_node.t - before.map_from_node.t),
                  before.map_from_node.q.slerp(share, after.map_from_node.q)}};
  }

 private:
  std::vector<const Node*> nodes_;
};

struct Pair {
  const Node* keyframe;
  LaserWay::Place place;
};

// How the camera's map lies in the laser's: poses are paired by time.
Sim3 laser_from_camera(const std::vector<Pair>& pairs, bool scale_is_known) {
  Sim3 result;
  if (!scale_is_known) {
    double by_laser = 0.0, by_camera = 0.0;
    for (std::size_t i = 1; i < pairs.size(); ++i) {
      by_laser += (pairs[i].place.map_from_robot.t - pairs[i - 1].place.map_from_robot.t).norm();
      by_camera += (pairs[i].keyframe->map_from_node.t - pairs[i - 1].keyframe->map_from_node.t).norm();
    }
    constexpr double kLeastWay_m = 0.5;
    if (by_laser > kLeastWay_m && by_camera > 0.0) result.scale = by_laser / by_camera;
  }
  // Each pose counts with the tips of its axes, so that a robot that turned on the spot is enough.
  std::vector<matching::PointPair> points;
  for (const Pair& pair : pairs)
    for (const Vector3d& tip : {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)})
      points.push_back({transformed(tip, pair.place.map_from_robot),
                        result.scale * pair.keyframe->map_from_node.t + pair.keyframe->map_from_node.q * tip, 1.0});
  const auto aligned = matching::align_points(points, matching::Freedom::rigid);
  result.pose = aligned ? aligned->pose : compose(pairs.front().place.map_from_robot, inverse(pairs.front().keyframe->map_from_node));
  return result;
}

// Keyframes that see the same, and one and the next.
std::vector<std::pair<NodeId, NodeId>> neighbours(const Map& camera, int least_shared) {
  constexpr std::size_t kMostNeighbours = 5;
  const Covisibility seen = covisibility(camera);
  std::vector<std::pair<NodeId, NodeId>> result;
  for (std::size_t i = 1; i < seen.keyframes.size(); ++i) {
    std::size_t count = 0;
    bool to_the_last = false;
    for (const auto& [landmarks, other] : seen.shared[i]) {
      if (other > i || count == kMostNeighbours || landmarks < static_cast<std::size_t>(least_shared)) continue;
      result.emplace_back(seen.keyframes[other]->id, seen.keyframes[i]->id);
      ++count, to_the_last = to_the_last || other + 1 == i;
    }
    if (!to_the_last) result.emplace_back(seen.keyframes[i - 1]->id, seen.keyframes[i]->id);
  }
  return result;
}

Constraint constraint_of(ConstraintKind kind, const NodeId& from, const NodeId& to, const Pose3& from_from_to, double sigma_m,
                         double sigma_rad) {
  const double m = 1.0 / (sigma_m * sigma_m), rad = 1.0 / (sigma_rad * sigma_rad);
  return planar_constraint({kind, from, to, 0}, planar(from_from_to), Eigen::Vector3d(m, m, rad).asDiagonal());
}

}  // namespace

BoundMap bound(Map laser, const std::vector<Map>& cameras, const BindOptions& options, const graph::SolveOptions& solve) {
  BoundMap result;
  const LaserWay way(laser);
  std::map<NodeId, Node> nodes;
  std::map<ConstraintId, Constraint> constraints;
  std::map<LandmarkId, Landmark> landmarks;
  for (const Map& camera : cameras) {
    std::vector<Pair> pairs;
    for (const auto& [id, node] : camera.nodes)
      if (const auto place = way.at(node.stamp, options.longest_gap_s)) pairs.push_back({&node, *place});
    if (pairs.empty()) {
      result.apart.push_back(camera.id);
      continue;
    }
    const Sim3 laser_from_map = laser_from_camera(pairs, is_metric(camera));
    const auto moved = [&](const Pose3& pose) { return compose(laser_from_map.pose, Pose3{laser_from_map.scale * pose.t, pose.q}); };
    for (const auto& [id, node] : camera.nodes) {
      Node placed = node;
      placed.map_from_node = moved(node.map_from_node);
      nodes.emplace(id, std::move(placed));
    }
    for (auto [id, landmark] : camera.landmarks) {
      if (laser_from_map.scale != 1.0) landmark.point_units = landmark_units(laser_from_map.scale * landmark.point_in_anchor());
      landmarks.emplace(id, std::move(landmark));
    }
    const auto add = [&](const Constraint& constraint) { constraints.emplace(constraint.id, constraint); };
    for (const Pair& pair : pairs)
      add(constraint_of(ConstraintKind::extrinsic, pair.place.before->id, pair.keyframe->id,
                        between(pair.place.before->map_from_node, pair.place.map_from_robot), options.tie_m, options.tie_rad));
    for (const auto& [from, to] : neighbours(camera, options.least_shared)) {
      const Pose3 step = between(nodes.at(from).map_from_node, nodes.at(to).map_from_node);
      add(constraint_of(ConstraintKind::scan_match, from, to, step, options.step_m + options.step_share * step.t.norm(), options.step_rad));
    }
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

}  // namespace mapweave::fusion
