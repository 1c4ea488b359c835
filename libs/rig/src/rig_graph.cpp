#include "rig_graph.h"

#include <mapweave/graph/spatial_graph.h>
#include <mapweave/rig/covisibility.h>
#include <mapweave/rig/scale.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace mapweave::rig {
namespace {

constexpr double kSameScale = 1e-4;  // standard deviation where both sides are metric
constexpr double kFreeSigmas =
    2.0;  // a camera without depth counts less where it is farther off the rig's other cameras

struct RigEdge {
  std::uint32_t from, to;     // numbers of nodes
  Pose3 from_from_to;         // in the scale of `from` at the beginning
  double sigma_m, sigma_rad;  // in the group's scale
  double sigma_scale;         // of its change; 0: unknown
  ConstraintKind kind;
};

// A keyframe in a group. The scale is that from its part's own map to the group.
struct RigNode {
  const RigPart* part;
  std::size_t keyframe;
  Sim3 group_from_node;
};

// In time.
std::vector<MovedKeyframe>::const_iterator nearest(const std::vector<MovedKeyframe>& keyframes, Stamp stamp) {
  return std::min_element(keyframes.begin(), keyframes.end(), [&](const auto& a, const auto& b) {
    return std::abs(a.stamp.ns - stamp.ns) < std::abs(b.stamp.ns - stamp.ns);
  });
}

bool is_short(Stamp first, Stamp last) {
  constexpr double kLongest_s = 5.0;  // beyond, wheels drift more than a camera does
  return std::abs(seconds_between(first, last)) < kLongest_s;
}

// The factor on the sigmas of a motion that another one of the same robot contradicts.
double disagreement(const Pose3& seen, const Pose3& by_wheels) {
  // What wheels and a camera that are both right may differ by: noise, and wheels that slip a little.
  constexpr double kFree_m = 0.02, kFree_rad = 0.02, kFreeShare = 0.1;
  const double times = std::max({1.0, (seen.t - by_wheels.t).norm() / (kFree_m + kFreeShare * by_wheels.t.norm()),
                                 turn_rad(between(seen, by_wheels)) / (kFree_rad + kFreeShare * turn_rad(by_wheels))});
  return times * times;  // the farther off a motion is, the less it pulls
}

Eigen::Matrix<double, 6, 6> information(const RigEdge& edge, double scale) {
  Eigen::Matrix<double, 6, 6> result = Eigen::Matrix<double, 6, 6>::Zero();
  result.diagonal().head<3>().setConstant(scale * scale / (edge.sigma_m * edge.sigma_m));
  result.diagonal().tail<3>().setConstant(1.0 / (edge.sigma_rad * edge.sigma_rad));
  return result;
}

class RigGraph {
 public:
  RigGraph(const std::vector<RigPart>& parts, std::vector<std::size_t> members,
           const std::vector<StampedPose>& odometry, const RigOptions& options)
      : parts_(parts), members_(std::move(members)), odometry_(odometry), options_(options) {
    for (const std::size_t m : members_)
      for (std::size_t k = 0; k < parts_[m].ids.size(); ++k) {
        numbers_.emplace(parts_[m].ids[k], static_cast<std::uint32_t>(nodes_.size()));
        nodes_.push_back({&parts_[m], k, {parts_[m].keyframes[k].after, parts_[m].keyframes[k].scale}});
      }
    for (const std::size_t m : members_) add_covisibility(parts_[m]);
    for (const std::size_t m : members_)
      for (const std::size_t other : members_)
        if (parts_[m].camera != parts_[other].camera) add_extrinsics(parts_[m], parts_[other]);
  }

  RigMap merged() {
    RigMap result;
    result.members = members_;
    double farthest_m = 0.0, farthest_rad = 0.0;
    for (const RigEdge& edge : edges_) {
      if (edge.kind != ConstraintKind::extrinsic) continue;
      const Pose3 off = offset(edge);
      ++result.extrinsic_constraints;
      farthest_m = std::max(farthest_m, off.t.norm());
      farthest_rad = std::max(farthest_rad, turn_rad(off));
    }
    result.apart_before_m = apart_m(result.extrinsic_constraints);
    result.solved = farthest_m > options_.threshold_m || farthest_rad > options_.threshold_rad;
    if (result.solved) solve();
    result.apart_after_m = apart_m(result.extrinsic_constraints);
    result.map = map();
    for (const std::size_t m : members_) result.frames.push_back(moved_poses(parts_[m]));
    return result;
  }

 private:
  const MovedKeyframe& keyframe(std::uint32_t node) const {
    return nodes_[node].part->keyframes[nodes_[node].keyframe];
  }

  // The factor on the sigmas of a motion that wheel odometry contradicts.
  double disagreement_of_wheels(Stamp first, Stamp last, const Pose3& motion) const {
    if (!is_short(first, last)) return 1.0;
    const auto then = pose_at(odometry_, first, options_.longest_gap_s),
               now = pose_at(odometry_, last, options_.longest_gap_s);
    return then && now ? disagreement(motion, between(*then, *now)) : 1.0;
  }

  // The same for a covisibility edge; that of a camera without depth is also compared with the cameras that it was
  // placed along.
  double doubt(const RigEdge& edge, bool metric) const {
    const Stamp first = keyframe(edge.from).stamp, last = keyframe(edge.to).stamp;
    Pose3 own = edge.from_from_to;
    own.t *= nodes_[edge.from].group_from_node.scale;
    const double by_wheels = disagreement_of_wheels(first, last, own);
    const RigPart& base = parts_[members_.front()];
    if (metric || (!is_short(first, last) && !base.metric))
      return by_wheels;  // wheels drift, and loop closures correct that
    const double scale_change =
        std::abs(std::log(nodes_[edge.to].group_from_node.scale / nodes_[edge.from].group_from_node.scale));
    return std::max({by_wheels, sigmas_off(edge) / kFreeSigmas, scale_change / edge.sigma_scale / kFreeSigmas});
  }

  // The same for a motion of the wheels, by the camera that agrees most with it. Where no camera tracked, the robot may
  // have been carried.
  double disagreement_of_cameras(const MovedKeyframe& from, const MovedKeyframe& to) const {
    constexpr double kNobodySaw = 10.0;  // times the usual error, where no camera confirms the motion
    double least = kNobodySaw;
    for (const std::size_t m : members_) {
      if (parts_[m].wheels) continue;
      const auto then = virtual_keyframe(parts_[m], from.stamp, options_),
                 now = virtual_keyframe(parts_[m], to.stamp, options_);
      if (!then || !now) continue;
      Pose3 seen = between(then->own_from_robot, now->own_from_robot);
      const auto near = nearest(parts_[m].keyframes, from.stamp);
      seen = rescaled(seen, near->robot_from_camera, near->scale);
      least = std::min(least, disagreement(seen, between(from.before, to.before)));
    }
    return least;
  }

  void add_covisibility(const RigPart& part) {
    // Landmarks with which an edge has the usual sigmas (in between, as errors of so many independent ones); the factor
    // where no depth was measured; a sigma of the scale's logarithm at which it is unknown; wheels that stand still.
    constexpr double kUsuallyShared = 60.0, kWithoutDepth = 2.0, kMostScale = 1.0, kWheels_m = 0.005,
                     kWheels_rad = 0.005;
    for (const CovisibilityEdge& covisible : covisibility_edges(covisibility(*part.map), options_.least_shared)) {
      const std::uint32_t from = numbers_.at(covisible.from->id), to = numbers_.at(covisible.to->id);
      const double scale = nodes_[from].group_from_node.scale;
      Pose3 motion =
          rescaled(between(covisible.from->map_from_node, covisible.to->map_from_node), part.robot_from_camera, scale);
      const double length_m = motion.t.norm();
      motion.t /= scale;
      const double slack = (part.metric ? 1.0 : kWithoutDepth) *
                           std::clamp(std::sqrt(kUsuallyShared / static_cast<double>(covisible.shared + 1)), 0.7, 3.0);
      RigEdge edge{from,
                   to,
                   motion,
                   slack * (options_.covisibility_sigma_m + options_.covisibility_sigma_per_m * length_m),
                   slack * options_.covisibility_sigma_rad,
                   part.metric ? kSameScale : slack * options_.covisibility_sigma_scale,
                   ConstraintKind::scan_match};
      const double less = doubt(edge, part.metric);
      edge.sigma_m *= less;
      edge.sigma_rad *= less;
      if (!part.metric) edge.sigma_scale = std::min(kMostScale, edge.sigma_scale * less);
      edges_.push_back(edge);
    }
    for (std::size_t k = 1; part.wheels && k < part.ids.size(); ++k) {
      const Pose3 motion = between(part.keyframes[k - 1].before, part.keyframes[k].before);
      const double slack = disagreement_of_cameras(part.keyframes[k - 1], part.keyframes[k]);
      edges_.push_back({numbers_.at(part.ids[k - 1]), numbers_.at(part.ids[k]), motion,
                        slack * (kWheels_m + options_.wheels_share * motion.t.norm()),
                        slack * (kWheels_rad + options_.wheels_share * turn_rad(motion)), kSameScale,
                        ConstraintKind::odometry});
    }
  }

  // From virtual keyframes of `other`, each rigid with its keyframe that is nearest in time, to keyframes of `part`.
  void add_extrinsics(const RigPart& part, const RigPart& other) {
    for (std::size_t k = 0; k < part.ids.size(); ++k) {
      const Stamp stamp = part.keyframes[k].stamp;
      const auto seen = virtual_keyframe(other, stamp, options_);
      if (!seen) continue;
      const auto near = nearest(other.keyframes, stamp);
      std::uint32_t from = numbers_.at(other.ids[static_cast<std::size_t>(near - other.keyframes.begin())]),
                    to = numbers_.at(part.ids[k]);
      const Pose3 own = rescaled(between(near->before, seen->own_from_robot), near->robot_from_camera, near->scale);
      Pose3 motion{own.t / near->scale, own.q};
      if (part.metric && !other.metric) {  // else the scale could change to make errors small
        motion = inverse(own);
        std::swap(from, to);
      }
      const bool metric = part.metric && other.metric;
      RigEdge edge{from,
                   to,
                   motion,
                   seen->sigma_m + options_.covisibility_sigma_per_m * own.t.norm(),
                   seen->sigma_rad,
                   metric ? kSameScale : 0.0,
                   ConstraintKind::extrinsic};
      const double by_wheels = disagreement_of_wheels(near->stamp, stamp, own);
      const double less = metric ? by_wheels : std::max(by_wheels, sigmas_off(edge) / kFreeSigmas);
      edge.sigma_m *= less;
      edge.sigma_rad *= less;
      edges_.push_back(edge);
    }
  }

  // The error of an edge, in the group's scale.
  Pose3 offset(const RigEdge& edge) const {
    const Sim3 &from = nodes_[edge.from].group_from_node, &to = nodes_[edge.to].group_from_node;
    Pose3 measured = edge.from_from_to;
    measured.t *= from.scale;
    return between(measured, between(from.pose, to.pose));
  }
  double sigmas_off(const RigEdge& edge) const {
    const Pose3 off = offset(edge);
    return std::max(off.t.norm() / edge.sigma_m, turn_rad(off) / edge.sigma_rad);
  }
  double apart_m(std::size_t count) const {
    double sum = 0.0;
    for (const RigEdge& edge : edges_)
      if (edge.kind == ConstraintKind::extrinsic) sum += offset(edge).t.squaredNorm();
    return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
  }

  void solve() {
    if (std::all_of(members_.begin(), members_.end(), [&](std::size_t m) { return parts_[m].metric; })) {
      std::vector<Pose3> poses;
      std::vector<graph::SpatialEdge> spatial;
      for (const RigNode& node : nodes_) poses.push_back(node.group_from_node.pose);
      for (const RigEdge& edge : edges_)
        spatial.push_back({edge.from, edge.to, edge.from_from_to, information(edge, 1.0)});
      const graph::SpatialSolution solution = graph::solve(poses, spatial);
      for (std::size_t i = 0; i < nodes_.size(); ++i) nodes_[i].group_from_node.pose = solution.poses[i];
      return;
    }
    std::vector<Sim3> poses;
    std::vector<graph::SimilarityEdge> similar;
    for (const RigNode& node : nodes_) poses.push_back(node.group_from_node);
    for (const RigEdge& edge : edges_) {
      const Sim3 &from = nodes_[edge.from].group_from_node, &to = nodes_[edge.to].group_from_node;
      const bool alone = edge.sigma_scale == 0.0;
      graph::SimilarityEdge one{edge.from, edge.to, {edge.from_from_to, alone ? to.scale / from.scale : 1.0}, {}};
      one.information.setZero();
      one.information.topLeftCorner<6, 6>() = information(edge, one.from_from_to.scale * from.scale);
      if (!alone) one.information(6, 6) = 1.0 / (edge.sigma_scale * edge.sigma_scale);
      similar.push_back(one);
    }
    const graph::SimilaritySolution solution = graph::solve(poses, similar);
    for (std::size_t i = 0; i < nodes_.size(); ++i) nodes_[i].group_from_node = solution.poses[i];
  }

  Map map() const {
    Map result;
    result.id = parts_[members_.front()].map->id;
    std::map<NodeId, Node> nodes;
    std::map<LandmarkId, Landmark> landmarks;
    std::map<ConstraintId, Constraint> constraints;
    for (const std::size_t m : members_) {
      if (parts_[m].wheels) continue;
      for (auto [id, node] : parts_[m].map->nodes) {
        node.map_from_node = nodes_[numbers_.at(id)].group_from_node.pose;
        nodes.emplace(id, std::move(node));
      }
      for (auto [id, landmark] : parts_[m].map->landmarks) {
        const double scale = nodes_[numbers_.at(landmark.anchor)].group_from_node.scale;
        if (scale != 1.0)
          landmark.point_units =
              landmark_units(rescaled(landmark.point_in_anchor(), parts_[m].robot_from_camera, scale));
        landmarks.emplace(id, std::move(landmark));
      }
    }
    for (const RigEdge& edge : edges_) {
      const RigNode &from = nodes_[edge.from], &to = nodes_[edge.to];
      if (from.part->wheels || to.part->wheels) continue;
      Constraint constraint;
      constraint.id = {edge.kind, from.part->ids[from.keyframe], to.part->ids[to.keyframe], 0};
      constraint.from_from_to.pose = edge.from_from_to;
      constraint.from_from_to.pose.t *= from.group_from_node.scale;
      constraint.information = information(edge, 1.0);
      constraints.emplace(constraint.id, constraint);
    }
    for (auto& [id, node] : nodes) result.nodes.set(id, std::move(node));
    for (auto& [id, landmark] : landmarks) result.landmarks.set(id, std::move(landmark));
    for (auto& [id, constraint] : constraints) result.constraints.set(id, std::move(constraint));
    return result;
  }

  std::vector<StampedPose> moved_poses(const RigPart& part) const {
    std::vector<MovedKeyframe> keyframes = part.keyframes;
    for (std::size_t k = 0; k < keyframes.size(); ++k) {
      const Sim3& node = nodes_[numbers_.at(part.ids[k])].group_from_node;
      keyframes[k].after = node.pose;
      keyframes[k].scale = node.scale;
    }
    return moved_with_keyframes(part.poses, keyframes);
  }

  const std::vector<RigPart>& parts_;
  std::vector<std::size_t> members_;
  const std::vector<StampedPose>& odometry_;
  const RigOptions& options_;
  std::vector<RigNode> nodes_;
  std::map<NodeId, std::uint32_t> numbers_;
  std::vector<RigEdge> edges_;
};

}  // namespace

RigMap solve_rig_graph(const std::vector<RigPart>& parts, const std::vector<std::size_t>& members,
                       const std::vector<StampedPose>& odometry, const RigOptions& options) {
  return RigGraph(parts, members, odometry, options).merged();
}

}  // namespace mapweave::rig
