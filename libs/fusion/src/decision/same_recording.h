#pragma once
// Maps that hold the same recording, recognised by what was sensed: names, stamps and poses play no part.

#include <mapweave/maps/map.h>

#include <optional>
#include <vector>

namespace mapweave::fusion {

struct CopyOf {
  std::size_t original = 0;  // place among the maps: the one that holds more, of equals the first
  double share = 0.0;        // of the copy's scans, that the original holds too
};

// Of each map: whether most of what it holds is in another one too, bit for bit; of maps that edges thinned: whether
// what they kept says so. Parts of one log that share some seconds are no copies.
std::vector<std::optional<CopyOf>> copies_among(const std::vector<const Map*>& maps);

}  // namespace mapweave::fusion
