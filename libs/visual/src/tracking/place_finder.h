#pragma once
// Where is the camera, when nothing is known of how it came there? By features that keyframes know.

#include "mapping/landmark_map.h"

#include <optional>

namespace mapweave::visual {

matching::OrbFeatures features_of(const Pyramid& pictures, int most);

// The view from which most of `features` agree with what `keyframes` know. nullopt where too few do.
std::optional<View> find_place(const LandmarkMap& map, const std::vector<int>& keyframes,
                               const matching::OrbFeatures& features, std::uint64_t seed);

}  // namespace mapweave::visual
