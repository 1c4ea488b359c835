#pragma once
// By what name and number those who use a map know it (VDA5050: mapId, mapVersion).

#include <mapweave/core/hash.h>

#include <cstdint>
#include <string>

namespace mapweave {

struct MapIdentity {
  std::string id;             // stays while the map is continued, and so does its frame
  std::uint64_t version = 0;  // 1, 2, ...; 0: the map has no identity
  Hash content;               // of its store (mapdb: identity())
};

}  // namespace mapweave
