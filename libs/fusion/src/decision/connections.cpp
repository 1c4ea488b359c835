#include "connections.h"

#include <algorithm>
#include <deque>
#include <map>
#include <set>

namespace mapweave::fusion {
namespace {

using Neighbours = std::map<MapId, std::set<MapId>>;  // by matched pairs

// The maps between two on the shortest path that does not go over their own match; of equal ones that of the lowest
// names.
std::vector<MapId> path_between(const MapId& a, const MapId& b, const Neighbours& neighbours) {
  const auto may_step = [&](const MapId& from, const MapId& to) {
    return !(from == a && to == b) && !(from == b && to == a);
  };
  std::map<MapId, std::size_t> steps_to_b{{b, 0}};
  std::deque<MapId> open{b};
  while (!open.empty()) {
    const MapId here = open.front();
    open.pop_front();
    const auto around = neighbours.find(here);
    if (around == neighbours.end()) continue;
    for (const MapId& next : around->second)
      if (may_step(here, next) && steps_to_b.emplace(next, steps_to_b.at(here) + 1).second) open.push_back(next);
  }
  std::vector<MapId> path;
  if (steps_to_b.count(a) == 0) return path;
  for (MapId here = a; here != b;) {
    for (const MapId& next : neighbours.at(here)) {
      const auto steps = steps_to_b.find(next);
      if (!may_step(here, next) || steps == steps_to_b.end() || steps->second + 1 != steps_to_b.at(here)) continue;
      here = next;
      break;
    }
    if (here != b) path.push_back(here);
  }
  return path;
}

Sim3 team_from(const Component& component, const MapId& id) {
  const double* scale = component.scales.find(id);
  return {*component.team_from_map.find(id), scale == nullptr ? 1.0 : *scale};
}

}  // namespace

void note_connections(const std::vector<Component>& components, std::vector<PairJoin>& pairs) {
  std::map<MapId, const Component*> component_of;
  for (const Component& component : components)
    for (const MapId& id : component.members) component_of.emplace(id, &component);
  Neighbours neighbours;
  for (const PairJoin& pair : pairs) {
    if (!pair.is_accepted()) continue;
    const Verdict& verdict = pair.result.verdict;
    neighbours[verdict.a].insert(verdict.b);
    neighbours[verdict.b].insert(verdict.a);
  }
  for (PairJoin& pair : pairs) {
    Verdict& verdict = pair.result.verdict;
    const Component& component = *component_of.at(verdict.a);
    if (&component != component_of.at(verdict.b)) {
      verdict.merge.reset();
      continue;
    }
    const Sim3 a_from_b = compose(inverse(team_from(component, verdict.a)), team_from(component, verdict.b));
    verdict.in_one_map = InOneMap{a_from_b, path_between(verdict.a, verdict.b, neighbours)};
  }
}

}  // namespace mapweave::fusion
