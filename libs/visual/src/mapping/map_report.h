#pragma once
// What a client says of its map.

#include "landmark_map.h"

#include <mapweave/visual/visual_client.h>

namespace mapweave::visual {

std::vector<PlacedFrame> frames_of(const LandmarkMap& map);        // as their keyframes stand now; by stamp
std::vector<PlacedFrame> keyframes_of(const LandmarkMap& map);     // that are kept; by stamp
std::vector<MappedLandmark> landmarks_of(const LandmarkMap& map);  // its own
std::size_t borrowed_of(const LandmarkMap& map);                   // landmarks that keyframes see
std::vector<int> sessions_of(const LandmarkMap& map);              // ascending

}  // namespace mapweave::visual
