#include "rig_graph.h"
#include "covisibility.h"
#include "lengths.h"

#include <mapweave/graph/spatial_graph.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace mapweave::fusion {
namespace {

struct Tie {
  std::uint32_t from, to;     // numbers of knots
  Pose3 from_from_to;         // in the lengths of `from`, as they are when it is made
  double sigma_m, sigma_rad;  // in the group's lengths
  double sigma_scale;         // by which lengths may change; 0: nothing is known of that
  ConstraintKind kind;
};
constexpr double kSameLengths = 1e-4;  // both sides measure them

constexpr double kFreeSigmas = 2.0;  // where a camera without depth lies farther off its siblings, it counts less

// A keyframe in a group. Its own lengths, as `placed` has them, are `scale` times as long in the group.
struct Knot {
  const Part* part;
  std::size_t keyframe;
  Sim3 group_from_node;
};

class Group {
 public:
  Group(const std::vector<Part>& parts, std::vector<std::size_t> members, const std::vector<StampedPose>& odometry,
        const RigOptions& options)
      : parts_(parts), members_(std::move(members)), odometry_(odometry), options_(options) {
    for (const std::size_t m : members_)
      for (std::size_t k = 0; k < parts_[m].ids.size(); ++k) {
        numbers_.emplace(parts_[m].ids[k], static_cast<std::uint32_t>(knots_.size()));
        knots_.push_back({&parts_[m], k, {parts_[m].keyframes[k].after, parts_[m].keyframes[k].scale}});
      }
    for (const std::size_t m : members_) add_steps(parts_[m]);
    for (const std::size_t m : members_)
      for (const std::size_t other : members_)
        if (parts_[m].camera != parts_[other].camera) add_ties(parts_[m], parts_[other]);
  }

  TiedMap told() {
    TiedMap result;
    result.members = members_;
    double farthest_m = 0.0, farthest_rad = 0.0;
    for (const Tie& tie : ties_) {
      if (tie.kind != ConstraintKind::extrinsic) continue;
      const Pose3 off = offset(tie);
      ++result.ties;
      farthest_m = std::max(farthest_m, off.t.norm()), farthest_rad = std::max(farthest_rad, turn_rad(off));
    }
    result.apart_before_m = apart_m(result.ties);
    result.solved = farthest_m > options_.threshold_m || farthest_rad > options_.threshold_rad;
    if (result.solved) solve();
    result.apart_after_m = apart_m(result.ties);
    result.map = map();
    for (const std::size_t m : members_) result.frames.push_back(moved_poses(parts_[m]));
    return result;
  }

 private:
  const MovedKeyframe& keyframe(std::uint32_t knot) const { return knots_[knot].part->keyframes[knots_[knot].keyframe]; }

  // By how much less a way counts that wheels say was another one.
  double by_wheels(Stamp first, Stamp last, const Pose3& way) const {
    if (!is_short(first, last)) return 1.0;
    const auto then = pose_at(odometry_, first, options_.longest_gap_s), now = pose_at(odometry_, last, options_.longest_gap_s);
    return then && now ? unlike(way, between(*then, *now)) : 1.0;
  }
  static bool is_short(Stamp first, Stamp last) {
    constexpr double kLongest_s = 5.0;
    return std::abs(seconds_between(first, last)) < kLongest_s;
  }

  // The same for a step; of a camera without depth also by siblings that it was placed along.
  double doubt(const Tie& step, bool metric) const {
    const Stamp first = keyframe(step.from).stamp, last = keyframe(step.to).stamp;
    Pose3 own = step.from_from_to;
    own.t *= knots_[step.from].group_from_node.scale;
    const double rolled = by_wheels(first, last, own);
    const Part& base = parts_[members_.front()];
    if (metric || (!is_short(first, last) && !base.metric)) return rolled;  // wheels drift, and loops are to mend that
    const double stretched = std::abs(std::log(knots_[step.to].group_from_node.scale / knots_[step.from].group_from_node.scale));
    return std::max({rolled, sigmas_off(step) / kFreeSigmas, stretched / step.sigma_scale / kFreeSigmas});
  }
  static double unlike(const Pose3& seen, const Pose3& rolled) {
    constexpr double kFree_m = 0.02, kFree_rad = 0.02, kFreeShare = 0.1;
    const double times = std::max({1.0, (seen.t - rolled.t).norm() / (kFree_m + kFreeShare * rolled.t.norm()),
                                   turn_rad(between(seen, rolled)) / (kFree_rad + kFreeShare * turn_rad(rolled))});
    return times * times;  // so that what is far off pulls less the farther it is
  }

  // The same for a step of wheels: by the camera that agrees most with it. Where all are blind it may have been carried.
  double seen_otherwise(const MovedKeyframe& from, const MovedKeyframe& to) const {
    constexpr double kNobodySaw = 10.0;
    double least = kNobodySaw;
    for (const std::size_t m : members_) {
      if (parts_[m].wheels) continue;
      const auto then = virtual_keyframe(parts_[m], from.stamp, options_), now = virtual_keyframe(parts_[m], to.stamp, options_);
      if (!then || !now) continue;
      Pose3 seen = between(then->own_from_robot, now->own_from_robot);
      const auto near = std::min_element(parts_[m].keyframes.begin(), parts_[m].keyframes.end(), [&](const auto& a, const auto& b) {
        return std::abs(a.stamp.ns - from.stamp.ns) < std::abs(b.stamp.ns - from.stamp.ns);
      });
      seen = in_lengths(seen, near->robot_from_camera, near->scale);
      least = std::min(least, unlike(seen, between(from.before, to.before)));
    }
    return least;
  }

  void add_steps(const Part& part) {
    constexpr double kUsuallyShared = 60.0, kWithoutDepth = 2.0, kMostScale = 1.0, kWheels_m = 0.005, kWheels_rad = 0.005;
    for (const Step& step : steps(covisibility(*part.map), options_.least_shared)) {
      const std::uint32_t from = numbers_.at(step.from->id), to = numbers_.at(step.to->id);
      const double scale = knots_[from].group_from_node.scale;
      Pose3 way = in_lengths(between(step.from->map_from_node, step.to->map_from_node), part.robot_from_camera, scale);
      const double length_m = way.t.norm();
      way.t /= scale;
      const double slack =
          (part.metric ? 1.0 : kWithoutDepth) * std::clamp(std::sqrt(kUsuallyShared / static_cast<double>(step.shared + 1)), 0.7, 3.0);
      Tie tie{from,
              to,
              way,
              slack * (options_.step_m + options_.step_share * length_m),
              slack * options_.step_rad,
              part.metric ? kSameLengths : slack * options_.step_scale,
              ConstraintKind::scan_match};
      const double less = doubt(tie, part.metric);
      tie.sigma_m *= less, tie.sigma_rad *= less;
      if (!part.metric) tie.sigma_scale = std::min(kMostScale, tie.sigma_scale * less);
      ties_.push_back(tie);
    }
    for (std::size_t k = 1; part.wheels && k < part.ids.size(); ++k) {
      const Pose3 way = between(part.keyframes[k - 1].before, part.keyframes[k].before);
      const double slack = seen_otherwise(part.keyframes[k - 1], part.keyframes[k]);
      ties_.push_back({numbers_.at(part.ids[k - 1]), numbers_.at(part.ids[k]), way,
                       slack * (kWheels_m + options_.wheels_share * way.t.norm()),
                       slack * (kWheels_rad + options_.wheels_share * turn_rad(way)), kSameLengths, ConstraintKind::odometry});
    }
  }

  // Keyframes of `part` to virtual ones of `sibling`, which hang on its keyframe that is nearest in time.
  void add_ties(const Part& part, const Part& sibling) {
    for (std::size_t k = 0; k < part.ids.size(); ++k) {
      const Stamp stamp = part.keyframes[k].stamp;
      const auto seen = virtual_keyframe(sibling, stamp, options_);
      if (!seen) continue;
      const auto near = std::min_element(sibling.keyframes.begin(), sibling.keyframes.end(), [&](const auto& a, const auto& b) {
        return std::abs(a.stamp.ns - stamp.ns) < std::abs(b.stamp.ns - stamp.ns);
      });
      std::uint32_t from = numbers_.at(sibling.ids[static_cast<std::size_t>(near - sibling.keyframes.begin())]),
                    to = numbers_.at(part.ids[k]);
      const Pose3 own = in_lengths(between(near->before, seen->own_from_robot), near->robot_from_camera, near->scale);
      Pose3 way{own.t / near->scale, own.q};
      if (part.metric && !sibling.metric) {  // else lengths could grow to make errors small
        way = inverse(own);
        std::swap(from, to);
      }
      const bool metric = part.metric && sibling.metric;
      Tie tie{from,
              to,
              way,
              seen->sigma_m + options_.step_share * own.t.norm(),
              seen->sigma_rad,
              metric ? kSameLengths : 0.0,
              ConstraintKind::extrinsic};
      const double rolled = by_wheels(near->stamp, stamp, own);
      const double less = metric ? rolled : std::max(rolled, sigmas_off(tie) / kFreeSigmas);
      tie.sigma_m *= less, tie.sigma_rad *= less;
      ties_.push_back(tie);
    }
  }

  // In the group's lengths.
  Pose3 offset(const Tie& tie) const {
    const Sim3 &from = knots_[tie.from].group_from_node, &to = knots_[tie.to].group_from_node;
    const Pose3 lies = between(from.pose, to.pose);
    Pose3 said = tie.from_from_to;
    said.t *= from.scale;
    return between(said, lies);
  }
  double sigmas_off(const Tie& tie) const {
    const Pose3 off = offset(tie);
    return std::max(off.t.norm() / tie.sigma_m, turn_rad(off) / tie.sigma_rad);
  }
  double apart_m(std::size_t count) const {
    double sum = 0.0;
    for (const Tie& tie : ties_)
      if (tie.kind == ConstraintKind::extrinsic) sum += offset(tie).t.squaredNorm();
    return count > 0 ? std::sqrt(sum / static_cast<double>(count)) : 0.0;
  }

  static Eigen::Matrix<double, 6, 6> information(const Tie& tie, double lengths) {
    Eigen::Matrix<double, 6, 6> result = Eigen::Matrix<double, 6, 6>::Zero();
    result.diagonal().head<3>().setConstant(lengths * lengths / (tie.sigma_m * tie.sigma_m));
    result.diagonal().tail<3>().setConstant(1.0 / (tie.sigma_rad * tie.sigma_rad));
    return result;
  }

  void solve() {
    if (std::all_of(members_.begin(), members_.end(), [&](std::size_t m) { return parts_[m].metric; })) {
      std::vector<Pose3> poses;
      std::vector<graph::SpatialEdge> edges;
      for (const Knot& knot : knots_) poses.push_back(knot.group_from_node.pose);
      for (const Tie& tie : ties_) edges.push_back({tie.from, tie.to, tie.from_from_to, information(tie, 1.0)});
      const graph::SpatialSolution solution = graph::solve(poses, edges);
      for (std::size_t i = 0; i < knots_.size(); ++i) knots_[i].group_from_node.pose = solution.poses[i];
      return;
    }
    std::vector<Sim3> poses;
    std::vector<graph::SimilarityEdge> edges;
    for (const Knot& knot : knots_) poses.push_back(knot.group_from_node);
    for (const Tie& tie : ties_) {
      const Sim3 &from = knots_[tie.from].group_from_node, &to = knots_[tie.to].group_from_node;
      const bool alone = tie.sigma_scale == 0.0;
      graph::SimilarityEdge edge{tie.from, tie.to, {tie.from_from_to, alone ? to.scale / from.scale : 1.0}, {}};
      edge.information.setZero();
      edge.information.topLeftCorner<6, 6>() = information(tie, edge.from_from_to.scale * from.scale);
      if (!alone) edge.information(6, 6) = 1.0 / (tie.sigma_scale * tie.sigma_scale);
      edges.push_back(edge);
    }
    const graph::SimilaritySolution solution = graph::solve(poses, edges);
    for (std::size_t i = 0; i < knots_.size(); ++i) knots_[i].group_from_node = solution.poses[i];
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
        node.map_from_node = knots_[numbers_.at(id)].group_from_node.pose;
        nodes.emplace(id, std::move(node));
      }
      for (auto [id, landmark] : parts_[m].map->landmarks) {
        const double scale = knots_[numbers_.at(landmark.anchor)].group_from_node.scale;
        if (scale != 1.0) landmark.point_units = landmark_units(in_lengths(landmark.point_in_anchor(), parts_[m].robot_from_camera, scale));
        landmarks.emplace(id, std::move(landmark));
      }
    }
    for (const Tie& tie : ties_) {
      const Knot &from = knots_[tie.from], &to = knots_[tie.to];
      if (from.part->wheels || to.part->wheels) continue;
      Constraint constraint;
      constraint.id = {tie.kind, from.part->ids[from.keyframe], to.part->ids[to.keyframe], 0};
      constraint.from_from_to.pose = tie.from_from_to;
      constraint.from_from_to.pose.t *= from.group_from_node.scale;
      constraint.information = information(tie, 1.0);
      constraints.emplace(constraint.id, constraint);
    }
    for (auto& [id, node] : nodes) result.nodes.set(id, std::move(node));
    for (auto& [id, landmark] : landmarks) result.landmarks.set(id, std::move(landmark));
    for (auto& [id, constraint] : constraints) result.constraints.set(id, std::move(constraint));
    return result;
  }

  std::vector<StampedPose> moved_poses(const Part& part) const {
    std::vector<MovedKeyframe> keyframes = part.keyframes;
    for (std::size_t k = 0; k < keyframes.size(); ++k) {
      const Sim3& knot = knots_[numbers_.at(part.ids[k])].group_from_node;
      keyframes[k].after = knot.pose, keyframes[k].scale = knot.scale;
    }
    return carried_along(part.poses, keyframes);
  }

  const std::vector<Part>& parts_;
  std::vector<std::size_t> members_;
  const std::vector<StampedPose>& odometry_;
  const RigOptions& options_;
  std::vector<Knot> knots_;
  std::map<NodeId, std::uint32_t> numbers_;
  std::vector<Tie> ties_;
};

}  // namespace

TiedMap tied_map(const std::vector<Part>& parts, const std::vector<std::size_t>& members, const std::vector<StampedPose>& odometry,
                 const RigOptions& options) {
  return Group(parts, members, odometry, options).told();
}

}  // namespace mapweave::fusion
