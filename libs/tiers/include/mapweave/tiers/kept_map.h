#pragma once
// What a map server keeps of a client that forgets, to stay bounded itself (CVS III-A, III-B).

#include <mapweave/maps/map.h>
#include <mapweave/visual/visual_client.h>

#include <set>
#include <vector>

namespace mapweave::tiers {

// One of a client's maps, all of it, and what of it the client has no longer.
struct KeptMap {
  Map map;
  std::set<NodeId> forgotten_nodes;
  std::set<LandmarkId> forgotten_landmarks;
};

// The client's own map, as it has it, becomes whole again: with the keyframes that it forgot where it says that they
// lie now (those of this map; without a word of it they are left out), the landmarks that went with them, and what they
// saw of those that stayed. How many keyframes there are more is answered.
std::size_t add_forgotten(Map& own, const std::vector<KeptMap>& kept,
                          const std::vector<visual::PlacedForgotten>& placed);

}  // namespace mapweave::tiers
