#pragma once
// One update of a camera's map as several that a bounded queue takes one after the other.

#include <mapweave/maps/map_update.h>

#include <string>
#include <vector>

namespace mapweave::tiers {

inline constexpr std::size_t kFeatureBytes = 37;  // about, of an encoded keyframe's feature

// Encoded; the first has the update's base and number, each other one builds on the one before. Together they say the
// same, and what arrived of them is a sound map at any time: landmarks and sightings go with the last of the new
// keyframes that they need or after it, removals come last. No longer than most_bytes, but for one that holds a single
// keyframe or landmark. Contract: keyframes and landmarks alone, and nothing is both removed and published.
std::vector<std::string> encoded_in_parts(const MapUpdate& update, std::size_t most_bytes);

}  // namespace mapweave::tiers
