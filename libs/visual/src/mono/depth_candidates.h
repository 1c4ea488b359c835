#pragma once
// Corners of keyframes whose depth nothing measures: it is learnt from where later pictures show them along their
// epipolar lines (depth filters: Forster et al., SVO, ICRA 2014, section V; here without fusing, as neighbouring frames
// err alike: the best view of all counts).

#include "geometry/motion.h"
#include "mapping/landmark_map.h"

namespace mapweave::visual {

// Looks for the map's candidates in a picture taken at `view`, which shows so many `landmarks`. Those whose depth is
// known well enough become landmarks, and are answered; those that are never found, or have waited too long, go.
std::vector<Match> look_for_candidates(LandmarkMap& map, const Pyramid& picture, const View& view, const Motion& motion,
                                       std::size_t landmarks, const TrackingOptions& options);

}  // namespace mapweave::visual
