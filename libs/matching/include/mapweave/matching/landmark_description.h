#pragma once
// How landmarks of a map are known again: cameras follow corners by what surrounds them, maps keep features with descriptors. A landmark
// takes the descriptor of a feature beside it.

#include <mapweave/maps/map.h>
#include <mapweave/matching/landmark_index.h>

namespace mapweave::matching {

struct DescriptionOptions {
  double reach_px = 3.0;
  double sigma_px = 0.7;
  double sigma_m = 0.01;
  int most_views = 8;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("reach_px", reach_px, "from a landmark to the feature that stands for it, on the feature's pyramid level");
    v.positive("sigma_px", sigma_px, "error of a landmark in one picture; together with its distance its deviation");
    v.positive("sigma_m", sigma_m, "a landmark's deviation is at least this");
    v.integer("most_views", most_views, 1, 1000, "keyframes that are asked, the latest");
  }
};

// In the map's frame; of the features beside it in the keyframes that see it, the one that the others resemble most (CVS III-B: location,
// observations and descriptor). updated_by: the client of the latest keyframe that sees it. nullopt where no keyframe has a feature there,
// or its anchor or point is none.
std::optional<DescribedLandmark> described(const Map& map, const Landmark& landmark, const DescriptionOptions& options = {});

}  // namespace mapweave::matching
