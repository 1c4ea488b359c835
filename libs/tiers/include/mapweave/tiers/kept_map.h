#pragma once
// What a camera map server keeps of a client that forgets, to stay bounded itself (CVS III-A, III-B).

#include <mapweave/maps/receipt.h>
#include <mapweave/visual/visual_client.h>

#include <cstddef>
#include <map>
#include <set>
#include <string>
#include <string_view>
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

// What add_forgotten() needs of it, as encoded MapUpdates, numbered from 1: none much longer than most_bytes, but for
// one that holds a single keyframe or landmark.
std::vector<std::string> encoded_in_parts(const KeptMap& kept, std::size_t most_bytes);

// At the other end: a client's kept maps, put together again.
class KeptParts {
 public:
  // forgotten: what the client knows that it has forgotten; nothing else is taken.
  KeptParts(SessionId client, const std::vector<visual::PlacedForgotten>& forgotten);

  // The next part of a map; one that came before, or that is not the next, is passed over. Throws Error kCorrupt or
  // kUnsupported for what cannot be decoded, kBadInput for maps, nodes and landmarks of others.
  void add(std::string_view bytes, const std::string& where);
  std::vector<Receipt> receipts() const;  // of what came
  // Whether that is all, by what the server has.
  bool is_whole(const std::vector<Receipt>& of_server) const;
  std::vector<KeptMap> take();

 private:
  SessionId client_;
  std::set<NodeId> forgotten_;
  std::map<MapId, KeptMap> maps_;
  std::map<MapId, Receipt> came_;
};

}  // namespace mapweave::tiers
