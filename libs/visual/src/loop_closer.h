#pragma once
// The camera is back where it was long ago: keyframes that look alike are compared feature by feature, then landmark by landmark; what
// agrees straightens the way between (CORB-SLAM 2.1: loop closing; the essential graph of ORB-SLAM, IEEE T-RO 31(5), 2015).

#include "landmark_finder.h"
#include "place_finder.h"

#include <mapweave/matching/place_index.h>

namespace mapweave::visual {

struct FoundLoop {
  int earlier = 0;             // keyframe
  View view;                   // of the newest keyframe, as the earlier ones say
  std::vector<Match> matches;  // landmarks of the earlier ones that the newest keyframe's picture shows
};

// What keyframe is shown by the newest one's picture besides those that it shares landmarks with. nullopt where none is found beyond doubt.
std::optional<FoundLoop> find_loop(LandmarkMap& map, LandmarkFinder& finder, const std::vector<matching::SimilarPlace>& alike,
                                   const Pyramid& picture, const ClientOptions& options);

// Moves keyframes and landmarks so that the newest keyframe stands where the loop says; what lies between gives way evenly.
void close_loop(LandmarkMap& map, const FoundLoop& loop);

}  // namespace mapweave::visual
