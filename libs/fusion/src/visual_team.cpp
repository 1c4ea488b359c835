#include "visual_team.h"
#include "shared_landmarks.h"
#include "warm_start.h"

#include <mapweave/core/disjoint_sets.h>
#include <mapweave/core/error.h>
#include <mapweave/graph/bundle_adjustment.h>
#include <mapweave/graph/spatial_graph.h>
#include <mapweave/maps/map_noise.h>
#include <mapweave/rig/scale.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

namespace mapweave::fusion {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr std::size_t kCovisible = 5;  // covisible keyframes that each is constrained to in the graph
// Between keyframes in a row, of what their client found. Clients know systematic errors of their sensors that a bundle
// of all does not, so there the shapes that they found hardly bend.
constexpr double kStiff = 0.1;
constexpr std::size_t kLookedAt = 6;  // keyframes of other maps whose landmarks are looked for in each
constexpr double kSameView_rad = 0.9;
constexpr double kWide_px = 20.0, kNarrow_px = 6.0;
constexpr double kLeastGain = 3e-3,
                 kRoughGain = 2e-2;   // of an iteration of the bundle of all, in the last round and before
constexpr std::size_t kOfOneMap = 3;  // sightings of a landmark while maps are laid on each other
constexpr auto kAll = static_cast<std::size_t>(-1);
constexpr std::size_t kAtOnce = 600,
                      kPart = 300;       // keyframes that a preview adjusts at once; else in parts of about so many
constexpr std::size_t kLeastFound = 12;  // in one keyframe, from all its neighbours

// A keyframe in the team.
struct TeamKeyframe {
  std::size_t member = 0;
  const MappedKeyframe* content = nullptr;
  std::size_t first_landmark = 0;  // number in the team of its map's first
  double depth_m = 1.0;            // middle one of what it sees
  Pose3 team_from_node;
  Pose3 team_from_camera() const { return compose(team_from_node, content->content->geometry->robot_from_camera); }
};

struct ViewingRay {
  Vector3d from, along;  // of a camera, in the team's frame; along: of length 1
};

struct SharedSighting {
  std::size_t keyframe, feature, landmark;  // numbers in the team
};

class Team {
 public:
  Team(const std::vector<const VisualMap*>& members, const std::vector<VisualJoin>& joins,
       const std::vector<Sim3>& team_from_map, const std::vector<ClaimedSighting>& claimed,
       const VisualFusionOptions& options)
      : members_(members), joins_(joins), team_from_map_(team_from_map), claimed_(claimed), options_(options) {
    for (std::size_t m = 0; m < members.size(); ++m) {
      first_keyframe_.push_back(keyframes_.size());
      const std::size_t first_landmark = landmark_ids_.size();
      for (const MappedLandmark& landmark : members[m]->landmarks()) {
        landmark_ids_.push_back(landmark.id);
        landmark_member_.push_back(m);
        landmark_keyframe_.push_back(members[m]->number_of(members[m]->map().landmarks.find(landmark.id)->anchor) +
                                     first_keyframe_[m]);
      }
      const Pose3 robot_from_camera = rig::extrinsics_of(members[m]->map());
      for (const MappedKeyframe& keyframe : members[m]->keyframes())
        keyframes_.push_back({m, &keyframe, first_landmark, 1.0,
                              rig::moved_with_camera(team_from_map[m], keyframe.map_from_node, robot_from_camera)});
    }
    is_free_.assign(keyframes_.size(), true);
    for (TeamKeyframe& keyframe : keyframes_) keyframe.depth_m = middle_depth(keyframe);
    for (const VisualMap* member : members) rigs_.push_back(rig_of(*member));
  }

  VisualTeam run(const PreviousMerge* before) {
    const bool is_again = before != nullptr && before->is_adjusted_again;
    if (before != nullptr && (!is_again || keyframes_.size() > kAtOnce))
      if (const auto start = warm_start(*before, members_, joins_))
        return is_again ? adjusted_again(*start) : extended(*start);
    correct_loops();
    shape_ = shape_constraints(kStiff);
    place_landmarks();
    for (int round = 0; round < options_.adjustments; ++round) {
      const double radius_px = round == 0 ? kWide_px : kNarrow_px;
      find_shared(radius_px);
      const bool is_last = round + 1 == options_.adjustments;
      if (before != nullptr && is_last && keyframes_.size() > kAtOnce)
        adjust_in_parts(radius_px);
      else
        adjust_all(radius_px, is_last ? Extent::all : Extent::shared);
    }
    return result();
  }

 private:
  void begin_at(const WarmStart& start) {
    for (std::size_t i = 0; i < keyframes_.size(); ++i) keyframes_[i].team_from_node = start.team_from_node[i];
  }

  VisualTeam extended(const WarmStart& start) {
    begin_at(start);
    is_free_ = start.is_free;
    shape_ = shape_constraints(kStiff);
    place_landmarks();
    if (!start.newcomers.empty()) {
      find_shared(kWide_px, start.newcomers);
      adjust_all(kWide_px, Extent::free);
    }
    find_shared(kNarrow_px);
    adjust_all(kNarrow_px, Extent::free);
    return result();
  }

  VisualTeam adjusted_again(const WarmStart& start) {
    begin_at(start);
    correct_loops();
    shape_ = shape_constraints(kStiff);
    place_landmarks();
    find_shared(kNarrow_px);
    adjust_in_parts(kNarrow_px);
    return result();
  }

  // One part after the other, while the rest stays: what that costs grows as the team, where all at once costs far
  // more.
  void adjust_in_parts(double radius_px) {
    const std::size_t parts = (keyframes_.size() + kPart - 1) / kPart;
    for (std::size_t part = 0; part < parts; ++part) {
      for (std::size_t i = 0; i < keyframes_.size(); ++i) is_free_[i] = i * parts / keyframes_.size() == part;
      adjust_all(radius_px, Extent::free);
    }
  }

  // What ties its cameras to each other.
  static std::vector<const Constraint*> rig_of(const VisualMap& member) {
    std::vector<const Constraint*> result;
    const auto is_keyframe = [&](const NodeId& id) { return member.number_of(id) < member.keyframes().size(); };
    for (const auto& [id, constraint] : member.map().constraints)
      if (id.kind == ConstraintKind::extrinsic && is_keyframe(id.from) && is_keyframe(id.to) &&
          constraint.information(0, 0) > 0.0 && constraint.information(5, 5) > 0.0)
        result.push_back(&constraint);
    return result;
  }

  // Whether they are of two cameras that are tied: the last keyframe of one and the first of the other say nothing of
  // each other.
  bool are_of_one_rig(std::size_t a, std::size_t b) const {
    const SessionId &one = keyframes_[a].content->id.session, &other = keyframes_[b].content->id.session;
    const auto& rig = rigs_[keyframes_[a].member];
    return one != other && std::any_of(rig.begin(), rig.end(), [&](const Constraint* rigid) {
             return (rigid->id.from.session == one && rigid->id.to.session == other) ||
                    (rigid->id.from.session == other && rigid->id.to.session == one);
           });
  }

  double scale_of(std::size_t member) const { return team_from_map_[member].scale; }
  MetricWitness in_team(const VisualJoin& join, const VisualWitness& w) const {
    return rescaled(w, *members_[join.a], *members_[join.b], scale_of(join.a), scale_of(join.b));
  }

  double middle_depth(const TeamKeyframe& keyframe) const {
    std::vector<double> depths;
    const Pose3 camera_from_map = inverse(keyframe.content->map_from_camera);
    for (const std::int32_t landmark : keyframe.content->landmark_of_feature)
      if (landmark >= 0)
        depths.push_back(
            transformed(members_[keyframe.member]->landmarks()[static_cast<std::size_t>(landmark)].point_in_map,
                        camera_from_map)
                .z());
    if (depths.empty()) return 1.0;
    const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
    std::nth_element(depths.begin(), middle, depths.end());
    return scale_of(keyframe.member) * std::max(0.1, *middle);
  }

  // How keyframes lay in their own maps: of those that see the same, of one and the next, and of cameras of one robot
  // at the same time.
  std::vector<graph::RelativePoseConstraint> shape_constraints(double stiffness) const {
    std::vector<graph::RelativePoseConstraint> result;
    const auto add_constraint = [&](std::size_t from, std::size_t to, double slack) {
      const Pose3 from_from_to = between(keyframes_[from].team_from_node, keyframes_[to].team_from_node);
      result.push_back(
          {static_cast<std::uint32_t>(from), static_cast<std::uint32_t>(to), from_from_to,
           stiffness * slack * (kCovisibleMotion.sigma_m + kCovisibleMotion.sigma_per_m * from_from_to.t.norm()),
           stiffness * slack * kCovisibleMotion.sigma_rad});
    };
    for (std::size_t i = 0; i < keyframes_.size(); ++i) {
      const std::size_t first = first_keyframe_[keyframes_[i].member];
      if (i > first && !are_of_one_rig(i - 1, i)) add_constraint(i - 1, i, 2.0);
      const auto& covisible = keyframes_[i].content->covisible;
      for (std::size_t c = 0; c < covisible.size() && c < kCovisible; ++c)
        if (covisible[c].first >= static_cast<std::size_t>(kCovisibleMotion.least_shared))
          add_constraint(covisible[c].second + first, i, 1.0);
    }
    for (std::size_t m = 0; m < members_.size(); ++m)
      for (const Constraint* rigid : rigs_[m]) {
        const std::size_t from = first_keyframe_[m] + members_[m]->number_of(rigid->id.from),
                          to = first_keyframe_[m] + members_[m]->number_of(rigid->id.to);
        result.push_back({static_cast<std::uint32_t>(from), static_cast<std::uint32_t>(to),
                          between(keyframes_[from].team_from_node, keyframes_[to].team_from_node),
                          stiffness / std::sqrt(rigid->information(0, 0)),
                          stiffness / std::sqrt(rigid->information(5, 5))});
      }
    return result;
  }

  void correct_loops() {
    std::vector<Pose3> poses;
    for (const TeamKeyframe& keyframe : keyframes_) poses.push_back(keyframe.team_from_node);
    std::vector<graph::SpatialEdge> edges;
    for (const graph::RelativePoseConstraint& constraint : shape_constraints(1.0)) {
      graph::SpatialEdge edge{constraint.from, constraint.to, constraint.from_from_to,
                              Eigen::Matrix<double, 6, 6>::Zero()};
      edge.information.diagonal().head<3>().setConstant(1.0 / (constraint.sigma_m * constraint.sigma_m));
      edge.information.diagonal().tail<3>().setConstant(1.0 / (constraint.sigma_rad * constraint.sigma_rad));
      edges.push_back(edge);
    }
    for (const VisualJoin& join : joins_)
      for (const VisualWitness& w : *join.witnesses) {
        const MetricWitness metric = in_team(join, w);
        edges.push_back({static_cast<std::uint32_t>(first_keyframe_[join.a] + w.keyframe_a),
                         static_cast<std::uint32_t>(first_keyframe_[join.b] + w.keyframe_b), metric.node_a_from_node_b,
                         metric.information});
      }
    const graph::SpatialSolution solution = graph::solve(poses, edges);
    for (std::size_t i = 0; i < keyframes_.size(); ++i) keyframes_[i].team_from_node = solution.poses[i];
  }

  // Of the cameras instead of the nodes.
  graph::RelativePoseConstraint of_cameras(graph::RelativePoseConstraint constraint) const {
    const auto robot_from_camera = [&](std::uint32_t keyframe) {
      return keyframes_[keyframe].content->content->geometry->robot_from_camera;
    };
    constraint.from_from_to = compose(compose(inverse(robot_from_camera(constraint.from)), constraint.from_from_to),
                                      robot_from_camera(constraint.to));
    return constraint;
  }

  void place_landmarks() {
    points_.clear();
    for (std::size_t i = 0; i < landmark_ids_.size(); ++i) {
      const std::size_t member = landmark_member_[i];
      const TeamKeyframe& anchor = keyframes_[landmark_keyframe_[i]];
      const Vector3d point = rig::rescaled(members_[member]->map().landmarks.find(landmark_ids_[i])->point_in_anchor(),
                                           anchor.content->content->geometry->robot_from_camera, scale_of(member));
      points_.push_back(transformed(point, anchor.team_from_node));
    }
  }

  // Of other members, those that look at the same things, the nearest first.
  std::vector<std::size_t> neighbours(std::size_t number, const std::vector<ViewingRay>& rays) const {
    const TeamKeyframe& here = keyframes_[number];
    std::vector<std::pair<double, std::size_t>> near;
    for (std::size_t i = 0; i < keyframes_.size(); ++i) {
      if (keyframes_[i].member == here.member) continue;
      const double reach = std::min(here.depth_m, keyframes_[i].depth_m),
                   square = (rays[number].from - rays[i].from).squaredNorm();
      if (!(square < reach * reach)) continue;
      const double turn = std::acos(std::clamp(rays[number].along.dot(rays[i].along), -1.0, 1.0));
      if (turn < kSameView_rad) near.emplace_back(std::sqrt(square) / reach + turn, i);
    }
    std::sort(near.begin(), near.end());
    if (near.size() > kLookedAt) near.resize(kLookedAt);
    std::vector<std::size_t> result;
    for (const auto& entry : near) result.push_back(entry.second);
    return result;
  }

  // by: members whose keyframes look; empty: all.
  void find_shared(double radius_px, const std::vector<std::size_t>& by = {}) {
    found_.clear();
    std::vector<ViewingRay> rays;
    for (const TeamKeyframe& keyframe : keyframes_) {
      const Pose3 camera = keyframe.team_from_camera();
      rays.push_back({camera.t, camera.q * Vector3d::UnitZ()});
    }
    if (features_.empty())
      for (const TeamKeyframe& keyframe : keyframes_)
        features_.emplace_back(*keyframe.content, scale_of(keyframe.member));
    constexpr auto kNobody = static_cast<std::size_t>(-1);
    std::vector<std::size_t> asked_by(landmark_ids_.size(), kNobody);
    for (std::size_t number = 0; number < keyframes_.size(); ++number) {
      if (!by.empty() && !std::binary_search(by.begin(), by.end(), keyframes_[number].member)) continue;
      const Pose3 camera_from_team = inverse(keyframes_[number].team_from_camera());
      const Pinhole& camera = keyframes_[number].content->camera;
      const Eigen::Matrix3d rotation = camera_from_team.q.toRotationMatrix();
      std::vector<SoughtLandmark> sought;
      for (const std::size_t other : neighbours(number, rays)) {
        const TeamKeyframe& from = keyframes_[other];
        for (std::size_t f = 0; f < from.content->points.size(); ++f) {
          if (from.content->landmark_of_feature[f] < 0) continue;
          const std::size_t landmark =
              from.first_landmark + static_cast<std::size_t>(from.content->landmark_of_feature[f]);
          if (asked_by[landmark] == number) continue;
          asked_by[landmark] = number;
          const Vector3d p = rotation * points_[landmark] + camera_from_team.t;
          if (!(p.z() > 0.1)) continue;
          const Vector2d pixel = camera.project(p);
          if (camera.shows(pixel)) sought.push_back({landmark, pixel, p.z(), &from.content->content->descriptors[f]});
        }
      }
      const auto shown = features_[number].find(sought, radius_px);
      if (shown.size() < kLeastFound) continue;
      for (const auto& [feature, landmark] : shown) found_.push_back({number, feature, landmark});
    }
  }

  DisjointSets classes() const {
    DisjointSets result(landmark_ids_.size());
    for (const SharedSighting& found : found_) {
      const TeamKeyframe& keyframe = keyframes_[found.keyframe];
      const std::int32_t own = keyframe.content->landmark_of_feature[found.feature];
      if (own < 0) continue;
      const std::size_t here = keyframe.first_landmark + static_cast<std::size_t>(own);
      const double depth_m = transformed(points_[here], inverse(keyframe.team_from_camera())).z();
      if ((points_[here] - points_[found.landmark]).norm() < kSameDepth * std::max(depth_m, 0.1))
        result.join(here, found.landmark);
    }
    return result;
  }

  // Of what was claimed, the new: by keyframes whose features were found to see the same, and where it is expected.
  std::vector<std::tuple<std::size_t, std::size_t, const LandmarkSighting*>> borne_out(const graph::Bundle& bundle,
                                                                                       const DisjointSets& same,
                                                                                       double radius_px) const {
    std::vector<std::tuple<std::size_t, std::size_t, const LandmarkSighting*>> result;
    if (claimed_.empty()) return result;
    std::set<std::size_t> known;
    for (const SharedSighting& found : found_) known.insert(found.keyframe);
    std::set<std::pair<std::size_t, std::size_t>> seen;
    for (const graph::BundleSighting& sighting : bundle.sightings)
      if (known.count(sighting.view) != 0) seen.emplace(sighting.view, sighting.point);
    for (const ClaimedSighting& claim : claimed_) {
      const std::size_t keyframe = first_keyframe_[claim.map] + claim.keyframe;
      const std::size_t landmark = keyframes_[first_keyframe_[claim.map_of_landmark]].first_landmark + claim.landmark;
      if (known.count(keyframe) == 0) continue;
      const TeamKeyframe& here = keyframes_[keyframe];
      const Vector3d p = transformed(points_[landmark], inverse(here.team_from_camera()));
      if (!(p.z() > 0.1)) continue;
      if (!((here.content->camera.project(p) - Vector2d(pixels_of(claim.seen.u), pixels_of(claim.seen.v))).norm() <
            radius_px))
        continue;
      const double depth_m = scale_of(here.member) * depth_m_of(claim.seen.inverse_depth);
      if (depth_m > 0.0 && std::abs(depth_m - p.z()) > kSameDepth * p.z()) continue;
      if (seen.emplace(keyframe, same.find(landmark)).second) result.emplace_back(keyframe, landmark, &claim.seen);
    }
    return result;
  }

  // most: of each landmark, spread over those that there are.
  template <class Visit>
  void for_own_sightings(std::size_t most, const Visit& visit) const {
    std::size_t number = 0;
    std::vector<std::pair<std::size_t, const LandmarkSighting*>> own;
    for (std::size_t m = 0; m < members_.size(); ++m)
      for (const auto& [id, landmark] : members_[m]->map().landmarks) {
        own.clear();
        for (const LandmarkSighting& seen : landmark.seen)
          if (const std::size_t keyframe = members_[m]->number_of(seen.node);
              keyframe < members_[m]->keyframes().size())
            own.emplace_back(first_keyframe_[m] + keyframe, &seen);
        const std::size_t count = own.size(), chosen = std::min(most, count);
        for (std::size_t i = 0; i < count; ++i)
          if (i * chosen / count != (i + 1) * chosen / count) visit(own[i].first, number, *own[i].second);
        ++number;
      }
  }

  // shared: with landmarks that two maps see alone, few sightings each, which lays the maps on each other within their
  // shapes; the others stay at their keyframes. free: with those that free keyframes see.
  enum class Extent { shared, free, all };
  void adjust_all(double radius_px, Extent extent) {
    const DisjointSets same = classes();
    std::vector<char> counts(landmark_ids_.size(), extent == Extent::all);
    for (const SharedSighting& found : found_)
      if (extent != Extent::free || is_free_[found.keyframe]) counts[same.find(found.landmark)] = 1;
    graph::Bundle bundle;
    const bool moves_all = std::find(is_free_.begin(), is_free_.end(), false) == is_free_.end();
    for (std::size_t i = 0; i < keyframes_.size(); ++i) {
      bundle.cameras.push_back(keyframes_[i].content->camera);
      bundle.views.push_back(
          {keyframes_[i].team_from_camera(), static_cast<std::uint32_t>(i), (i == 0 && moves_all) || !is_free_[i]});
    }
    bundle.points = points_;
    for (const graph::RelativePoseConstraint& constraint : shape_)
      if (is_free_[constraint.from] || is_free_[constraint.to]) bundle.relative_poses.push_back(of_cameras(constraint));
    const auto see = [&](std::size_t keyframe, std::size_t landmark, const Vector2d& pixel, double sigma_px,
                         std::uint16_t inverse_depth) {
      if (counts[same.find(landmark)] == 0) return;
      graph::BundleSighting sighting;
      sighting.view = static_cast<std::uint32_t>(keyframe),
      sighting.point = static_cast<std::uint32_t>(same.find(landmark));
      sighting.pixel = pixel, sighting.sigma_px = sigma_px;
      if (inverse_depth != 0) {
        sighting.inverse_depth = 1.0 / (scale_of(keyframes_[keyframe].member) * depth_m_of(inverse_depth));
        const CameraGeometry& camera = *keyframes_[keyframe].content->content->geometry;
        sighting.inverse_depth_sigma =
            camera.baseline_m > 0.0 ? sigma_px / (camera.fx * camera.baseline_m) : options_.inverse_depth_sigma;
      }
      bundle.sightings.push_back(sighting);
    };
    if (extent == Extent::free)
      for_own_sightings(kAll, [&](std::size_t keyframe, std::size_t landmark, const LandmarkSighting&) {
        if (is_free_[keyframe]) counts[same.find(landmark)] = 1;
      });
    for_own_sightings(extent == Extent::shared ? kOfOneMap : kAll,
                      [&](std::size_t keyframe, std::size_t landmark, const LandmarkSighting& seen) {
                        see(keyframe, landmark, {pixels_of(seen.u), pixels_of(seen.v)},
                            options_.sigma_px * (1 << seen.level), seen.inverse_depth);
                      });
    for (const SharedSighting& found : found_) {
      const MappedKeyframe& content = *keyframes_[found.keyframe].content;
      if (content.landmark_of_feature[found.feature] >= 0) continue;  // the same one, or a mistake
      const matching::FeaturePoint& point = content.points[found.feature];
      see(found.keyframe, found.landmark, {point.u_px, point.v_px},
          2.0 * options_.sigma_px * std::pow(content.content->geometry->level_scale, point.level), 0);
    }
    for (const auto& [keyframe, landmark, sighting] : borne_out(bundle, same, radius_px))
      see(keyframe, landmark, {pixels_of(sighting->u), pixels_of(sighting->v)},
          2.0 * options_.sigma_px * (1 << sighting->level), 0);
    std::stable_sort(bundle.sightings.begin(), bundle.sightings.end(),
                     [](const auto& a, const auto& b) { return a.point < b.point; });
    graph::BundleOptions adjusting;
    adjusting.least_gain = extent == Extent::shared ? kRoughGain : kLeastGain;
    graph::adjust(bundle, adjusting);
    for (std::size_t i = 0; i < keyframes_.size(); ++i)
      keyframes_[i].team_from_node = compose(bundle.views[i].map_from_camera,
                                             inverse(keyframes_[i].content->content->geometry->robot_from_camera));
    place_landmarks();
    if (extent == Extent::shared) return;
    for (std::size_t i = 0; i < points_.size(); ++i)
      if (counts[same.find(i)] != 0 || extent == Extent::all) points_[i] = bundle.points[same.find(i)];
  }

  VisualTeam result() const {
    VisualTeam team;
    std::vector<std::pair<NodeId, Node>> nodes;
    for (const TeamKeyframe& keyframe : keyframes_) {
      Node node = *members_[keyframe.member]->map().nodes.find(keyframe.content->id);
      node.map_from_node = keyframe.team_from_node;
      nodes.emplace_back(node.id, std::move(node));
    }
    std::sort(nodes.begin(), nodes.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
    for (auto& [id, node] : nodes) team.nodes.set(id, std::move(node));

    std::vector<Constraint> constraints;
    for (std::size_t m = 0; m < members_.size(); ++m)
      for (const Constraint* rigid : rigs_[m])
        constraints.push_back(rig::rescaled(*rigid, members_[m]->map(), scale_of(m)));
    for (const VisualJoin& join : joins_)
      for (const VisualWitness& w : *join.witnesses) {
        Constraint constraint;
        constraint.id = {ConstraintKind::between_maps, members_[join.a]->keyframes()[w.keyframe_a].id,
                         members_[join.b]->keyframes()[w.keyframe_b].id, 0};
        const MetricWitness metric = in_team(join, w);
        constraint.from_from_to.pose = metric.node_a_from_node_b;
        constraint.information = metric.information;
        constraint.because = w.judgement.id;
        constraints.push_back(constraint);
      }
    std::sort(constraints.begin(), constraints.end(),
              [](const Constraint& a, const Constraint& b) { return a.id < b.id; });
    for (Constraint& constraint : constraints) {
      const ConstraintId id = constraint.id;
      team.constraints.set(id, std::move(constraint));
    }

    const DisjointSets same = classes();
    std::map<LandmarkId, Landmark> landmarks;
    std::size_t number = 0;
    for (std::size_t m = 0; m < members_.size(); ++m)
      for (const auto& [id, landmark] : members_[m]->map().landmarks) {
        const std::size_t kept = same.find(number);
        if (kept == number) {
          Landmark& own = landmarks.emplace(id, landmark).first->second;
          own.point_units = landmark_units(
              transformed(points_[number], inverse(keyframes_[landmark_keyframe_[number]].team_from_node)));
        } else {
          auto& seen = landmarks.at(landmark_ids_[kept]).seen;
          seen.insert(seen.end(), landmark.seen.begin(), landmark.seen.end());
          team.same_as.set(id, landmark_ids_[kept]);
        }
        ++number;
      }
    for (auto& [id, landmark] : landmarks) {
      std::stable_sort(landmark.seen.begin(), landmark.seen.end(),
                       [](const auto& a, const auto& b) { return a.node < b.node; });
      landmark.seen.erase(std::unique(landmark.seen.begin(), landmark.seen.end(),
                                      [](const auto& a, const auto& b) { return a.node == b.node; }),
                          landmark.seen.end());
      team.landmarks.set(id, std::move(landmark));
    }
    return team;
  }

  const std::vector<const VisualMap*>& members_;
  const std::vector<VisualJoin>& joins_;
  const std::vector<Sim3>& team_from_map_;
  const std::vector<ClaimedSighting>& claimed_;
  VisualFusionOptions options_;
  std::vector<std::size_t> first_keyframe_;  // of each member
  std::vector<TeamKeyframe> keyframes_;
  std::vector<char> is_free_;  // of each
  std::vector<LandmarkId> landmark_ids_;
  std::vector<std::size_t> landmark_member_, landmark_keyframe_;  // whose each is; where it hangs
  std::vector<Vector3d> points_;                                  // in the team's frame
  std::vector<graph::RelativePoseConstraint> shape_;              // of nodes
  std::vector<std::vector<const Constraint*>> rigs_;              // of each member
  std::vector<FeaturesByPlace> features_;                         // of each keyframe, once they were looked for
  std::vector<SharedSighting> found_;
};

}  // namespace

VisualTeam join(const std::vector<const VisualMap*>& members, const std::vector<VisualJoin>& joins,
                const std::vector<Sim3>& team_from_map, const std::vector<ClaimedSighting>& claimed,
                const VisualFusionOptions& options, const PreviousMerge* before) {
  return Team(members, joins, team_from_map, claimed, options).run(before);
}

}  // namespace mapweave::fusion
