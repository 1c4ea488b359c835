#include "joint_transforms.h"
#include "map_pair.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/stopwatch.h>

#include <Eigen/LU>
#include <algorithm>
#include <numeric>

namespace mapweave::fusion {
namespace {

std::vector<const Map*> sorted(const std::vector<Map>& maps) {
  std::vector<const Map*> order;
  for (const auto& map : maps) order.push_back(&map);
  std::sort(order.begin(), order.end(), [](const Map* a, const Map* b) { return a->id < b->id; });
  std::vector<std::pair<SessionId, const Map*>> sessions;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && order[i]->id == order[i - 1]->id)
      throw Error(ErrorCode::kBadInput, "two maps are called '" + order[i]->id.str() + "'", {}, "give each its own name");
    for (const auto& session : order[i]->sessions()) sessions.emplace_back(session, order[i]);
  }
  std::sort(sessions.begin(), sessions.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  for (std::size_t i = 1; i < sessions.size(); ++i)
    if (sessions[i].first == sessions[i - 1].first)
      throw Error(ErrorCode::kBadInput,
                  "session " + to_string(sessions[i].first) + " stands in two maps, '" + sessions[i - 1].second->id.str() + "' and '" +
                      sessions[i].second->id.str() + "'",
                  {}, "leave one of them out");
  return order;
}

struct Groups {
  std::vector<std::size_t> parent;
  explicit Groups(std::size_t count) : parent(count) { std::iota(parent.begin(), parent.end(), std::size_t{0}); }
  std::size_t find(std::size_t i) { return parent[i] == i ? i : parent[i] = find(parent[i]); }
  bool join(std::size_t i, std::size_t j) {
    i = find(i), j = find(j);
    parent[std::max(i, j)] = std::min(i, j);
    return i != j;
  }
};

struct PairJoin {
  std::size_t a, b;  // numbers in id order
  PairResult result;
};

Join join_of(const PairJoin& pair, const std::vector<PreparedMap>& maps, std::size_t a, std::size_t b) {
  Join join{a, b, 0.0, {}};
  const double share = 1.0 / static_cast<double>(pair.result.witnesses.size());
  for (const auto& w : pair.result.witnesses) {
    const auto& p = maps[pair.b].centres[w.submap_b];
    const double c = std::cos(w.a_from_b.phi), s = std::sin(w.a_from_b.phi);
    join.terms.push_back(
        {w.a_from_b.x + c * p.x - s * p.y, w.a_from_b.y + s * p.x + c * p.y, p.x, p.y, w.a_from_b.phi, 16.0 * share});  // 0.25 m: maps bend
  }
  join.strength = 4.0 + 4.0 * static_cast<double>(std::min<std::size_t>(10, pair.result.witnesses.size()));
  return join;
}

// Members' joint transforms from their accepted joins, starting along a spanning tree of the strongest. Joins that Ipopt turns off are
// refused.
std::vector<Pose2> place_members(const std::vector<std::size_t>& members, std::vector<PairJoin*>& joins,
                                 const std::vector<PreparedMap>& maps, bool& revoked) {
  const auto local = [&](std::size_t map) {
    return static_cast<std::size_t>(std::lower_bound(members.begin(), members.end(), map) - members.begin());
  };
  std::vector<PairJoin*> strongest = joins;
  std::stable_sort(strongest.begin(), strongest.end(),
                   [](const PairJoin* l, const PairJoin* r) { return l->result.witnesses.size() > r->result.witnesses.size(); });
  Groups groups(members.size());
  std::vector<std::vector<std::pair<std::size_t, Pose2>>> tree(members.size());
  for (const PairJoin* join : strongest) {
    const std::size_t a = local(join->a), b = local(join->b);
    if (!groups.join(a, b)) continue;
    const Pose2 a_from_b = planar(join->result.verdict.alignment->a_from_b.pose);
    tree[a].emplace_back(b, a_from_b);
    tree[b].emplace_back(a, inverse(a_from_b));
  }
  std::vector<Pose2> start(members.size());
  std::vector<bool> placed(members.size(), false);
  std::vector<std::size_t> open{0};
  placed[0] = true;
  while (!open.empty()) {
    const std::size_t here = open.back();
    open.pop_back();
    for (const auto& [next, here_from_next] : tree[here]) {
      if (placed[next]) continue;
      placed[next] = true;
      start[next] = compose(start[here], here_from_next);
      open.push_back(next);
    }
  }
  std::vector<Join> terms;
  for (const PairJoin* join : joins) terms.push_back(join_of(*join, maps, local(join->a), local(join->b)));
  const JointTransforms solution = solve_joint_transforms(members.size(), terms, start);
  revoked = false;
  for (std::size_t i = 0; i < joins.size(); ++i) {
    if (solution.switches[i] >= 0.5) continue;
    joins[i]->result.verdict.decision = Decision::refused;
    joins[i]->result.verdict.reason = Reason::inconsistent;
    revoked = true;
  }
  return solution.team_from_map;
}

Constraint tie_of(const Witness& w, const PreparedMap& a, const PreparedMap& b) {
  // Submaps bend a little once their nodes move on their own.
  const Eigen::Matrix3d floor = Eigen::Vector3d(9e-4, 9e-4, 9e-6).asDiagonal();
  const Eigen::Matrix3d information = (w.submap_information.inverse() + floor).inverse();
  Constraint constraint =
      planar_constraint({ConstraintKind::between_maps, a.submaps[w.submap_a]->anchor(), b.submaps[w.submap_b]->anchor(), 0},
                        w.submap_a_from_submap_b, 0.5 * (information + information.transpose()));
  constraint.because = w.judgement.id;
  return constraint;
}

void add_all(Map& map, std::vector<Constraint> constraints) {
  std::vector<Constraint> all;
  all.reserve(map.constraints.size() + constraints.size());
  for (auto& entry : map.constraints) all.push_back(std::move(entry.second));
  for (auto& constraint : constraints) all.push_back(std::move(constraint));
  std::stable_sort(all.begin(), all.end(), [](const Constraint& l, const Constraint& r) { return l.id < r.id; });
  map.constraints = {};
  map.constraints.reserve(all.size());
  for (auto& constraint : all) {
    const ConstraintId id = constraint.id;
    map.constraints.set(id, std::move(constraint));
  }
}

class Fusing {
 public:
  Fusing(const FusionInput& input, const FusionOptions& options, Memo& memo, WorkerPool& pool, Progress& progress)
      : input_(input),
        options_(options),
        pool_(pool),
        progress_(progress),
        cache_(static_cast<std::size_t>(options.cache_mb) << 20),
        judge_(options_, cache_, memo, pool),
        memo_(memo) {}

  FusionResult run() {
    Stopwatch watch;
    for (const Map* map : sorted(input_.maps)) maps_.push_back(prepare(*map, cache_, options_.stride_m, pool_));
    result_.stages.push_back({"features", watch.lap()});
    compare();
    result_.stages.push_back({"pairwise matching", watch.lap()});
    const auto components = connect();
    result_.stages.push_back({"component connection", watch.lap()});
    for (const auto& [members, poses] : components) result_.components.push_back(join_graphs(members, poses));
    std::stable_sort(result_.components.begin(), result_.components.end(), [](const Component& l, const Component& r) {
      const auto size = [](const Component& c) {
        return std::count_if(c.map.nodes.begin(), c.map.nodes.end(), [](const auto& entry) { return entry.second.payload != nullptr; });
      };
      return size(l) > size(r);
    });
    result_.stages.push_back({"transform optimisation", watch.lap()});
    for (auto& pair : pairs_) result_.verdicts.push_back(std::move(pair.result.verdict));
    std::sort(judged_.begin(), judged_.end());
    judged_.erase(std::unique(judged_.begin(), judged_.end()), judged_.end());
    for (const auto& id : judged_) result_.judgements.push_back(memo_.at(id));
    return std::move(result_);
  }

 private:
  void compare() {
    const std::size_t count = maps_.size() * (maps_.size() - (maps_.empty() ? 0 : 1)) / 2;
    if (count == 0) return;
    const int task = progress_.begin("comparing maps", count, "pairs of maps");
    for (std::size_t a = 0; a < maps_.size(); ++a)
      for (std::size_t b = a + 1; b < maps_.size(); ++b) {
        Stopwatch watch;
        pairs_.push_back({a, b, decide(maps_[a], maps_[b], input_, options_, judge_)});
        auto& result = pairs_.back().result;
        result.verdict.seconds = watch.lap();
        judged_.insert(judged_.end(), result.judged.begin(), result.judged.end());
        progress_.advance(task, pairs_.size());
      }
    progress_.end(task);
  }

  std::vector<std::pair<std::vector<std::size_t>, std::vector<Pose2>>> connect() {
    for (;;) {
      Groups groups(maps_.size());
      for (const auto& pair : pairs_)
        if (pair.result.verdict.decision == Decision::accepted) groups.join(pair.a, pair.b);
      std::vector<std::vector<std::size_t>> members(maps_.size());
      for (std::size_t i = 0; i < maps_.size(); ++i) members[groups.find(i)].push_back(i);
      std::vector<std::pair<std::vector<std::size_t>, std::vector<Pose2>>> components;
      bool again = false;
      for (const auto& group : members) {
        if (group.empty()) continue;
        std::vector<PairJoin*> joins;
        for (auto& pair : pairs_)
          if (pair.result.verdict.decision == Decision::accepted && groups.find(pair.a) == groups.find(group.front()))
            joins.push_back(&pair);
        bool revoked = false;
        components.emplace_back(group, place_members(group, joins, maps_, revoked));
        again = again || revoked;
      }
      if (!again) return components;
    }
  }

  Component join_graphs(const std::vector<std::size_t>& members, const std::vector<Pose2>& team_from_map) {
    throw_if_interrupted();
    Component component;
    Map& team = component.map;
    std::vector<std::pair<NodeId, Node>> nodes;
    std::vector<Constraint> constraints;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const Map& map = *maps_[members[i]].map;
      component.members.push_back(map.id);
      for (const auto& [id, node] : map.nodes) {
        Node moved = node;
        moved.map_from_node = compose(spatial(team_from_map[i]), node.map_from_node);
        nodes.emplace_back(id, std::move(moved));
      }
      for (const auto& [id, submap] : map.submaps) team.submaps.set(id, submap);
      for (const auto& [id, landmark] : map.landmarks) team.landmarks.set(id, landmark);
      for (const auto& [id, constraint] : map.constraints) constraints.push_back(constraint);
    }
    std::sort(nodes.begin(), nodes.end(), [](const auto& l, const auto& r) { return l.first < r.first; });
    team.nodes.reserve(nodes.size());
    for (auto& [id, node] : nodes) team.nodes.set(id, std::move(node));
    team.id = members.size() == 1 ? component.members.front() : MapId("team");
    if (members.size() > 1) {
      for (const auto& pair : pairs_)
        if (pair.result.verdict.decision == Decision::accepted && std::binary_search(members.begin(), members.end(), pair.a))
          for (const auto& w : pair.result.witnesses) constraints.push_back(tie_of(w, maps_[pair.a], maps_[pair.b]));
      add_all(team, std::move(constraints));
      graph::optimise(team, options_.solve);
      add_all(team, neighbours(members, team));
      graph::optimise(team, options_.solve);
      add_all(team, matching::rematch(team, options_.rematch, pool_));
      graph::optimise(team, options_.solve);
      back_to_lowest(*maps_[members.front()].map, team);
    } else {
      add_all(team, std::move(constraints));
    }
    for (const auto i : members) {
      const Map& map = *maps_[i].map;
      const NodeId& first = map.nodes.front().first;
      component.team_from_map.set(map.id, compose(team.nodes.find(first)->map_from_node, inverse(map.nodes.front().second.map_from_node)));
    }
    return component;
  }

  // The team's frame is the map frame of its lowest member: its first node stays where that map has it.
  static void back_to_lowest(const Map& lowest, Map& team) {
    const auto& [first, node] = lowest.nodes.front();
    const Pose3 shift = compose(node.map_from_node, inverse(team.nodes.find(first)->map_from_node));
    for (auto& entry : team.nodes) entry.second.map_from_node = compose(shift, entry.second.map_from_node);
  }

  // Submaps of different maps that lie near each other now say so too.
  std::vector<Constraint> neighbours(const std::vector<std::size_t>& members, const Map& team) {
    std::vector<Constraint> ties;
    for (std::size_t m = 0; m < members.size(); ++m)
      for (std::size_t n = m + 1; n < members.size(); ++n) {
        const PreparedMap &a = maps_[members[m]], &b = maps_[members[n]];
        const auto pose = [&](const PreparedMap& map, std::size_t i) {
          return planar(team.nodes.find(map.submaps[i]->anchor())->map_from_node);
        };
        const auto centre = [&](const PreparedMap& map, std::size_t i) {
          const Pose2 moved = compose(pose(map, i), inverse(map.map_from_submap[i]));
          const double c = std::cos(moved.phi), s = std::sin(moved.phi);
          return std::make_pair(moved.x + c * map.centres[i].x - s * map.centres[i].y,
                                moved.y + s * map.centres[i].x + c * map.centres[i].y);
        };
        std::vector<Question> questions;
        for (const auto j : b.representatives) {
          const auto [bx, by] = centre(b, j);
          std::vector<std::pair<double, std::size_t>> near;
          for (const auto i : a.representatives) {
            const auto [ax, ay] = centre(a, i);
            const double apart = std::hypot(ax - bx, ay - by);
            if (apart < 8.0) near.emplace_back(apart, i);
          }
          std::sort(near.begin(), near.end());
          if (near.size() > static_cast<std::size_t>(options_.neighbours_per_submap))
            near.resize(static_cast<std::size_t>(options_.neighbours_per_submap));
          for (const auto& candidate : near)
            questions.push_back({candidate.second, j, {between(pose(a, candidate.second), pose(b, j)), 0.6, 0.06}});
        }
        for (const auto& w : judge_.ask(a, b, questions)) {
          judged_.push_back(w.judgement.id);
          if (!w.judgement.hypotheses.empty() && w.judgement.doubt == Reason::none && w.judgement.probability >= options_.min_probability &&
              input_.vetoed.count(w.judgement.id) == 0)
            ties.push_back(tie_of(w, a, b));
        }
      }
    return ties;
  }

  const FusionInput& input_;
  FusionOptions options_;
  WorkerPool& pool_;
  Progress& progress_;
  matching::ModelCache cache_;
  Judge judge_;
  Memo& memo_;
  std::vector<PreparedMap> maps_;
  std::vector<PairJoin> pairs_;
  std::vector<Hash> judged_;
  FusionResult result_;
};

}  // namespace

FusionResult fuse(const FusionInput& input, const FusionOptions& options, Memo& memo, WorkerPool& pool, Progress& progress) {
  return Fusing(input, options, memo, pool, progress).run();
}

}  // namespace mapweave::fusion
