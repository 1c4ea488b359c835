#include "decision/component_audit.h"
#include "decision/connections.h"
#include "early_end.h"
#include "laser/wall_sight.h"
#include "team/team_in_plane.h"
#include "team/team_in_space.h"

#include <mapweave/core/disjoint_sets.h>
#include <mapweave/core/stopwatch.h>
#include <mapweave/rig/scale.h>

#include <algorithm>

namespace mapweave::fusion {
namespace {

// The five stages: candidates and judgements (pair_judging.h), commitment, solving (team_solver.h), composing.
class Fusing {
 public:
  Fusing(const FusionInput& input, const FusionOptions& options, Memo& memo, WorkerPool& pool, Progress& progress)
      : input_(input),
        progress_(progress),
        judging_(input, options, memo, pool),
        audit_(judging_),
        in_plane_(judging_, input, options, pool),
        in_space_(judging_, input, options) {}

  FusionResult run() {
    Stopwatch watch;
    if (input_.sights) input_.sights->begin();
    double matching_s = 0.0, connecting_s = 0.0, optimising_s = 0.0;
    judging_.prepare_maps();
    result_.stages.push_back({"features", watch.lap()});
    do {
      pairs_ = judging_.all_pairs(progress_);
      matching_s += watch.lap();
      const std::vector<PlacedTeam> teams = committed();
      connecting_s += watch.lap();
      result_.components.clear();
      for (const PlacedTeam& team : teams) result_.components.push_back(composed(team));
      optimising_s += watch.lap();
    } while (!input_.is_preview && !audit_.pass(result_.components, pairs_));
    result_.stages.push_back({"pairwise matching", matching_s});
    result_.stages.push_back({"component connection", connecting_s});
    result_.stages.push_back({"transform optimisation", optimising_s});
    result_.stages.push_back({"audit", watch.lap()});
    report();
    return std::move(result_);
  }

 private:
  struct PlacedTeam {
    TeamMembers members;
    std::vector<Sim3> team_from_map;  // of each
  };

  const TeamSolver& solver_of(const TeamMembers& members) const {
    const auto has_laser = [&](std::size_t m) { return !judging_.maps()[m].submaps.empty(); };
    const bool is_in_plane =
        members.maps.size() == 1 || std::any_of(members.maps.begin(), members.maps.end(), has_laser);
    return is_in_plane ? static_cast<const TeamSolver&>(in_plane_) : in_space_;
  }

  // What accepted merges connect.
  std::vector<TeamMembers> connected() {
    const std::size_t count = judging_.maps().size();
    DisjointSets groups(count);
    for (const PairJoin& pair : pairs_)
      if (pair.is_accepted()) groups.join(pair.a, pair.b);
    std::vector<TeamMembers> teams(count);
    for (std::size_t i = 0; i < count; ++i) teams[groups.find(i)].maps.push_back(i);
    for (PairJoin& pair : pairs_)
      if (pair.is_accepted()) teams[groups.find(pair.a)].joins.push_back(&pair);
    teams.erase(std::remove_if(teams.begin(), teams.end(), [](const TeamMembers& team) { return team.maps.empty(); }),
                teams.end());
    return teams;
  }

  // Stage 3: teams in which nothing contradicts the rest. What does is refused, and the teams are connected again
  // without it.
  std::vector<PlacedTeam> committed() {
    for (;;) {
      std::vector<PlacedTeam> teams;
      bool do_all_agree = true;
      for (TeamMembers& members : connected()) {
        auto team_from_map = solver_of(members).place(members);
        do_all_agree = do_all_agree && team_from_map;
        if (team_from_map) teams.push_back({std::move(members), std::move(*team_from_map)});
      }
      if (do_all_agree) return teams;
    }
  }

  // Stages 4 and 5: one map of all members, and where theirs lie in it.
  Component composed(const PlacedTeam& placed) const {
    is_over(input_);
    const auto& members = placed.members.maps;
    const bool is_alone = members.size() == 1;
    Component component;
    for (const std::size_t m : members) component.members.push_back(judging_.maps()[m].map->id);
    component.map.id = is_alone ? component.members.front() : MapId("team");
    const TeamSolver& solver = solver_of(placed.members);
    solver.solve(placed.members, placed.team_from_map, component);
    place_frames(
        placed, [](const PreparedMap&) { return true; }, component);
    if (solver.adjust_cameras(placed.members, placed.team_from_map, component))
      place_frames(
          placed, [](const PreparedMap& map) { return map.submaps.empty(); }, component);
    if (!is_alone) component.merged = judging_.lasers().merged_maps(members);
    for (const std::size_t m : members)
      if (judging_.lasers().is_overruled(m)) component.bent.push_back(judging_.maps()[m].map->id);
    return component;
  }

  // Of members that `counts` names.
  template <class Counts>
  void place_frames(const PlacedTeam& placed, const Counts& counts, Component& component) const {
    const auto& members = placed.members.maps;
    const bool is_alone = members.size() == 1;
    const Map& team = component.map;
    for (std::size_t i = 0; i < members.size(); ++i) {
      if (!counts(judging_.maps()[members[i]])) continue;
      const Map& map = judging_.map_in_team(members[i], is_alone);
      const auto& [first, node] = first_within(map, team);
      const double of_grid = is_alone ? 1.0 : judging_.grids().scale(members[i]), scale = placed.team_from_map[i].scale;
      if (of_grid != 1.0) component.scales.set(map.id, of_grid);
      const Pose3& team_from_node = team.nodes.find(first)->map_from_node;
      component.team_from_map.set(
          map.id, rig::frame_by_node(team_from_node, node.map_from_node, rig::extrinsics_of(map), scale));
      if (scale != 1.0) component.scales.set(map.id, scale);
    }
  }

  void report() {
    const auto size = [](const Component& component) {
      const auto& nodes = component.map.nodes;
      return std::count_if(nodes.begin(), nodes.end(),
                           [](const auto& entry) { return entry.second.payload != nullptr; });
    };
    std::stable_sort(result_.components.begin(), result_.components.end(),
                     [&](const Component& l, const Component& r) { return size(l) > size(r); });
    note_connections(result_.components, pairs_);
    if (!input_.priors.empty()) check_priors(judging_.lasers(), result_.components, pairs_);
    for (PairJoin& pair : pairs_) result_.verdicts.push_back(std::move(pair.result.verdict));
    result_.judgements = judging_.judgements();
    result_.audits = audit_.result();
    for (const MergedTeam& team : judging_.lasers().merged().teams())
      if (team.is_reopened) result_.reopened.push_back(team.given->members);
  }

  const FusionInput& input_;
  Progress& progress_;
  PairJudging judging_;
  ComponentAudit audit_;
  TeamInPlane in_plane_;
  TeamInSpace in_space_;
  std::vector<PairJoin> pairs_;
  FusionResult result_;
};

}  // namespace

std::vector<Judgement> judge_pairs(const FusionInput& input, const std::vector<FirstPair>& pairs,
                                   const FusionOptions& options, Memo& memo, WorkerPool& pool, Progress& progress) {
  PairJudging judging(input, options, memo, pool);
  judging.prepare_maps();
  judging.judge(pairs, progress);
  return judging.judgements();
}

std::shared_ptr<matching::ModelCache> make_models(const FusionOptions& options) {
  return std::make_shared<matching::ModelCache>(static_cast<std::size_t>(options.cache_mb) << 20U);
}

std::shared_ptr<KeptSights> make_sights() { return std::make_shared<KeptSights>(); }

std::vector<FirstPair> first_pairs(const FusionInput& input, const FusionOptions& options, WorkerPool& pool) {
  Memo memo;
  PairJudging judging(input, options, memo, pool);
  judging.prepare_maps();
  return judging.first_pairs();
}

FusionResult fuse(const FusionInput& input, const FusionOptions& options, Memo& memo, WorkerPool& pool,
                  Progress& progress) {
  return Fusing(input, options, memo, pool, progress).run();
}

}  // namespace mapweave::fusion
