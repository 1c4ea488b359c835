#include "team_in_space.h"
#include "decision/verdict.h"
#include "visual/visual_team.h"
#include "visual/warm_start.h"

namespace mapweave::fusion {

// Joins that close a loop must lie as the tree of the strongest has it.
std::optional<std::vector<Sim3>> TeamInSpace::place(const TeamMembers& members) const {
  Tree tree = strongest_tree(members);
  bool do_all_agree = true;
  for (PairJoin* join : tree.other_joins) {
    const Sim3 a_from_b =
        compose(inverse(tree.team_from_map[members.place_of(join->a)]), tree.team_from_map[members.place_of(join->b)]);
    if (lie_alike(seen_[join->b], a_from_b, join->result.verdict.alignment->a_from_b)) continue;
    refuse_as_inconsistent(join->result.verdict);
    do_all_agree = false;
  }
  if (!do_all_agree) return std::nullopt;
  rescale_to_metres(members, tree.team_from_map);
  return tree.team_from_map;
}

void TeamInSpace::solve(const TeamMembers& members, const std::vector<Sim3>& team_from_map, Component& team) const {
  std::vector<const VisualMap*> seen;
  for (const std::size_t m : members.maps) seen.push_back(&seen_[m]);
  std::vector<VisualJoin> joins;
  for (const PairJoin* join : members.joins)
    joins.push_back({members.place_of(join->a), members.place_of(join->b), &join->seen});
  const std::vector<ClaimedSighting> claimed = claimed_within(members.maps);
  VisualTeam solved =
      solve_team(seen, joins, team_from_map, claimed, options_.visual, largest_within(input_.teams, seen));
  team.map.nodes = std::move(solved.nodes);
  team.map.landmarks = std::move(solved.landmarks);
  team.map.constraints = std::move(solved.constraints);
  team.same_as = std::move(solved.same_as);
  back_to_lowest(*maps_[members.maps.front()].map, team.map);
}

}  // namespace mapweave::fusion
