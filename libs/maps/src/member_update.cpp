#include <mapweave/maps/member_update.h>

#include "sameness.h"

#include <algorithm>

namespace mapweave {
namespace {

bool is_among(const std::vector<SessionId>& sorted, const SessionId& session) {
  return std::binary_search(sorted.begin(), sorted.end(), session);
}

// What a team map holds of some sessions, but for the nodes that are excluded. Landmarks of a team are merged ones, and
// left out.
Map part_of(const Map& team, const MapId& id, const std::vector<SessionId>& sessions,
            const std::vector<NodeId>& excluded) {
  Map part;
  part.id = id;
  for (const auto& [node_id, node] : team.nodes)
    if (is_among(sessions, node_id.session) && !std::binary_search(excluded.begin(), excluded.end(), node_id))
      part.nodes.set(node_id, node);
  for (const auto& [submap_id, submap] : team.submaps)
    if (std::all_of(submap.submap_from_node.begin(), submap.submap_from_node.end(),
                    [&](const auto& member) { return part.nodes.contains(member.first); }))
      part.submaps.set(submap_id, submap);
  for (const auto& [constraint_id, constraint] : team.constraints)
    if (part.nodes.contains(constraint_id.from) && part.nodes.contains(constraint_id.to))
      part.constraints.set(constraint_id, constraint);
  return part;
}

}  // namespace

MapUpdate member_update(const Map& team, const Map& own) {
  std::vector<NodeId> excluded;  // of other content there
  for (const auto& [id, node] : own.nodes) {
    const Node* there = team.nodes.find(id);
    if (there != nullptr && !(there->stamp == node.stamp && same(there->payload, node.payload))) excluded.push_back(id);
  }
  Map part = part_of(team, own.id, own.sessions(), excluded);
  std::vector<SubmapId> others;  // of other content there
  for (const auto& [id, submap] : part.submaps) {
    const Submap* mine = own.submaps.find(id);
    if (mine == nullptr || !same(*mine, submap)) others.push_back(id);
  }
  part.submaps.erase_all(others);
  MapUpdate update = difference(part, own);
  // All nodes are named, so that the update says which sessions it is about.
  update.moved.clear();
  for (const auto& [id, node] : own.nodes)
    if (part.nodes.contains(id)) update.moved.push_back({id, node.map_from_node});
  update.removed_submaps = std::move(others);
  return update;
}

Map member_of(const Map& team, const MapUpdate& update) {
  std::vector<SessionId> sessions;
  std::vector<NodeId> excluded;
  for (const Node& node : update.nodes) {
    excluded.push_back(node.id);
    if (sessions.empty() || sessions.back() != node.id.session) sessions.push_back(node.id.session);
  }
  for (const MovedNode& moved : update.moved)
    if (sessions.empty() || sessions.back() != moved.id.session) sessions.push_back(moved.id.session);
  std::sort(sessions.begin(), sessions.end());
  Map part = part_of(team, update.origin.map, sessions, excluded);
  MapUpdate rest = update;
  part.submaps.erase_all(rest.removed_submaps);
  rest.removed_submaps.clear();
  return updated(std::move(part), rest);
}

}  // namespace mapweave
