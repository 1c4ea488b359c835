#include "aligned_ways.h"
#include "covisibility.h"
#include "lengths.h"
#include "ties.h"

#include <mapweave/core/stamped_pose.h>
#include <mapweave/fusion/bind.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace mapweave::fusion {
namespace {

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
    return Place{&before, interpolated(before.map_from_node, after.map_from_node, seconds_between(before.stamp, stamp) / gap_s)};
  }

 private:
  std::vector<const Node*> nodes_;
};

struct Pair {
  const Node* keyframe;
  LaserWay::Place place;
};

// Where the camera's map lies once its lengths are so many times as long, which its way tells: the robot's has turns about the base in it.
Sim3 beside(const std::vector<Pair>& pairs, const Map& camera) {
  std::vector<PosePair> both;
  double scale = 1.0;
  if (!is_metric(camera)) {
    const Pose3 robot_from_camera = mounting_of(camera);
    for (const Pair& pair : pairs)
      both.push_back({compose(pair.place.map_from_robot, robot_from_camera), compose(pair.keyframe->map_from_node, robot_from_camera)});
    scale = scale_of_ways(both).value_or(1.0);
    both.clear();
    for (const Pair& pair : pairs)
      both.push_back({pair.place.map_from_robot, in_lengths(pair.keyframe->map_from_node, robot_from_camera, scale)});
  } else {
    for (const Pair& pair : pairs) both.push_back({pair.place.map_from_robot, pair.keyframe->map_from_node});
  }
  return {aligned(both, 1.0).pose, scale};
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
    const Sim3 laser_from_grown = beside(pairs, camera);
    Map placed = in_lengths(camera, laser_from_grown.scale);
    for (auto& [id, node] : placed.nodes) {
      node.map_from_node = compose(laser_from_grown.pose, node.map_from_node);
      nodes.emplace(id, node);
    }
    landmarks.insert(placed.landmarks.begin(), placed.landmarks.end());
    const auto add = [&](const Constraint& constraint) { constraints.emplace(constraint.id, constraint); };
    for (const Pair& pair : pairs)
      add(constraint_of(ConstraintKind::extrinsic, pair.place.before->id, pair.keyframe->id,
                        between(pair.place.before->map_from_node, pair.place.map_from_robot), options.tie_m, options.tie_rad));
    for (const Constraint& step : steps_of(placed, options)) add(step);
    for (const auto& [id, constraint] : placed.constraints)
      if (id.kind == ConstraintKind::extrinsic) add(constraint);  // of several cameras of the robot
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
