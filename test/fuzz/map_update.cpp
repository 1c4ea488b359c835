// Updates of maps: what robots, edges and the cloud send, and stores and journals keep.

#include "fuzz_target.h"

#include <maps/messages.h>

namespace mapweave::fuzz {
namespace {

const Map& known_map() {
  static const Map map = test::RandomMaps(1).map("alpha", 12);
  return map;
}

// What an update makes of a map has an update again, which makes the same.
void apply(const Map& map, const MapUpdate& update) {
  const Map made = updated(map, update);
  const std::string whole = encode(difference({}, made));
  expect(encode(difference({}, updated({}, decode_map_update(whole, kWhere)))) == whole, "a map comes back as it was");
}

}  // namespace

std::vector<std::string> seeds() {
  Map moved = known_map();
  Node node = moved.nodes.front().second;
  node.map_from_node.t.x() += 1.0;
  moved.nodes.set(node.id, node);
  return {encode(test::scan_update(1, 12)),       encode(difference({}, known_map())),
          encode(difference(known_map(), moved)), encode(test::keyframe_update(2, 6)),
          encode(test::of_a_client(3, 20)),       encode(difference({}, test::RandomMaps(4).keyframe_map("alpha", 5)))};
}

void decode(std::string_view bytes) {
  round_trip(decode_map_update)(bytes);
  const MapUpdate update = decode_map_update(bytes, kWhere);
  for (const Map& map : {Map{}, known_map()}) {
    try {
      apply(map, update);
    } catch (const Error& error) {
      expect(error.code() == ErrorCode::kBadInput, std::string("it does not fit: ") + error.what());
    }
  }
}

}  // namespace mapweave::fuzz
