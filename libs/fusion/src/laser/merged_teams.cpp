#include "merged_teams.h"

#include "sorted_numbers.h"

#include <algorithm>
#include <map>

namespace mapweave::fusion {
namespace {

constexpr std::size_t kUnknown = ~std::size_t{0};

// Numbers of what names; none where one of them is not there.
class Numbers {
 public:
  Numbers(const std::vector<PreparedMap>& maps, const SubmapGraph& graph) {
    for (std::size_t m = 0; m < maps.size(); ++m) {
      if (!maps[m].submaps.empty()) maps_[maps[m].map->id] = m;
      for (std::size_t s = 0; s < maps[m].submaps.size(); ++s) submaps_[maps[m].submaps[s]->id] = graph.number(m, s);
      for (const SessionId& session : maps[m].map->sessions()) map_of_.emplace(session, maps[m].map);
    }
  }
  bool knows(const NodeId& id) const {
    const auto map = map_of_.find(id.session);
    return map != map_of_.end() && map->second->nodes.contains(id);
  }
  std::optional<std::vector<std::size_t>> of(const std::vector<MapId>& names) const {
    std::vector<std::size_t> numbers;
    for (const MapId& name : names) {
      const auto known = maps_.find(name);
      if (known == maps_.end()) return std::nullopt;
      numbers.push_back(known->second);
    }
    return numbers;  // in the order of names, as maps are numbered
  }
  std::size_t of(const SubmapId& id) const {
    const auto known = submaps_.find(id);
    return known == submaps_.end() ? kUnknown : known->second;
  }

 private:
  std::map<MapId, std::size_t> maps_;
  std::map<SubmapId, std::size_t> submaps_;
  std::map<SessionId, const Map*> map_of_;
};

std::optional<MergedTeam> known(const MergedMaps& given, const Numbers& numbers, const SubmapGraph& graph) {
  const auto maps = numbers.of(given.members);
  if (!maps) return std::nullopt;
  MergedTeam team{*maps, {}, {}, &given};
  for (const MatchedSubmaps& match : given.matches) {
    const std::size_t from = numbers.of(match.from), to = numbers.of(match.to);
    if (from == kUnknown || to == kUnknown || !contains(team.maps, graph.map_of(from)) ||
        !contains(team.maps, graph.map_of(to)))
      return std::nullopt;
    team.matches.push_back({from, to, match.from_from_to, match.information, match.probability, match.judgement,
                            match.is_observable, match.overrules_own});
  }
  for (const Constraint& constraint : given.constraints)
    if (!numbers.knows(constraint.id.from) || !numbers.knows(constraint.id.to)) return std::nullopt;
  for (const MergedGroups& groups : given.merges) {
    const auto one = numbers.of(groups.one), other = numbers.of(groups.other);
    if (!one || !other) return std::nullopt;
    team.merges.push_back({*one, *other, groups.probability, groups.proposer});
  }
  return team;
}

}  // namespace

MergedTeams::MergedTeams(const std::vector<PreparedMap>& maps, const SubmapGraph& graph,
                         const std::vector<MergedMaps>& given, Memo& memo)
    : graph_(graph), place_of_team_(maps.size(), kUnknown) {
  if (given.empty()) return;
  const Numbers numbers(maps, graph);
  for (const MergedMaps& merged : given) {
    auto team = known(merged, numbers, graph);
    const auto is_taken = [&](std::size_t map) { return place_of_team_[map] < teams_.size(); };
    if (!team || std::any_of(team->maps.begin(), team->maps.end(), is_taken)) continue;
    for (const std::size_t map : team->maps) place_of_team_[map] = teams_.size();
    for (const Judgement& judgement : merged.judgements) memo.emplace(judgement.id, judgement);
    teams_.push_back(std::move(*team));
  }
}

void MergedTeams::reopen(const MapPairs& refused, const MapPairs& by_user) {
  for (MergedTeam& team : teams_)
    for (const auto& [a, b] : refused) {
      if (team.is_reopened || !contains(team.maps, a) || !contains(team.maps, b)) continue;
      team.is_reopened = by_user.count({a, b}) == 0 || are_matched(team, a, b);
    }
}

bool MergedTeams::are_matched(const MergedTeam& team, std::size_t a, std::size_t b) const {
  return std::any_of(team.matches.begin(), team.matches.end(), [&](const SubmapMatch& match) {
    return std::minmax(graph_.map_of(match.from), graph_.map_of(match.to)) == std::minmax(a, b);
  });
}

const MergedTeam* MergedTeams::team_of(std::size_t map) const {
  const std::size_t place = place_of_team_[map];
  return place < teams_.size() && !teams_[place].is_reopened ? &teams_[place] : nullptr;
}

}  // namespace mapweave::fusion
