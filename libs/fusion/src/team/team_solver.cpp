#include "team_solver.h"

#include <mapweave/core/disjoint_sets.h>
#include <mapweave/core/error.h>

#include <algorithm>

namespace mapweave::fusion {

TeamSolver::Tree TeamSolver::strongest_tree(const TeamMembers& members) const {
  std::vector<PairJoin*> strongest = members.joins;
  std::stable_sort(strongest.begin(), strongest.end(),
                   [](const PairJoin* l, const PairJoin* r) { return l->witnesses() > r->witnesses(); });
  const std::size_t count = members.maps.size();
  Tree result;
  DisjointSets groups(count);
  std::vector<std::vector<std::pair<std::size_t, Sim3>>> branches(count);
  for (PairJoin* join : strongest) {
    const std::size_t a = members.place_of(join->a), b = members.place_of(join->b);
    if (!groups.join(a, b)) {
      result.other_joins.push_back(join);
      continue;
    }
    const Sim3& a_from_b = join->result.verdict.alignment->a_from_b;
    branches[a].emplace_back(b, a_from_b);
    branches[b].emplace_back(a, inverse(a_from_b));
  }
  result.team_from_map.resize(count);
  std::vector<bool> placed(count, false);
  std::vector<std::size_t> open{0};
  placed[0] = true;
  while (!open.empty()) {
    const std::size_t here = open.back();
    open.pop_back();
    for (const auto& [next, here_from_next] : branches[here]) {
      if (placed[next]) continue;
      placed[next] = true;
      result.team_from_map[next] = compose(result.team_from_map[here], here_from_next);
      open.push_back(next);
    }
  }
  return result;
}

bool TeamSolver::is_metric(std::size_t map) const { return !maps_[map].map->submaps.empty() || seen_[map].is_metric(); }

void TeamSolver::rescale_to_metres(const TeamMembers& members, std::vector<Sim3>& team_from_map) const {
  const auto& maps = members.maps;
  auto known = std::find_if(maps.begin(), maps.end(), [&](std::size_t m) { return !maps_[m].submaps.empty(); });
  if (known == maps.end()) known = std::find_if(maps.begin(), maps.end(), [&](std::size_t m) { return is_metric(m); });
  if (known == maps.end()) return;
  const double scale = team_from_map[static_cast<std::size_t>(known - maps.begin())].scale;
  for (std::size_t i = 0; i < maps.size(); ++i) {
    Sim3& pose = team_from_map[i];
    pose.pose.t /= scale;
    pose.scale = is_metric(maps[i]) ? 1.0 : pose.scale / scale;
  }
}

std::vector<ClaimedSighting> TeamSolver::claimed_within(const std::vector<std::size_t>& maps) const {
  const auto place_of = [&](std::size_t map) { return std::lower_bound(maps.begin(), maps.end(), map) - maps.begin(); };
  std::vector<ClaimedSighting> result;
  for (ClaimedSighting claim : judging_.claimed_sightings().sightings()) {
    if (!std::binary_search(maps.begin(), maps.end(), claim.map) ||
        !std::binary_search(maps.begin(), maps.end(), claim.map_of_landmark))
      continue;
    claim.map = static_cast<std::size_t>(place_of(claim.map));
    claim.map_of_landmark = static_cast<std::size_t>(place_of(claim.map_of_landmark));
    result.push_back(claim);
  }
  return result;
}

const std::pair<NodeId, Node>& first_within(const Map& map, const Map& team) {
  const auto first = std::find_if(map.nodes.begin(), map.nodes.end(),
                                  [&](const auto& entry) { return team.nodes.find(entry.first) != nullptr; });
  MAPWEAVE_EXPECT(first != map.nodes.end(), "a team has nodes of each member");
  return *first;
}

Pose3 back_to_lowest(const Map& lowest, Map& team) {
  const auto& [first, node] = first_within(lowest, team);
  const Pose3 shift = compose(node.map_from_node, inverse(team.nodes.find(first)->map_from_node));
  for (auto& entry : team.nodes) entry.second.map_from_node = compose(shift, entry.second.map_from_node);
  return shift;
}

}  // namespace mapweave::fusion
