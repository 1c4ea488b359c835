#pragma once
// A frame becomes a keyframe: its landmarks are seen once more, and corners where there were none become new ones.

#include "depth.h"

namespace mapweave::visual {

// Adds a keyframe at `view` to the map, and new landmarks to `matches`. Its number is answered. Where several
// `dynamic_outliers` are near (pixels where landmarks were found that cannot be there), something moves: it brings no
// new landmarks.
int add_keyframe(LandmarkMap& map, int session, const Frame& frame, const Pyramid& picture, const View& view,
                 const Motion& motion, const std::vector<Eigen::Vector2d>& dynamic_outliers,
                 std::vector<Match>& matches, const ClientOptions& options);

// The keyframe, taken at its view of `picture`, sees a borrowed landmark.
void see_borrowed(LandmarkMap& map, int keyframe, const Pyramid& picture, const Match& match, double sigma_px);

// As add_keyframe, of a frame that has features: those with a depth become landmarks.
int add_feature_keyframe(LandmarkMap& map, int session, Stamp stamp, const FrameFeatureGrid& features, const View& view,
                         std::vector<Match>& matches, const ClientOptions& options);

}  // namespace mapweave::visual
