#pragma once
// Which landmarks does this picture show, and where exactly?

#include "geometry/motion.h"
#include "mapping/landmark_map.h"

#include <optional>

namespace mapweave::visual {

// Keyframes of a session that see what the camera sees: those that share `matches` with it, and those that look from
// about the same place in about the same direction. Most promising first.
std::vector<int> near_keyframes(const LandmarkMap& map, int session, const std::vector<Match>& matches,
                                const View& view, int most);

// One landmark around `start`, as it looks best from there. nullopt where it does not look like that.
struct FoundLandmark {
  Eigen::Vector2d pixel;
  int level = 0;
  float correlation = 0;
};
std::optional<FoundLandmark> find_landmark(const LandmarkMap& map, const ClientLandmark& landmark,
                                           const Pyramid& picture, const View& view, const Eigen::Vector2d& start);

// Side of the cells that hold one landmark each: half as long where a frame shows few landmarks.
int cell_of_scene(std::size_t landmarks, const Pinhole& camera, const TrackingOptions& options);

// Derivative of pixels in a new view by pixels of an old one around `pixel`, on a plane that faces the old camera.
Eigen::Matrix2d warp_to(const Pinhole& camera, const Eigen::Vector2d& pixel, int level, const View& new_from_old,
                        double old_depth);

class LandmarkFinder {
 public:
  // One landmark for each cell of the picture, and one borrowed one. Counts tries in the map's landmarks.
  std::vector<Match> find(LandmarkMap& map, const std::vector<int>& keyframes, const Pyramid& picture,
                          const View& guess, const Motion& motion, const TrackingOptions& options);

 private:
  std::vector<int> looked_at_;  // the last look at each landmark
  int look_ = 0;
};

}  // namespace mapweave::visual
