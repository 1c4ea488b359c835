#include "forgotten_content.h"

#include <mapweave/tiers/kept_map.h>

#include <algorithm>

namespace mapweave::tiers {
namespace {

// Of keyframes that the map has, those that it does not know of.
void see_more(const Map& map, std::vector<LandmarkSighting>& seen, const std::vector<LandmarkSighting>& more) {
  for (const LandmarkSighting& sighting : more) {
    const auto place =
        std::lower_bound(seen.begin(), seen.end(), sighting.node,
                         [](const LandmarkSighting& one, const NodeId& node) { return one.node < node; });
    if (map.nodes.contains(sighting.node) && (place == seen.end() || sighting.node < place->node))
      seen.insert(place, sighting);
  }
}

void add_landmark(Map& map, const Landmark& landmark) {
  if (Landmark* known = map.landmarks.find(landmark.id)) return see_more(map, known->seen, landmark.seen);
  if (!map.nodes.contains(landmark.anchor)) return;
  Landmark whole = landmark;
  whole.seen.clear();
  see_more(map, whole.seen, landmark.seen);
  if (!whole.seen.empty()) map.landmarks.set(whole.id, std::move(whole));
}

}  // namespace

void put_back(Map& map, const std::vector<MapUpdate>& taken_out, const std::map<NodeId, Pose3>& poses) {
  for (const MapUpdate& out : taken_out)
    for (const Node& node : out.nodes)
      if (const auto pose = poses.find(node.id); pose != poses.end()) {
        Node placed = node;
        placed.map_from_node = pose->second;
        map.nodes.set(placed.id, std::move(placed));
      }
  for (const MapUpdate& out : taken_out) {
    for (const Landmark& landmark : out.landmarks) add_landmark(map, landmark);
    for (const LandmarkChange& change : out.changed_landmarks)
      if (Landmark* known = map.landmarks.find(change.id)) see_more(map, known->seen, change.seen);
  }
}

std::size_t add_forgotten(Map& own, const std::vector<KeptMap>& kept,
                          const std::vector<visual::PlacedForgotten>& placed) {
  std::size_t added = 0;
  for (const KeptMap& one : kept)
    for (const visual::PlacedForgotten& place : placed) {
      const Node* node = one.map.nodes.find(place.id);
      if (node == nullptr || place.map != own.id || one.forgotten_nodes.count(place.id) == 0 ||
          own.nodes.contains(place.id))
        continue;
      Node moved = *node;
      moved.map_from_node = place.map_from_robot;
      own.nodes.set(moved.id, std::move(moved));
      ++added;
    }
  if (added == 0) return 0;
  for (const KeptMap& one : kept)
    for (const auto& [id, landmark] : one.map.landmarks)
      if (own.landmarks.contains(id) || one.forgotten_landmarks.count(id) != 0) add_landmark(own, landmark);
  return added;
}

}  // namespace mapweave::tiers
