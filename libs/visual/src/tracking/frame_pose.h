#pragma once
// Where a frame was taken, by the landmarks found in it.

#include "geometry/motion.h"
#include "mapping/landmark_map.h"

namespace mapweave::visual {

inline constexpr std::size_t kEnough = 20;  // landmarks, to say alone where the camera is

struct Attempt {
  std::vector<Match> found;
  PoseFromPoints pose;
  Motion motion;
  int session = 0;
};

// First (where depth is measured; alone, a camera needs all) by landmarks that several keyframes saw, since who walks
// by brings new ones that agree among themselves; then by all that do not speak against it. What others say counts
// where it agrees with the client's own; but a camera alone that received its scale has it from them.
PoseFromPoints pose_by(const LandmarkMap& map, int session, const std::vector<Match>& found, const View& start,
                       const TrackingOptions& options);

// Where the camera was followed, fewer landmarks are enough than where it may be anywhere.
bool is_good(const LandmarkMap& map, const Attempt& attempt, bool followed, const TrackingOptions& options);

// Where depth is measured: what fits lies close together, and those that do not fit agree on another place and lie far
// apart. What moves is small, and the world around it large: the camera follows a thing that fills its picture.
bool is_led_by_a_thing(const LandmarkMap& map, const Attempt& attempt, const TrackingOptions& options);

// The keyframe that shows most of what is seen now.
int most_seen(const LandmarkMap& map, const std::vector<Match>& matches);

}  // namespace mapweave::visual
