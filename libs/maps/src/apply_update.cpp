#include "update_check.h"

#include <optional>

namespace mapweave {
namespace {

template <class Key, class Value>
std::vector<std::pair<Key, Value>> entries_of(const std::vector<Value>& values, Table<Key, Value>& table) {
  std::vector<std::pair<Key, Value>> entries;
  entries.reserve(values.size());
  for (const Value& value : values) entries.emplace_back(value.id, value);
  table.make_room(entries.size());
  return entries;
}

// What the nodes saw of it, where they stay, and what others see of it now.
std::vector<LandmarkSighting> seen_after(const Landmark& before, const std::vector<NodeId>& removed,
                                         const std::vector<LandmarkSighting>& seen) {
  std::vector<LandmarkSighting> result;
  result.reserve(before.seen.size() + seen.size());
  auto next = seen.begin();
  for (const LandmarkSighting& old : before.seen) {
    while (next != seen.end() && next->node < old.node) result.push_back(*next++);
    if (next != seen.end() && next->node == old.node)
      result.push_back(*next++);
    else if (!is_among(removed, old.node))
      result.push_back(old);
  }
  result.insert(result.end(), next, seen.end());
  return result;
}

template <class Action>
void for_each_node(const Landmark& landmark, const Action& action) {
  action(landmark.anchor);
  for (const LandmarkSighting& sighting : landmark.seen) action(sighting.node);
}

bool hangs_on(const Landmark& landmark, const NodeId& node) {
  const auto place =
      std::lower_bound(landmark.seen.begin(), landmark.seen.end(), node,
                       [](const LandmarkSighting& sighting, const NodeId& wanted) { return sighting.node < wanted; });
  return landmark.anchor == node || (place != landmark.seen.end() && place->node == node);
}

// What hangs on nodes, brought up to date in two steps: what comes, which takes memory, and, once the map has changed,
// what went. Where memory fails in between, more is named than hangs there, which does no harm.
class Hanging {
 public:
  Hanging(LandmarksByNode& known, const Map& map, const MapUpdate& update) : known_(known) {
    const auto may_leave = [&](const LandmarkId& id) {
      if (const Landmark* before = map.landmarks.find(id))
        for_each_node(*before, [&](const NodeId& node) { leaving_.emplace_back(node, id); });
    };
    for (const LandmarkId& id : update.removed_landmarks) may_leave(id);
    for (const Landmark& landmark : update.landmarks) may_leave(landmark.id);
    for (const NodeId& node : update.removed_nodes)
      for (const LandmarkId& id : known.at(node)) leaving_.emplace_back(node, id);
    for (const Landmark& landmark : update.landmarks)
      for_each_node(landmark, [&](const NodeId& node) { known_.add(node, landmark.id); });
    for (const LandmarkChange& change : update.changed_landmarks)
      for (const LandmarkSighting& sighting : change.seen) known_.add(sighting.node, change.id);
  }
  void follow(const Map& map) {
    for (const auto& [node, id] : leaving_)
      if (const Landmark* landmark = map.landmarks.find(id); landmark == nullptr || !hangs_on(*landmark, node))
        known_.remove(node, id);
  }

 private:
  LandmarksByNode& known_;
  std::vector<std::pair<NodeId, LandmarkId>> leaving_;
};

void apply(Map& map, LandmarksByNode* known, const MapUpdate& update) {
  const std::vector<LandmarkId> seen_less = expect_fitting(map, known, update);

  // What takes memory comes first: where there is none, the map is as it was, too.
  auto nodes = entries_of(update.nodes, map.nodes);
  auto submaps = entries_of(update.submaps, map.submaps);
  auto constraints = entries_of(update.constraints, map.constraints);
  auto landmarks = entries_of(update.landmarks, map.landmarks);
  std::vector<std::vector<LandmarkSighting>> seen(update.changed_landmarks.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const LandmarkChange& change = update.changed_landmarks[i];
    if (change.seen.empty()) continue;
    const Landmark* whole = found(update.landmarks, change.id);
    seen[i] = whole != nullptr ? seen_after(*whole, {}, change.seen)
                               : seen_after(*map.landmarks.find(change.id), update.removed_nodes, change.seen);
  }
  std::optional<Hanging> hanging;
  if (known != nullptr) hanging.emplace(*known, map, update);

  if (map.id.empty()) map.id = update.origin.map;
  map.landmarks.erase_all(update.removed_landmarks);
  map.constraints.erase_all(update.removed_constraints);
  map.submaps.erase_all(update.removed_submaps);
  map.nodes.erase_all(update.removed_nodes);
  for (const LandmarkId& id : seen_less) {
    auto& sightings = map.landmarks.find(id)->seen;
    const auto goes = [&](const LandmarkSighting& sighting) { return is_among(update.removed_nodes, sighting.node); };
    sightings.erase(std::remove_if(sightings.begin(), sightings.end(), goes), sightings.end());
  }
  map.nodes.set_all(std::move(nodes));
  for (const MovedNode& moved : update.moved) map.nodes.find(moved.id)->map_from_node = moved.map_from_node;
  map.submaps.set_all(std::move(submaps));
  map.constraints.set_all(std::move(constraints));
  map.landmarks.set_all(std::move(landmarks));
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const LandmarkChange& change = update.changed_landmarks[i];
    Landmark& landmark = *map.landmarks.find(change.id);
    if (change.point_units) landmark.point_units = *change.point_units;
    if (!change.seen.empty()) landmark.seen = std::move(seen[i]);
  }
  if (hanging) hanging->follow(map);
}

}  // namespace

void apply(Map& map, const MapUpdate& update) { apply(map, nullptr, update); }
void apply(Map& map, LandmarksByNode& known, const MapUpdate& update) { apply(map, &known, update); }

}  // namespace mapweave
