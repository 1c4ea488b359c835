#pragma once
// A frame becomes a keyframe: its landmarks are seen once more, and corners where there were none become new ones.

#include "depth.h"

namespace mapweave::visual {

// A frame whose place is known. It refers to the frame and its picture.
struct PosedFrame {
  const Frame& frame;
  const Pyramid& picture;
  int session = 0;
  View view;
  Motion motion;  // while its picture was read
  DrivenMotion driven;
};

// Adds the frame to the map as a keyframe, and new landmarks to `matches`. Its number is answered. Where several
// `dynamic_outliers` are near (pixels where landmarks were found that cannot be there), something moves: it brings no
// new landmarks.
int add_keyframe(LandmarkMap& map, const PosedFrame& posed, const std::vector<Eigen::Vector2d>& dynamic_outliers,
                 std::vector<Match>& matches, const ClientOptions& options);

// The keyframe, taken at its view of `picture`, sees a borrowed landmark.
void see_borrowed(LandmarkMap& map, int keyframe, const Pyramid& picture, const Match& match, double sigma_px);

}  // namespace mapweave::visual
