#pragma once
// A laser's map while its robot drives, as it goes up from tier to tier: what is new, once.

#include <mapweave/maps/map.h>

#include <cstdint>
#include <optional>
#include <string>

namespace mapweave::tiers {

// What others need to merge the map while it grows: nodes with scans, submaps, loop closures. Submaps that still grow
// hold their anchors alone, for the nodes after it say the rest.
Map growing_part(const Map&);
// Of such a part, to be fused: its oldest submap that still grows holds the scans since its anchor and is frozen as it
// is now, where these are at least `least_scans`; others that grow are left out.
Map as_if_frozen(const Map& part, std::size_t least_scans);
// Whether `newer` is the same map later: nothing of its content is another. An engine may begin its map anew.
bool continues(const Map& older, const Map& newer);

class GrowingMapSender {
 public:
  explicit GrowingMapSender(TierId from) : from_(from) {}
  // What is new since the last call as an encoded MapUpdate; nullopt where nothing is. A map that was begun anew is
  // sent from its beginning.
  std::optional<std::string> next(const Map& part);

 private:
  TierId from_;
  Map sent_;
  std::uint64_t sequence_ = 0;
};

}  // namespace mapweave::tiers
