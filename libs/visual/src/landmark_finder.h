#pragma once
// Which landmarks does this picture show, and where exactly?

#include "landmark_map.h"
#include "motion.h"

namespace mapweave::visual {

// Keyframes that see what the camera sees: those that share `matches` with it, and those that look from about the same place in about the
// same direction. Most promising first.
std::vector<int> near_keyframes(const LandmarkMap& map, const std::vector<Match>& matches, const View& view, int most);

class LandmarkFinder {
 public:
  // One landmark for each cell of the picture. Counts tries in the map's landmarks.
  std::vector<Match> find(LandmarkMap& map, const std::vector<int>& keyframes, const Pyramid& picture, const View& guess,
                          const Motion& motion, const TrackingOptions& options);

 private:
  std::vector<int> looked_at_;  // the last look at each landmark
  int look_ = 0;
};

}  // namespace mapweave::visual
