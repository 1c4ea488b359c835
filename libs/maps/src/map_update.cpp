#include <mapweave/core/error.h>
#include <mapweave/maps/map_update.h>

#include "sameness.h"

namespace mapweave {
namespace {

template <class Key, class Value>
std::vector<Key> keys_missing_from(const Table<Key, Value>& newer, const Table<Key, Value>& older) {
  std::vector<Key> missing;
  for (const auto& [key, value] : older)
    if (!newer.contains(key)) missing.push_back(key);
  return missing;
}

// What leads from one state of a landmark to the next once `gone` nodes (ascending) took their sightings along; nothing
// where only the whole landmark does.
std::optional<LandmarkChange> change_between(const Landmark& before, const Landmark& after,
                                             const std::vector<NodeId>& gone) {
  if (before.anchor != after.anchor || before.colour != after.colour) return std::nullopt;
  LandmarkChange change;
  change.id = after.id;
  if (before.point_units != after.point_units) change.point_units = after.point_units;
  auto old = before.seen.begin();
  const auto pass_gone_before = [&](const NodeId* next) {
    for (; old != before.seen.end() && (next == nullptr || old->node < *next); ++old)
      if (!std::binary_search(gone.begin(), gone.end(), old->node)) return false;
    return true;
  };
  for (const LandmarkSighting& sighting : after.seen) {
    if (!pass_gone_before(&sighting.node)) return std::nullopt;
    const bool known = old != before.seen.end() && old->node == sighting.node;
    if (!known || !same(*old, sighting)) change.seen.push_back(sighting);
    if (known) ++old;
  }
  if (!pass_gone_before(nullptr)) return std::nullopt;
  return change;
}

}  // namespace

MapUpdate difference(const Map& older, const Map& newer) {
  MAPWEAVE_EXPECT(older.id.empty() || older.id == newer.id, "two states of one map");
  MapUpdate update;
  update.origin.map = newer.id;
  for (const auto& [id, node] : newer.nodes) {
    const Node* before = older.nodes.find(id);
    if (before == nullptr) {
      update.nodes.push_back(node);
      continue;
    }
    MAPWEAVE_EXPECT(before->stamp == node.stamp && same(before->payload, node.payload),
                    "content never changes: " + to_string(id));
    if (!same(before->map_from_node, node.map_from_node)) update.moved.push_back({id, node.map_from_node});
  }
  for (const auto& [id, submap] : newer.submaps) {
    const Submap* before = older.submaps.find(id);
    if (before != nullptr && same(*before, submap)) continue;
    MAPWEAVE_EXPECT(before == nullptr || !before->frozen, "a frozen submap never changes: " + to_string(id));
    update.submaps.push_back(submap);
  }
  for (const auto& [id, constraint] : newer.constraints) {
    const Constraint* before = older.constraints.find(id);
    if (before == nullptr || !same(*before, constraint)) update.constraints.push_back(constraint);
  }
  update.removed_nodes = keys_missing_from(newer.nodes, older.nodes);
  update.removed_submaps = keys_missing_from(newer.submaps, older.submaps);
  update.removed_constraints = keys_missing_from(newer.constraints, older.constraints);
  for (const auto& [id, landmark] : newer.landmarks) {
    const Landmark* before = older.landmarks.find(id);
    const auto change = before == nullptr ? std::nullopt : change_between(*before, landmark, update.removed_nodes);
    if (!change)
      update.landmarks.push_back(landmark);
    else if (change->point_units || !change->seen.empty())
      update.changed_landmarks.push_back(*change);
  }
  update.removed_landmarks = keys_missing_from(newer.landmarks, older.landmarks);
  return update;
}

Map updated(Map older, const MapUpdate& update) {
  apply(older, update);
  return older;
}

}  // namespace mapweave
