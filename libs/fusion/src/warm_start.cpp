#include "warm_start.h"

#include <algorithm>

namespace mapweave::fusion {
namespace {

constexpr double kMoved_m = 0.02;      // by its client, since: it is adjusted again
constexpr double kLaidAgain_m = 0.15;  // so far, and its client has laid its map down again
constexpr double kElsewhere_m = 0.1;   // what was judged of new keyframes says so on the median
constexpr std::size_t kAlong = 3;      // companions of a keyframe that move with it

}  // namespace

const StandingTeam* same_team(const std::vector<StandingTeam>& teams, const std::vector<const VisualMap*>& members) {
  if (std::any_of(members.begin(), members.end(), [](const VisualMap* map) { return !map->is_metric(); })) return nullptr;
  const auto found = std::find_if(teams.begin(), teams.end(), [&](const StandingTeam& team) {
    return !team.team_from_node.empty() && std::equal(team.members.begin(), team.members.end(), members.begin(), members.end(),
                                                      [](const MapId& id, const VisualMap* map) { return id == map->map().id; });
  });
  return found == teams.end() ? nullptr : &*found;
}

std::optional<WarmStart> warm_start(const StandingTeam& before, const std::vector<const VisualMap*>& members,
                                    const std::vector<VisualJoin>& joins) {
  WarmStart start;
  std::vector<std::size_t> first;  // of each member
  for (const VisualMap* member : members) {
    first.push_back(start.is_free.size());
    const auto& keyframes = member->keyframes();
    std::vector<const Pose3*> known;
    for (const MappedKeyframe& keyframe : keyframes) known.push_back(before.team_from_node.find(keyframe.id));
    auto on = std::find_if(known.begin(), known.end(), [](const Pose3* pose) { return pose != nullptr; });
    if (on == known.end()) return std::nullopt;
    auto hung = static_cast<std::size_t>(on - known.begin());  // new ones hang on the last one that was there
    for (std::size_t i = 0; i < keyframes.size(); ++i) {
      const Pose3* told = before.map_from_node.find(keyframes[i].id);
      if (known[i] != nullptr && told != nullptr) {
        const double moved_m = (keyframes[i].map_from_node.t - told->t).norm();
        if (moved_m > kLaidAgain_m) return std::nullopt;
        hung = i;
        start.team_from_node.push_back(*known[i]), start.is_free.push_back(moved_m > kMoved_m);
      } else {
        start.team_from_node.push_back(compose(*known[hung], between(keyframes[hung].map_from_node, keyframes[i].map_from_node)));
        start.is_free.push_back(true);
      }
    }
  }
  const std::vector<char> moved = start.is_free;
  for (std::size_t m = 0; m < members.size(); ++m)
    for (std::size_t i = 0; i < members[m]->keyframes().size(); ++i) {
      const auto& companions = members[m]->keyframes()[i].companions;
      for (std::size_t c = 0; moved[first[m] + i] && c < std::min(kAlong, companions.size()); ++c)
        start.is_free[first[m] + companions[c].second] = true;
    }
  if (2 * static_cast<std::size_t>(std::count(start.is_free.begin(), start.is_free.end(), true)) > start.is_free.size())
    return std::nullopt;
  std::vector<double> apart_m;
  for (const VisualJoin& join : joins)
    for (const VisualWitness& w : *join.witnesses) {
      const std::size_t a = first[join.a] + w.keyframe_a, b = first[join.b] + w.keyframe_b;
      if (moved[a] || moved[b])
        apart_m.push_back((compose(start.team_from_node[a], w.node_a_from_node_b.pose).t - start.team_from_node[b].t).norm());
    }
  const auto middle = apart_m.begin() + static_cast<std::ptrdiff_t>(apart_m.size() / 2);
  std::nth_element(apart_m.begin(), middle, apart_m.end());
  if (!apart_m.empty() && *middle > kElsewhere_m) return std::nullopt;
  return start;
}

}  // namespace mapweave::fusion
