#pragma once
// Keyframes as the judge of places looks at them (matching/visual_judge.h).

#include "mapping/landmark_map.h"

#include <mapweave/matching/visual_judge.h>

#include <vector>

namespace mapweave::visual {

// Refers to the features of its keyframes.
struct JudgedPlace {
  std::vector<std::vector<std::int32_t>> landmark_of_feature;
  matching::PlaceView view;

  // The one that is asked about first. depths: along the optical axis, in units of the side; 0 unknown; empty: none is
  // known.
  void add(const NodeId& id, const Pinhole& camera, const View& side_from_camera, const matching::OrbFeatures& features,
           const std::vector<float>& depths);
};

// A keyframe, and at most so many of those that share most landmarks with it.
std::vector<int> with_covisible(const LandmarkMap& map, int number, std::size_t most);
// The frame is the first keyframe's camera.
JudgedPlace place_of(const LandmarkMap& map, const std::vector<int>& keyframes);

// Where the second lies in the first's frame, as their judgement says; nullopt where it is in doubt or less probable.
std::optional<Sim3> first_from_second(const matching::PlaceView& first, const matching::PlaceView& second,
                                      double least_probability, std::uint64_t seed);

}  // namespace mapweave::visual
