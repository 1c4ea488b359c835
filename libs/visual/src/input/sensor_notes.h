#pragma once
// What seems to be wrong with a sensor, in words for its owner.

#include "mapping/depth.h"

#include <string>
#include <vector>

namespace mapweave::visual {

class SensorNotes {
 public:
  // Each frame: whether its depth is of its time.
  void look_at(const Frame& frame);
  // Each frame that shows enough, and too few depths to begin a map.
  void miss_depth(const Frame& frame, const LandmarkMap& map, const ClientOptions& options);
  const std::vector<std::string>& all() const { return notes_; }

 private:
  std::vector<std::string> notes_;
  int without_depth_ = 0;  // frames
  bool noted_delay_ = false;
};

}  // namespace mapweave::visual
