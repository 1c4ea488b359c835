#pragma once
// What seems to be wrong with a sensor, in words for its owner.

#include "mapping/depth.h"

#include <string>

namespace mapweave::visual {

// Why no depths are known in a frame that shows enough.
std::string note_on_depth(const Frame& frame, const LandmarkMap& map, const ClientOptions& options);
std::string note_on_delay(double delay_s);

}  // namespace mapweave::visual
