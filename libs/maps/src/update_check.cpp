#include "update_check.h"

#include "sameness.h"
#include "soundness.h"
#include "submap_content.h"

#include <mapweave/core/error.h>

namespace mapweave {
namespace {

std::string named(const ConstraintId& id) {
  return "constraint from " + to_string(id.from) + " to " + to_string(id.to);
}

// What the map will hold, of what it holds and what the update brings; null for what will not be there.
template <class Key, class Value>
const Value* found_after(const Table<Key, Value>& table, const std::vector<Key>& removed,
                         const std::vector<Value>& brought, const Key& key) {
  if (const Value* value = found(brought, key)) return value;
  return is_among(removed, key) ? nullptr : table.find(key);
}

void expect_ascending(const MapUpdate& update) {
  const auto rise = [](const auto& list, const auto& id_of) {
    MAPWEAVE_EXPECT(
        std::adjacent_find(list.begin(), list.end(),
                           [&](const auto& a, const auto& b) { return !(id_of(a) < id_of(b)); }) == list.end(),
        "the lists of an update are in ascending order of ids");
  };
  const auto itself = [](const auto& id) -> const auto& { return id; };
  const auto its_id = [](const auto& value) -> const auto& { return value.id; };
  rise(update.nodes, its_id);
  rise(update.moved, its_id);
  rise(update.submaps, its_id);
  rise(update.constraints, its_id);
  rise(update.landmarks, its_id);
  rise(update.changed_landmarks, its_id);
  rise(update.removed_nodes, itself);
  rise(update.removed_submaps, itself);
  rise(update.removed_constraints, itself);
  rise(update.removed_landmarks, itself);
}

// Whether an update fits a map, which stays as it is. Throws where it does not.
class Check {
 public:
  // known: null, or of the map.
  Check(const Map& map, const LandmarksByNode* known, const MapUpdate& update)
      : map_(map), known_(known), update_(update) {}

  // Landmarks that stay as they are, but for sightings that the removed nodes take along. One may come more than once.
  std::vector<LandmarkId> run() const {
    expect_ascending(update_);
    if (!map_.id.empty() && map_.id != update_.origin.map) does_not_fit("it is applied to map '" + map_.id.str() + "'");
    expect_there(map_.landmarks, update_.removed_landmarks);
    expect_there(map_.constraints, update_.removed_constraints);
    expect_there(map_.submaps, update_.removed_submaps);
    expect_there(map_.nodes, update_.removed_nodes);
    check_nodes();
    for (const Submap& submap : update_.submaps) check(submap);
    for (const Constraint& constraint : update_.constraints) expect_nodes_of(constraint);
    check_landmarks();
    if (update_.removed_nodes.empty()) return {};
    expect_nothing_left_hanging();
    return landmarks_seen_less();
  }

 private:
  [[noreturn]] void does_not_fit(const std::string& what) const {
    throw Error(ErrorCode::kBadInput, "the update does not fit: " + what,
                "update " + std::to_string(update_.sequence) + " of map '" + update_.origin.map.str() + "'",
                "send the map again from its first update");
  }

  template <class Key, class Value>
  void expect_there(const Table<Key, Value>& table, const std::vector<Key>& keys) const {
    for (const Key& key : keys)
      if (!table.contains(key)) does_not_fit("it removes something that is not there");
  }

  const Node* node(const NodeId& id) const { return found_after(map_.nodes, update_.removed_nodes, update_.nodes, id); }

  void check_nodes() const {
    for (const Node& fresh : update_.nodes) {
      const Node* before = is_among(update_.removed_nodes, fresh.id) ? nullptr : map_.nodes.find(fresh.id);
      if (before != nullptr && !(before->stamp == fresh.stamp && same(before->payload, fresh.payload)))
        does_not_fit(to_string(fresh.id) + " is known with other content");
    }
    for (const MovedNode& moved : update_.moved)
      if (node(moved.id) == nullptr) does_not_fit("it moves an unknown node, " + to_string(moved.id));
  }

  void expect_nodes_of(const Submap& submap) const {
    for (const auto& member : submap.submap_from_node) {
      const Node* held = node(member.first);
      if (held == nullptr) does_not_fit(to_string(submap.id) + " holds an unknown node, " + to_string(member.first));
      if (held->payload == nullptr)
        does_not_fit(to_string(submap.id) + " holds a node without content, " + to_string(member.first));
    }
  }

  void expect_nodes_of(const Constraint& constraint) const {
    for (const NodeId& end : {constraint.id.from, constraint.id.to})
      if (node(end) == nullptr) does_not_fit(named(constraint.id) + " ends at an unknown node, " + to_string(end));
  }

  void check(const Submap& submap) const {
    if (submap.submap_from_node.empty()) does_not_fit(to_string(submap.id) + " holds no nodes");
    expect_nodes_of(submap);
    const Submap* before = is_among(update_.removed_submaps, submap.id) ? nullptr : map_.submaps.find(submap.id);
    if (before != nullptr && before->frozen && !same(*before, submap))
      does_not_fit(to_string(submap.id) + " is frozen and would change");
    if (submap.frozen && submap.content != content_hash(submap, [this](const NodeId& id) { return node(id); }))
      does_not_fit(to_string(submap.id) + " is frozen with other content than its hash says");
  }

  const CameraGeometry& camera_at(const NodeId& id, const LandmarkId& landmark) const {
    const Node* hung_on = node(id);
    if (hung_on == nullptr) does_not_fit(to_string(landmark) + " hangs on an unknown node, " + to_string(id));
    const KeyframeFeatures* keyframe = keyframe_of(*hung_on);
    if (keyframe == nullptr) does_not_fit(to_string(landmark) + " hangs on a node without keyframe, " + to_string(id));
    return *keyframe->geometry;
  }

  // Of a Landmark or LandmarkChange.
  template <class AnyLandmark>
  void expect_seen_in_pictures(const AnyLandmark& landmark) const {
    if (const std::string problem = problem_with(landmark); !problem.empty())
      does_not_fit(to_string(landmark.id) + ": " + problem);
    for (const LandmarkSighting& sighting : landmark.seen)
      if (!is_inside(sighting, camera_at(sighting.node, landmark.id)))
        does_not_fit(to_string(landmark.id) + " is seen outside of the picture of " + to_string(sighting.node));
  }

  void check_landmarks() const {
    for (const Landmark& landmark : update_.landmarks) {
      expect_seen_in_pictures(landmark);
      camera_at(landmark.anchor, landmark.id);
    }
    for (const LandmarkChange& change : update_.changed_landmarks) {
      if (found_after(map_.landmarks, update_.removed_landmarks, update_.landmarks, change.id) == nullptr)
        does_not_fit("it changes an unknown landmark, " + to_string(change.id));
      expect_seen_in_pictures(change);
    }
    for (const LandmarkChange& borrowed : update_.borrowed) expect_seen_in_pictures(borrowed);
  }

  bool goes(const NodeId& id) const { return is_among(update_.removed_nodes, id); }
  template <class Key, class Value>
  bool stays_as_it_is(const Key& key, const std::vector<Key>& removed, const std::vector<Value>& brought) const {
    return !is_among(removed, key) && found(brought, key) == nullptr;
  }

  void expect_nothing_left_hanging() const {
    for (const auto& [id, submap] : map_.submaps) {
      const auto& members = submap.submap_from_node;
      if (std::any_of(members.begin(), members.end(), [this](const auto& member) { return goes(member.first); }) &&
          stays_as_it_is(id, update_.removed_submaps, update_.submaps))
        expect_nodes_of(submap);
    }
    for (const auto& [id, constraint] : map_.constraints)
      if ((goes(id.from) || goes(id.to)) && stays_as_it_is(id, update_.removed_constraints, update_.constraints))
        expect_nodes_of(constraint);
  }

  bool loses_sightings(const Landmark& landmark) const {
    const auto& seen = landmark.seen;
    const auto& removed = update_.removed_nodes;
    return !seen.empty() && !(seen.back().node < removed.front()) && !(removed.back() < seen.front().node) &&
           std::any_of(seen.begin(), seen.end(),
                       [this](const LandmarkSighting& sighting) { return goes(sighting.node); });
  }

  std::vector<LandmarkId> landmarks_seen_less() const {
    std::vector<LandmarkId> result;
    const auto look_at = [&](const LandmarkId& id, const Landmark& landmark) {
      const bool loses_anchor = goes(landmark.anchor), is_seen_less = loses_sightings(landmark);
      if (!(loses_anchor || is_seen_less) || !stays_as_it_is(id, update_.removed_landmarks, update_.landmarks)) return;
      if (loses_anchor) camera_at(landmark.anchor, id);
      if (is_seen_less) result.push_back(id);
    };
    if (known_ == nullptr) {
      for (const auto& [id, landmark] : map_.landmarks) look_at(id, landmark);
      return result;
    }
    for (const NodeId& node : update_.removed_nodes)
      for (const LandmarkId& id : known_->at(node))
        if (const Landmark* landmark = map_.landmarks.find(id)) look_at(id, *landmark);
    return result;
  }

  const Map& map_;
  const LandmarksByNode* known_;
  const MapUpdate& update_;
};

}  // namespace

std::vector<LandmarkId> expect_fitting(const Map& map, const LandmarksByNode* known, const MapUpdate& update) {
  return Check(map, known, update).run();
}

}  // namespace mapweave
