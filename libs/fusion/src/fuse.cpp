#include "joint_transforms.h"
#include "pair_judging.h"
#include "relative_pose_constraints.h"
#include "verdict.h"
#include "warm_start.h"

#include <mapweave/core/disjoint_sets.h>
#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/stopwatch.h>
#include <mapweave/rig/laser_camera_alignment.h>
#include <mapweave/rig/scale.h>

#include <Eigen/LU>
#include <algorithm>
#include <deque>
#include <functional>
#include <tuple>

namespace mapweave::fusion {
namespace {

struct Placement {
  std::vector<std::size_t> members;  // numbers of maps
  std::vector<Sim3> team_from_map;   // of each, about; beside a laser by how much its lengths grow, and where it lies once they have
};

constexpr double kBend_weight = 16.0;  // 1 / (0.25 m)^2: maps bend

Join join_of(const PairJoin& pair, const std::vector<PreparedMap>& maps, const std::deque<VisualMap>& seen, const std::vector<Sim3>& placed,
             std::size_t a, std::size_t b) {
  Join join{a, b, 0.0, {}};
  const double share = 1.0 / static_cast<double>(pair.witnesses());
  for (const auto& w : pair.result.witnesses) {
    const auto& p = maps[pair.b].centres[w.submap_b];
    const double c = std::cos(w.a_from_b.phi), s = std::sin(w.a_from_b.phi);
    join.terms.push_back(
        {w.a_from_b.x + c * p.x - s * p.y, w.a_from_b.y + s * p.x + c * p.y, p.x, p.y, w.a_from_b.phi, kBend_weight * share});
  }
  const auto node = [](const VisualMap& map, std::size_t keyframe, double scale) {
    const MappedKeyframe& content = map.keyframes()[keyframe];
    return scale == 1.0 ? content.map_from_node : rig::rescaled(content.map_from_node, rig::extrinsics_of(map.map()), scale);
  };
  for (const VisualWitness& w : pair.seen) {
    const VisualMap &of_a = seen[pair.a], &of_b = seen[pair.b];
    const MetricWitness metric = rescaled(w, of_a, of_b, placed[a].scale, placed[b].scale);
    const Eigen::Vector3d p = node(of_b, w.keyframe_b, placed[b].scale).t,
                          q = transformed(metric.node_a_from_node_b.t, node(of_a, w.keyframe_a, placed[a].scale));
    join.terms.push_back({q.x(), q.y(), p.x(), p.y(), planar(w.a_from_b.pose).phi, kBend_weight * share});
  }
  join.strength = 4.0 + 4.0 * static_cast<double>(std::min<std::size_t>(10, pair.witnesses()));
  return join;
}

// Where the members lie along a tree of the strongest joins, and which joins are its branches.
std::vector<Sim3> along_tree(std::size_t members, const std::vector<PairJoin*>& strongest,
                             const std::function<std::size_t(std::size_t)>& local, std::vector<const PairJoin*>& branches) {
  DisjointSets groups(members);
  std::vector<std::vector<std::pair<std::size_t, Sim3>>> tree(members);
  for (const PairJoin* join : strongest) {
    const std::size_t a = local(join->a), b = local(join->b);
    if (!groups.join(a, b)) continue;
    branches.push_back(join);
    const Sim3& a_from_b = join->result.verdict.alignment->a_from_b;
    tree[a].emplace_back(b, a_from_b);
    tree[b].emplace_back(a, inverse(a_from_b));
  }
  std::vector<Sim3> team_from_map(members);
  std::vector<bool> placed(members, false);
  std::vector<std::size_t> open{0};
  placed[0] = true;
  while (!open.empty()) {
    const std::size_t here = open.back();
    open.pop_back();
    for (const auto& [next, here_from_next] : tree[here]) {
      if (placed[next]) continue;
      placed[next] = true;
      team_from_map[next] = compose(team_from_map[here], here_from_next);
      open.push_back(next);
    }
  }
  return team_from_map;
}

class Fusing {
 public:
  Fusing(const FusionInput& input, const FusionOptions& options, Memo& memo, WorkerPool& pool, Progress& progress)
      : input_(input), options_(options), pool_(pool), progress_(progress), judging_(input, options, memo, pool) {}

  FusionResult run() {
    Stopwatch watch;
    judging_.prepare_maps();
    double matching_s = 0.0, connecting_s = 0.0, optimising_s = 0.0;
    result_.stages.push_back({"features", watch.lap()});
    do {
      pairs_ = judging_.all_pairs(progress_);
      matching_s += watch.lap();
      const auto components = connect();
      connecting_s += watch.lap();
      result_.components.clear();
      for (const Placement& placement : components) result_.components.push_back(join_graphs(placement));
      optimising_s += watch.lap();
    } while (!pass_audit());
    std::stable_sort(result_.components.begin(), result_.components.end(), [](const Component& l, const Component& r) {
      const auto size = [](const Component& c) {
        return std::count_if(c.map.nodes.begin(), c.map.nodes.end(), [](const auto& entry) { return entry.second.payload != nullptr; });
      };
      return size(l) > size(r);
    });
    result_.stages.push_back({"pairwise matching", matching_s});
    result_.stages.push_back({"component connection", connecting_s});
    result_.stages.push_back({"transform optimisation", optimising_s});
    result_.stages.push_back({"audit", watch.lap()});
    check_priors();
    for (auto& pair : pairs_) result_.verdicts.push_back(std::move(pair.result.verdict));
    result_.judgements = judging_.judgements();
    return std::move(result_);
  }

 private:
  std::size_t number_of(const MapId& id) const {
    const auto map = std::find_if(maps_.begin(), maps_.end(), [&](const PreparedMap& one) { return one.map->id == id; });
    return static_cast<std::size_t>(map - maps_.begin());
  }

  // Whether the maps that came out show nothing twice. Else the map that is contradicted most stays apart from the rest of its team.
  bool pass_audit() {
    bool passed = true;
    result_.audits = judging_.lasers().taken_apart();
    for (const Component& component : result_.components) {
      std::vector<std::size_t> members;
      for (const MapId& id : component.members)
        if (const std::size_t number = number_of(id); !maps_[number].submaps.empty()) members.push_back(number);
      if (members.size() < 2) continue;
      const PoseOfSubmap pose_of = [&](std::size_t map, std::size_t submap) {
        return planar(component.map.nodes.find(maps_[map].submaps[submap]->anchor())->map_from_node);
      };
      const TeamAudit audit = judging_.lasers().audited(members, pose_of);
      for (const AuditedPair& pair : audit.pairs) result_.audits.push_back(told_of(pair, maps_[members[pair.a]], maps_[members[pair.b]]));
      if (!audit.taken_out || !refuse(members[*audit.taken_out], members)) continue;
      passed = false;
      for (const PairAudit& told : judging_.lasers().ghosts_of(audit, members, members[*audit.taken_out], pose_of)) taken_apart_.push_back(told);
    }
    result_.audits.insert(result_.audits.end(), taken_apart_.begin(), taken_apart_.end());
    std::stable_sort(result_.audits.begin(), result_.audits.end(),
                     [](const PairAudit& l, const PairAudit& r) { return std::tie(l.a, l.b) < std::tie(r.a, r.b); });
    return passed;
  }

  // From all the others of its team. False where that was said before.
  bool refuse(std::size_t who, const std::vector<std::size_t>& members) {
    bool is_new = false;
    for (PairJoin& pair : pairs_) {
      if (pair.a != who && pair.b != who) continue;
      if (!std::binary_search(members.begin(), members.end(), pair.a == who ? pair.b : pair.a)) continue;
      Verdict why = pair.result.verdict;
      refuse_by_audit(why);
      is_new = judging_.refuse(pair.a, pair.b, why) || is_new;
    }
    return is_new;
  }

  // By where the maps were merged; of those that stayed apart, by where they most probably lie.
  void check_priors() {
    if (input_.priors.empty()) return;
    for (PairJoin& pair : pairs_) {
      Verdict& verdict = pair.result.verdict;
      std::optional<Pose2> a_from_b;
      constexpr double kProbable = 0.5;
      if (verdict.alignment && verdict.probability > kProbable) a_from_b = planar(verdict.alignment->a_from_b.pose);
      for (const Component& component : result_.components) {
        const Pose3 *a = component.team_from_map.find(verdict.a), *b = component.team_from_map.find(verdict.b);
        if (a != nullptr && b != nullptr) a_from_b = planar(compose(inverse(*a), *b));
      }
      verdict.prior = judging_.lasers().check_of_prior(pair.a, pair.b, a_from_b);
    }
  }

  bool in_space(const std::vector<std::size_t>& members) const {
    return std::none_of(members.begin(), members.end(), [&](std::size_t m) { return !maps_[m].submaps.empty(); });
  }

  // Joint transforms from the accepted joins, starting along a spanning tree of the strongest. Joins that contradict the others are
  // refused: nullopt then.
  std::optional<Placement> placed(const std::vector<std::size_t>& members, const std::vector<PairJoin*>& joins) {
    const std::function<std::size_t(std::size_t)> local = [&](std::size_t map) {
      return static_cast<std::size_t>(std::lower_bound(members.begin(), members.end(), map) - members.begin());
    };
    std::vector<PairJoin*> strongest = joins;
    std::stable_sort(strongest.begin(), strongest.end(),
                     [](const PairJoin* l, const PairJoin* r) { return l->witnesses() > r->witnesses(); });
    if (const LaserTeam* lasers = judging_.lasers().team_of(members.front()); lasers != nullptr && lasers->maps == members)
      return placed_by_lasers(*lasers);
    std::vector<const PairJoin*> branches;
    Placement placement{members, along_tree(members.size(), strongest, local, branches)};
    bool revoked = false;
    if (in_space(members)) {
      for (PairJoin* join : strongest) {
        if (std::find(branches.begin(), branches.end(), join) != branches.end()) continue;
        const Sim3 a_from_b = compose(inverse(placement.team_from_map[local(join->a)]), placement.team_from_map[local(join->b)]);
        if (lie_alike(seen_[join->b], a_from_b, join->result.verdict.alignment->a_from_b)) continue;
        refuse_as_inconsistent(join->result.verdict);
        revoked = true;
      }
      in_metres(placement);
    } else {
      in_metres(placement);
      std::vector<Join> terms;
      std::vector<Pose2> start;
      for (const Sim3& pose : placement.team_from_map) start.push_back(planar(pose.pose));
      for (const PairJoin* join : joins)
        terms.push_back(join_of(*join, maps_, seen_, placement.team_from_map, local(join->a), local(join->b)));
      const JointTransforms solution = solve_joint_transforms(members.size(), terms, start);
      for (std::size_t i = 0; i < joins.size(); ++i)
        if (solution.switches[i] < 0.5 && !joins[i]->is_matched_by_lasers) {
          refuse_as_inconsistent(joins[i]->result.verdict);
          revoked = true;
        }
      for (std::size_t i = 0; i < members.size(); ++i) placement.team_from_map[i].pose = spatial(solution.team_from_map[i]);
    }
    return revoked ? std::nullopt : std::optional(placement);
  }

  Placement placed_by_lasers(const LaserTeam& team) const {
    Placement placement{team.maps, {}};
    for (const std::size_t m : team.maps) {
      const Pose2& first = team.solved.pose_of(judging_.lasers().graph().number(m, 0));
      placement.team_from_map.push_back({spatial(compose(first, inverse(maps_[m].map_from_submap.front()))), 1.0});
    }
    return placement;
  }

  // Where the team's graph of submaps puts each node of a map that lasers matched to others, by the submap that it is in or comes after;
  // the team lies as the placement has its first map. Empty for a map that was matched to none.
  std::vector<Pose2> as_bent(std::size_t number, const Placement& placement) const {
    const LaserTeam* lasers = judging_.lasers().team_of(number);
    if (lasers == nullptr || lasers->maps.size() < 2) return {};
    const SubmapGraph& graph = judging_.lasers().graph();
    const PreparedMap &map = maps_[number], &first = maps_[lasers->maps.front()];
    const auto place = std::lower_bound(placement.members.begin(), placement.members.end(), lasers->maps.front());
    const Pose2 there = planar(placement.team_from_map[static_cast<std::size_t>(place - placement.members.begin())].pose);
    const Pose2& first_submap = lasers->solved.pose_of(graph.number(lasers->maps.front(), 0));
    const Pose2 team_from_lasers = compose(there, compose(first.map_from_submap.front(), inverse(first_submap)));
    std::vector<Pose2> team_from_map;  // by each submap
    for (std::size_t s = 0; s < map.submaps.size(); ++s)
      team_from_map.push_back(
          compose(team_from_lasers, compose(lasers->solved.pose_of(graph.number(number, s)), inverse(map.map_from_submap[s]))));
    std::vector<Pose2> result;
    std::size_t current = 0;
    const auto home_of = map.is_grid ? homes_of(map) : std::map<NodeId, std::size_t>();  // tiles have no order in time
    for (const auto& [id, node] : map.map->nodes) {
      if (map.is_grid) current = home_of.at(id);
      while (!map.is_grid && current + 1 < map.submaps.size() && !(id < map.submaps[current + 1]->anchor())) ++current;
      result.push_back(compose(team_from_map[current], planar(node.map_from_node)));
    }
    return result;
  }

  bool knows_lengths(std::size_t member) const { return !maps_[member].map->submaps.empty() || seen_[member].is_metric(); }

  // The lengths of a team are those of a laser, else of the first member that measures them, whoever is its first member.
  void in_metres(Placement& placement) const {
    const auto& members = placement.members;
    auto known = std::find_if(members.begin(), members.end(), [&](std::size_t m) { return !maps_[m].submaps.empty(); });
    if (known == members.end()) known = std::find_if(members.begin(), members.end(), [&](std::size_t m) { return knows_lengths(m); });
    if (known == members.end()) return;
    const double all = placement.team_from_map[static_cast<std::size_t>(known - members.begin())].scale;
    for (std::size_t i = 0; i < placement.members.size(); ++i) {
      Sim3& pose = placement.team_from_map[i];
      pose.pose.t /= all;
      pose.scale = knows_lengths(placement.members[i]) ? 1.0 : pose.scale / all;
    }
  }

  std::vector<Placement> connect() {
    for (;;) {
      DisjointSets groups(maps_.size());
      for (const auto& pair : pairs_)
        if (pair.is_accepted()) groups.join(pair.a, pair.b);
      std::vector<std::vector<std::size_t>> members(maps_.size());
      for (std::size_t i = 0; i < maps_.size(); ++i) members[groups.find(i)].push_back(i);
      std::vector<Placement> components;
      bool again = false;
      for (const auto& group : members) {
        if (group.empty()) continue;
        std::vector<PairJoin*> joins;
        for (auto& pair : pairs_)
          if (pair.is_accepted() && groups.find(pair.a) == groups.find(group.front())) joins.push_back(&pair);
        auto placement = placed(group, joins);
        again = again || !placement;
        if (placement) components.push_back(std::move(*placement));
      }
      if (!again) return components;
    }
  }

  // Maps of keyframes alone, which do not stay in a plane.
  void join_in_space(const Placement& placement, Component& component) {
    std::vector<const VisualMap*> seen;
    std::vector<VisualJoin> joins;
    const auto& members = placement.members;
    for (const std::size_t m : members) seen.push_back(&seen_[m]);
    for (const PairJoin& pair : pairs_) {
      const auto a = std::lower_bound(members.begin(), members.end(), pair.a), b = std::lower_bound(members.begin(), members.end(), pair.b);
      if (pair.is_accepted() && a != members.end() && *a == pair.a)
        joins.push_back({static_cast<std::size_t>(a - members.begin()), static_cast<std::size_t>(b - members.begin()), &pair.seen});
    }
    std::vector<ClaimedSighting> told;
    for (ClaimedSighting sighting : judging_.claimed_sightings().sightings()) {
      const auto by = std::lower_bound(members.begin(), members.end(), sighting.map),
                 of = std::lower_bound(members.begin(), members.end(), sighting.map_of_landmark);
      if (by == members.end() || *by != sighting.map || of == members.end() || *of != sighting.map_of_landmark) continue;
      sighting.map = static_cast<std::size_t>(by - members.begin()),
      sighting.map_of_landmark = static_cast<std::size_t>(of - members.begin());
      told.push_back(sighting);
    }
    VisualTeam team = join(seen, joins, placement.team_from_map, told, options_.visual, largest_within(input_.teams, seen));
    component.map.nodes = std::move(team.nodes), component.map.landmarks = std::move(team.landmarks);
    component.map.constraints = std::move(team.constraints), component.same_as = std::move(team.same_as);
  }

  Component join_graphs(const Placement& placement) {
    throw_if_interrupted();
    const auto& members = placement.members;
    Component component;
    Map& team = component.map;
    for (const std::size_t m : members) component.members.push_back(maps_[m].map->id);
    team.id = members.size() == 1 ? component.members.front() : MapId("team");
    if (members.size() > 1 && in_space(members)) {
      join_in_space(placement, component);
      back_to_lowest(*maps_[members.front()].map, team);
    } else {
      join_in_plane(placement, team);
    }
    for (std::size_t i = 0; i < members.size(); ++i) {
      const Map& map = map_in(placement, i);
      const auto& [first, node] = first_within(map, team);
      const double of_grid = members.size() > 1 ? judging_.grids().scale(members[i]) : 1.0;
      if (of_grid != 1.0) component.scales.set(map.id, of_grid);
      const double scale = placement.team_from_map[i].scale;
      const Pose3& team_from_node = team.nodes.find(first)->map_from_node;
      component.team_from_map.set(map.id, rig::frame_by_node(team_from_node, node.map_from_node, rig::extrinsics_of(map), scale));
      if (scale != 1.0) component.scales.set(map.id, scale);
    }
    return component;
  }

  void join_in_plane(const Placement& placement, Map& team) {
    const auto& members = placement.members;
    std::vector<std::pair<NodeId, Node>> nodes;
    std::vector<Constraint> constraints;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const Map& own = map_in(placement, i);
      const double scale = placement.team_from_map[i].scale;
      const Map grown = scale != 1.0 ? rig::rescaled(own, scale) : Map();
      const Map& map = scale != 1.0 ? grown : own;
      const std::vector<Pose2> bent = members.size() > 1 ? as_bent(members[i], placement) : std::vector<Pose2>();
      std::size_t k = 0;
      for (const auto& [id, node] : map.nodes) {
        Node moved = node;
        if (bent.empty())
          moved.map_from_node = compose(placement.team_from_map[i].pose, node.map_from_node);
        else
          moved.map_from_node = compose(compose(spatial(bent[k++]), inverse(spatial(planar(node.map_from_node)))), node.map_from_node);
        nodes.emplace_back(id, std::move(moved));
      }
      for (const auto& [id, submap] : map.submaps) team.submaps.set(id, submap);
      for (const auto& [id, landmark] : map.landmarks) team.landmarks.set(id, landmark);
      for (const auto& [id, constraint] : map.constraints) constraints.push_back(constraint);
      if (members.size() == 1 || !map.submaps.empty()) continue;
      for (Constraint& edge : rig::covisibility_constraints(map, rig::LaserCameraOptions{})) constraints.push_back(std::move(edge));
    }
    std::sort(nodes.begin(), nodes.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
    team.nodes.reserve(nodes.size());
    for (auto& [id, node] : nodes) team.nodes.set(id, std::move(node));
    if (members.size() == 1) {
      add_constraints(team, std::move(constraints));
      return;
    }
    for (const LaserTeam& lasers : judging_.lasers().teams())
      if (std::binary_search(members.begin(), members.end(), lasers.maps.front()))
        add_matches(lasers, constraints);
    for (const PairJoin& pair : pairs_) {
      if (!pair.is_accepted() || !std::binary_search(members.begin(), members.end(), pair.a)) continue;
      for (const auto& w : pair.seen)
        constraints.push_back(constraint_of(w, seen_[pair.a], seen_[pair.b], scale_of(placement, pair.a), scale_of(placement, pair.b)));
    }
    add_constraints(team, std::move(constraints));
    graph::optimise(team, options_.solve);
    add_constraints(team, matching::rematch(team, options_.rematch, pool_));
    graph::optimise(team, options_.solve);
    back_to_lowest(*maps_[members.front()].map, team);
  }

  // A grid that is alone keeps the scale that it was given with.
  const Map& map_in(const Placement& placement, std::size_t i) const {
    const std::size_t number = placement.members[i];
    return placement.members.size() > 1 ? *maps_[number].map : judging_.grids().given(number);
  }

  // Two grids hold each other tile by tile, so that both can bend.
  void add_matches(const LaserTeam& lasers, std::vector<Constraint>& constraints) const {
    const SubmapGraph& graph = judging_.lasers().graph();
    std::set<std::pair<std::size_t, std::size_t>> grids;
    for (const SubmapMatch& match : lasers.matches) {
      const std::pair<std::size_t, std::size_t> pair = std::minmax(graph.map_of(match.from), graph.map_of(match.to));
      if (judging_.grids().pair(pair.first, pair.second) == nullptr)
        constraints.push_back(constraint_of_match(match));
      else
        grids.insert(pair);
    }
    for (const auto& [a, b] : grids)
      for (Constraint& constraint : judging_.grids().constraints(a, b)) constraints.push_back(std::move(constraint));
  }

  Constraint constraint_of_match(const SubmapMatch& match) const {
    const SubmapGraph& graph = judging_.lasers().graph();
    Witness witness;
    witness.judgement.id = match.judgement;
    witness.submap_a = graph.submap_of(match.from);
    witness.submap_b = graph.submap_of(match.to);
    witness.submap_a_from_submap_b = match.from_from_to;
    witness.submap_information = match.information;
    return constraint_of(witness, maps_[graph.map_of(match.from)], maps_[graph.map_of(match.to)]);
  }

  static double scale_of(const Placement& placement, std::size_t member) {
    const auto place = std::lower_bound(placement.members.begin(), placement.members.end(), member);
    return placement.team_from_map[static_cast<std::size_t>(place - placement.members.begin())].scale;
  }

  // In space a team has no nodes but keyframes.
  static const std::pair<NodeId, Node>& first_within(const Map& map, const Map& team) {
    const auto first =
        std::find_if(map.nodes.begin(), map.nodes.end(), [&](const auto& entry) { return team.nodes.find(entry.first) != nullptr; });
    MAPWEAVE_EXPECT(first != map.nodes.end(), "a team has nodes of each member");
    return *first;
  }

  // The team's frame is the map frame of its lowest member: its first node stays where that map has it.
  static void back_to_lowest(const Map& lowest, Map& team) {
    const auto& [first, node] = first_within(lowest, team);
    const Pose3 shift = compose(node.map_from_node, inverse(team.nodes.find(first)->map_from_node));
    for (auto& entry : team.nodes) entry.second.map_from_node = compose(shift, entry.second.map_from_node);
  }

  const FusionInput& input_;
  const FusionOptions& options_;
  WorkerPool& pool_;
  Progress& progress_;
  PairJudging judging_;
  const std::vector<PreparedMap>& maps_ = judging_.maps();
  const std::deque<VisualMap>& seen_ = judging_.seen();
  std::vector<PairJoin> pairs_;
  std::vector<PairAudit> taken_apart_;  // by the audit of what came out
  FusionResult result_;
};

}  // namespace

std::vector<Judgement> judge_pairs(const FusionInput& input, const std::vector<MapPair>& pairs, const FusionOptions& options, Memo& memo,
                                   WorkerPool& pool, Progress& progress) {
  PairJudging judging(input, options, memo, pool);
  judging.prepare_maps();
  judging.judge(pairs, progress);
  return judging.judgements();
}

FusionResult fuse(const FusionInput& input, const FusionOptions& options, Memo& memo, WorkerPool& pool, Progress& progress) {
  return Fusing(input, options, memo, pool, progress).run();
}

}  // namespace mapweave::fusion
