#pragma once
// Local bundle adjustment: the newest keyframe and those that see the same landmarks, held by others.

#include "landmark_map.h"

namespace mapweave::visual {

// Work bounded by the window's size. Sightings that do not fit are forgotten, landmarks that nobody sees are gone.
void adjust_window(LandmarkMap& map, int newest, const WindowOptions& options);

}  // namespace mapweave::visual
