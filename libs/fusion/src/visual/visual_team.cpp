#include "visual_team.h"
#include "shared_sightings.h"
#include "team_bundle.h"
#include "team_shape.h"
#include "warm_start.h"

#include <mapweave/rig/scale.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace mapweave::fusion {
namespace {

// Where a landmark is looked for in keyframes of others: as far as maps may be off that were only laid on each other,
// and once they were adjusted. Wider ones find more wrong sightings.
constexpr double kWide_px = 20.0, kNarrow_px = 6.0;
constexpr std::size_t kAtOnce = 600,
                      kPart = 300;  // keyframes that a preview adjusts at once; else in parts of about so many

Table<NodeId, Node> nodes_of(const TeamState& team) {
  Table<NodeId, Node> result;
  std::vector<std::pair<NodeId, Node>> nodes;
  for (const TeamKeyframe& keyframe : team.keyframes) {
    Node node = *team.members[keyframe.member]->map().nodes.find(keyframe.content->id);
    node.map_from_node = keyframe.team_from_node;
    nodes.emplace_back(node.id, std::move(node));
  }
  std::sort(nodes.begin(), nodes.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (auto& [id, node] : nodes) result.set(id, std::move(node));
  return result;
}

Table<ConstraintId, Constraint> constraints_of(const TeamState& team) {
  Table<ConstraintId, Constraint> result;
  std::vector<Constraint> constraints;
  for (std::size_t m = 0; m < team.members.size(); ++m)
    for (const Constraint* rigid : team.rigs[m])
      constraints.push_back(rig::rescaled(*rigid, team.members[m]->map(), team.scale_of(m)));
  for (const VisualJoin& join : team.joins)
    for (const VisualWitness& w : *join.witnesses) {
      Constraint constraint;
      constraint.id = {ConstraintKind::between_maps, team.members[join.a]->keyframes()[w.keyframe_a].id,
                       team.members[join.b]->keyframes()[w.keyframe_b].id, 0};
      const MetricWitness metric = team.in_team(join, w);
      constraint.from_from_to.pose = metric.node_a_from_node_b;
      constraint.information = metric.information;
      constraint.because = w.judgement.id;
      constraints.push_back(constraint);
    }
  std::sort(constraints.begin(), constraints.end(),
            [](const Constraint& a, const Constraint& b) { return a.id < b.id; });
  for (Constraint& constraint : constraints) {
    const ConstraintId id = constraint.id;
    result.set(id, std::move(constraint));
  }
  return result;
}

void add_landmarks(const TeamState& team, const std::vector<SharedSighting>& found, VisualTeam& result) {
  const DisjointSets same = team.classes(found);
  std::map<LandmarkId, Landmark> landmarks;
  std::size_t number = 0;
  for (std::size_t m = 0; m < team.members.size(); ++m)
    for (const auto& [id, landmark] : team.members[m]->map().landmarks) {
      const std::size_t kept = same.find(number);
      if (kept == number) {
        Landmark& own = landmarks.emplace(id, landmark).first->second;
        own.point_units = landmark_units(
            transformed(team.points[number], inverse(team.keyframes[team.landmark_keyframe[number]].team_from_node)));
      } else {
        auto& seen = landmarks.at(team.landmark_ids[kept]).seen;
        seen.insert(seen.end(), landmark.seen.begin(), landmark.seen.end());
        result.same_as.set(id, team.landmark_ids[kept]);
      }
      ++number;
    }
  for (auto& [id, landmark] : landmarks) {
    std::stable_sort(landmark.seen.begin(), landmark.seen.end(),
                     [](const auto& a, const auto& b) { return a.node < b.node; });
    landmark.seen.erase(std::unique(landmark.seen.begin(), landmark.seen.end(),
                                    [](const auto& a, const auto& b) { return a.node == b.node; }),
                        landmark.seen.end());
    result.landmarks.set(id, std::move(landmark));
  }
}

// Share of the deviation of a keyframe's own constraint to the laser: its neighbours' hold it too, and a bundle knows
// nothing of what a depth sensor has wrong everywhere.
constexpr double kSurer = 0.03;

// By the constraints to lasers' poses.
std::vector<HeldKeyframe> held_by_lasers(const TeamState& team, const Map& solved) {
  std::map<NodeId, std::size_t> numbers;
  for (std::size_t i = 0; i < team.keyframes.size(); ++i) numbers.emplace(team.keyframes[i].content->id, i);
  std::map<std::size_t, HeldKeyframe> held;
  for (const auto& [id, constraint] : solved.constraints) {
    const auto keyframe = numbers.find(id.to);
    if (id.kind != ConstraintKind::extrinsic || keyframe == numbers.end() || numbers.count(id.from) != 0) continue;
    const double m = constraint.information(0, 0), rad = constraint.information(5, 5);
    if (!(m > 0.0 && rad > 0.0)) continue;
    const std::size_t number = keyframe->second;
    held.emplace(number, HeldKeyframe{number, team.keyframes[number].team_from_camera(), kSurer / std::sqrt(m),
                                      kSurer / std::sqrt(rad)});
  }
  std::vector<HeldKeyframe> result;
  for (const auto& entry : held) result.push_back(entry.second);
  return result;
}

class Team {
 public:
  Team(const std::vector<const VisualMap*>& members, const std::vector<VisualJoin>& joins,
       const std::vector<Sim3>& team_from_map, const std::vector<ClaimedSighting>& claimed,
       const VisualFusionOptions& options)
      : state_(members, joins, team_from_map), shared_(state_), claimed_(claimed), options_(options) {}

  VisualTeam run(const PreviousMerge* before) {
    const bool is_again = before != nullptr && before->is_adjusted_again;
    if (before != nullptr && (!is_again || state_.keyframes.size() > kAtOnce))
      if (const auto start = warm_start(*before, state_.members, state_.joins))
        return is_again ? adjusted_again(*start) : extended(*start);
    correct_loops(state_);
    adjust(before != nullptr);
    return result();
  }

  std::optional<VisualTeam> run_beside_lasers(const Map& solved, const std::optional<NodeId>& stays) {
    for (TeamKeyframe& keyframe : state_.keyframes)
      keyframe.team_from_node = solved.nodes.find(keyframe.content->id)->map_from_node;
    state_.held = held_by_lasers(state_, solved);
    for (std::size_t i = 0; i < state_.keyframes.size(); ++i)
      state_.is_free[i] = !stays || state_.keyframes[i].content->id != *stays;
    adjust(false);
    if (shared_.found().empty()) return std::nullopt;
    VisualTeam result{nodes_of(state_), {}, {}, {}};
    add_landmarks(state_, shared_.found(), result);
    return result;
  }

 private:
  // In rounds, since more is found once maps lie well.
  void adjust(bool is_preview) {
    TeamBundle bundle(state_, claimed_, options_);
    state_.place_landmarks();
    for (int round = 0; round < options_.adjustments; ++round) {
      const double radius_px = round == 0 ? kWide_px : kNarrow_px;
      shared_.find(radius_px);
      const bool is_last = round + 1 == options_.adjustments;
      if (is_preview && is_last && state_.keyframes.size() > kAtOnce)
        adjust_in_parts(bundle, radius_px);
      else
        bundle.adjust(shared_.found(), radius_px, is_last ? BundleExtent::all : BundleExtent::shared);
    }
  }

  void begin_at(const WarmStart& start) {
    for (std::size_t i = 0; i < state_.keyframes.size(); ++i)
      state_.keyframes[i].team_from_node = start.team_from_node[i];
  }

  VisualTeam extended(const WarmStart& start) {
    begin_at(start);
    state_.is_free = start.is_free;
    TeamBundle bundle(state_, claimed_, options_);
    state_.place_landmarks();
    if (!start.newcomers.empty()) {
      shared_.find(kWide_px, start.newcomers);
      bundle.adjust(shared_.found(), kWide_px, BundleExtent::free);
    }
    shared_.find(kNarrow_px);
    bundle.adjust(shared_.found(), kNarrow_px, BundleExtent::free);
    return result();
  }

  VisualTeam adjusted_again(const WarmStart& start) {
    begin_at(start);
    correct_loops(state_);
    TeamBundle bundle(state_, claimed_, options_);
    state_.place_landmarks();
    shared_.find(kNarrow_px);
    adjust_in_parts(bundle, kNarrow_px);
    return result();
  }

  // One part after the other, while the rest stays: what that costs grows as the team, where all at once costs far
  // more.
  void adjust_in_parts(TeamBundle& bundle, double radius_px) {
    const std::size_t count = state_.keyframes.size(), parts = (count + kPart - 1) / kPart;
    for (std::size_t part = 0; part < parts; ++part) {
      for (std::size_t i = 0; i < count; ++i) state_.is_free[i] = i * parts / count == part;
      bundle.adjust(shared_.found(), radius_px, BundleExtent::free);
    }
  }

  VisualTeam result() const {
    VisualTeam result{nodes_of(state_), constraints_of(state_), {}, {}};
    add_landmarks(state_, shared_.found(), result);
    return result;
  }

  TeamState state_;
  SharedSightings shared_;
  const std::vector<ClaimedSighting>& claimed_;
  const VisualFusionOptions& options_;
};

}  // namespace

VisualTeam solve_team(const std::vector<const VisualMap*>& members, const std::vector<VisualJoin>& joins,
                      const std::vector<Sim3>& team_from_map, const std::vector<ClaimedSighting>& claimed,
                      const VisualFusionOptions& options, const PreviousMerge* before) {
  return Team(members, joins, team_from_map, claimed, options).run(before);
}

std::optional<VisualTeam> adjust_beside_lasers(const std::vector<const VisualMap*>& members, const Map& solved,
                                               const std::optional<NodeId>& stays,
                                               const std::vector<Sim3>& team_from_map,
                                               const std::vector<ClaimedSighting>& claimed,
                                               const VisualFusionOptions& options) {
  return Team(members, {}, team_from_map, claimed, options).run_beside_lasers(solved, stays);
}

}  // namespace mapweave::fusion
