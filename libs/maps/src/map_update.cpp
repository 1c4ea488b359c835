#include <mapweave/core/error.h>
#include <mapweave/maps/map_update.h>

#include "sameness.h"
#include "soundness.h"

namespace mapweave {
namespace {

std::string named(const ConstraintId& id) { return "constraint from " + to_string(id.from) + " to " + to_string(id.to); }

[[noreturn]] void does_not_fit(const MapUpdate& update, const std::string& what) {
  throw Error(ErrorCode::kBadInput, "the update does not fit: " + what,
              "update " + std::to_string(update.sequence) + " of map '" + update.origin.map.str() + "'",
              "send the map again from its first update");
}

template <class Key, class Value>
std::vector<Key> keys_missing_from(const Table<Key, Value>& newer, const Table<Key, Value>& older) {
  std::vector<Key> missing;
  for (const auto& [key, value] : older)
    if (!newer.contains(key)) missing.push_back(key);
  return missing;
}

template <class Key, class Value>
void remove_all(Table<Key, Value>& table, std::vector<Key> removed, const MapUpdate& update) {
  if (removed.empty()) return;
  for (const Key& key : removed)
    if (!table.contains(key)) does_not_fit(update, "it removes something that is not there");
  std::sort(removed.begin(), removed.end());
  Table<Key, Value> kept;
  kept.reserve(table.size());
  for (auto& [key, value] : table)
    if (!std::binary_search(removed.begin(), removed.end(), key)) kept.set(key, std::move(value));
  table = std::move(kept);
}

// As table.set() for each value, in linear time also where the new keys lie between the old ones.
template <class Key, class Value>
void set_all(Table<Key, Value>& table, const std::vector<Value>& values) {
  Table<Key, Value> added;
  for (const Value& value : values) added.set(value.id, value);
  if (added.empty()) return;
  if (table.empty() || table.back().first < added.front().first) {
    for (auto& [key, value] : added) table.set(key, std::move(value));
    return;
  }
  Table<Key, Value> both;
  both.reserve(table.size() + added.size());
  auto old_entry = table.begin();
  for (auto& [key, value] : added) {
    for (; old_entry != table.end() && old_entry->first < key; ++old_entry) both.set(old_entry->first, std::move(old_entry->second));
    if (old_entry != table.end() && old_entry->first == key) ++old_entry;
    both.set(key, std::move(value));
  }
  for (; old_entry != table.end(); ++old_entry) both.set(old_entry->first, std::move(old_entry->second));
  table = std::move(both);
}

void expect_nodes_of(const Submap& submap, const Map& map, const MapUpdate& update) {
  for (const auto& member : submap.submap_from_node) {
    const Node* node = map.nodes.find(member.first);
    if (node == nullptr) does_not_fit(update, to_string(submap.id) + " holds an unknown node, " + to_string(member.first));
    if (node->payload == nullptr) does_not_fit(update, to_string(submap.id) + " holds a node without content, " + to_string(member.first));
  }
}

void expect_nodes_of(const Constraint& constraint, const Map& map, const MapUpdate& update) {
  for (const NodeId& end : {constraint.id.from, constraint.id.to})
    if (!map.nodes.contains(end)) does_not_fit(update, named(constraint.id) + " ends at an unknown node, " + to_string(end));
}

// What leads from one state of a landmark to the next once `gone` nodes (ascending) took their sightings along; nothing where only the
// whole landmark does.
std::optional<LandmarkChange> change_between(const Landmark& before, const Landmark& after, const std::vector<NodeId>& gone) {
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

void change_landmark(Landmark& landmark, const LandmarkChange& change) {
  if (change.point_units) landmark.point_units = *change.point_units;
  for (const LandmarkSighting& sighting : change.seen) {
    const auto place = std::lower_bound(landmark.seen.begin(), landmark.seen.end(), sighting.node,
                                        [](const LandmarkSighting& seen, const NodeId& node) { return seen.node < node; });
    if (place != landmark.seen.end() && place->node == sighting.node)
      *place = sighting;
    else
      landmark.seen.insert(place, sighting);
  }
}

const CameraGeometry& camera_at(const NodeId& id, const Map& map, const LandmarkId& landmark, const MapUpdate& update) {
  const Node* node = map.nodes.find(id);
  if (node == nullptr) does_not_fit(update, to_string(landmark) + " hangs on an unknown node, " + to_string(id));
  const auto* keyframe = std::get_if<KeyframeFeatures>(node->payload.get());
  if (keyframe == nullptr) does_not_fit(update, to_string(landmark) + " hangs on a node without keyframe, " + to_string(id));
  return *keyframe->geometry;
}

// Of a Landmark or LandmarkChange.
template <class AnyLandmark>
void expect_fitting(const AnyLandmark& landmark, const Map& map, const MapUpdate& update) {
  if (const std::string problem = flaw(landmark); !problem.empty()) does_not_fit(update, to_string(landmark.id) + ": " + problem);
  for (const LandmarkSighting& sighting : landmark.seen)
    if (!is_inside(sighting, camera_at(sighting.node, map, landmark.id, update)))
      does_not_fit(update, to_string(landmark.id) + " is seen outside of the picture of " + to_string(sighting.node));
}

void update_landmarks(Map& map, const MapUpdate& update) {
  for (const Landmark& landmark : update.landmarks) {
    expect_fitting(landmark, map, update);
    camera_at(landmark.anchor, map, landmark.id, update);
  }
  set_all(map.landmarks, update.landmarks);
  for (const LandmarkChange& change : update.changed_landmarks) {
    Landmark* landmark = map.landmarks.find(change.id);
    if (landmark == nullptr) does_not_fit(update, "it changes an unknown landmark, " + to_string(change.id));
    expect_fitting(change, map, update);
    change_landmark(*landmark, change);
  }
}

void expect_borrowed(const Map& map, const MapUpdate& update) {
  for (const LandmarkChange& borrowed : update.borrowed) expect_fitting(borrowed, map, update);
}

void forget_sightings(Table<LandmarkId, Landmark>& landmarks, std::vector<NodeId> gone) {
  if (gone.empty()) return;
  std::sort(gone.begin(), gone.end());
  const auto is_gone = [&](const LandmarkSighting& sighting) { return std::binary_search(gone.begin(), gone.end(), sighting.node); };
  for (auto& [id, landmark] : landmarks)
    landmark.seen.erase(std::remove_if(landmark.seen.begin(), landmark.seen.end(), is_gone), landmark.seen.end());
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
    MAPWEAVE_EXPECT(before->stamp == node.stamp && same(before->payload, node.payload), "content never changes: " + to_string(id));
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
  Map map = std::move(older);
  if (map.id.empty()) map.id = update.origin.map;
  if (map.id != update.origin.map) does_not_fit(update, "it is applied to map '" + map.id.str() + "'");

  remove_all(map.landmarks, update.removed_landmarks, update);
  remove_all(map.constraints, update.removed_constraints, update);
  remove_all(map.submaps, update.removed_submaps, update);
  remove_all(map.nodes, update.removed_nodes, update);
  forget_sightings(map.landmarks, update.removed_nodes);

  for (const Node& node : update.nodes) {
    const Node* before = map.nodes.find(node.id);
    if (before != nullptr && !(before->stamp == node.stamp && same(before->payload, node.payload)))
      does_not_fit(update, to_string(node.id) + " is known with other content");
  }
  set_all(map.nodes, update.nodes);
  for (const MovedNode& moved : update.moved) {
    Node* node = map.nodes.find(moved.id);
    if (node == nullptr) does_not_fit(update, "it moves an unknown node, " + to_string(moved.id));
    node->map_from_node = moved.map_from_node;
  }

  for (const Submap& submap : update.submaps) {
    if (submap.submap_from_node.empty()) does_not_fit(update, to_string(submap.id) + " holds no nodes");
    expect_nodes_of(submap, map, update);
    const Submap* before = map.submaps.find(submap.id);
    if (before != nullptr && before->frozen && !same(*before, submap))
      does_not_fit(update, to_string(submap.id) + " is frozen and would change");
    if (submap.frozen && submap.content != content_hash(submap, map.nodes))
      does_not_fit(update, to_string(submap.id) + " is frozen with other content than its hash says");
  }
  set_all(map.submaps, update.submaps);
  for (const Constraint& constraint : update.constraints) expect_nodes_of(constraint, map, update);
  set_all(map.constraints, update.constraints);
  update_landmarks(map, update);
  expect_borrowed(map, update);

  if (!update.removed_nodes.empty()) {  // nothing may still name them
    for (const auto& [id, submap] : map.submaps) expect_nodes_of(submap, map, update);
    for (const auto& [id, constraint] : map.constraints) expect_nodes_of(constraint, map, update);
    for (const auto& [id, landmark] : map.landmarks) camera_at(landmark.anchor, map, id, update);
  }
  return map;
}

}  // namespace mapweave
