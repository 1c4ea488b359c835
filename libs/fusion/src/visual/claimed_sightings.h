#pragma once
// Unverified sightings: what keyframes say of landmarks that were shared with them (FusionInput::borrowed). They say
// where to look first, and count where features bear them out.

#include "visual_pair.h"

#include <deque>
#include <functional>
#include <map>

namespace mapweave::fusion {

struct ClaimedSighting {
  std::size_t map, keyframe;              // who says so: numbers of the map, and in it
  std::size_t map_of_landmark, landmark;  // of another map
  LandmarkSighting seen;
};

class ClaimedSightings {
 public:
  ClaimedSightings(const std::vector<LandmarkChange>& borrowed, const std::deque<VisualMap>& maps);

  // Keyframes of the two maps that would see the same, those that share most first; a few.
  std::vector<VisualQuestion> pairs(std::size_t a, std::size_t b) const;
  // Of the maps that `counts` names: map and keyframe that see most of the landmarks shared with this keyframe, where
  // that is enough.
  std::optional<std::pair<std::size_t, std::size_t>> most_claimed(std::size_t map, std::size_t keyframe,
                                                                  const std::function<bool(std::size_t)>& counts) const;
  const std::vector<ClaimedSighting>& sightings() const {
    return sightings_;
  }  // by map, keyframe, map of the landmark, landmark

 private:
  std::vector<std::size_t> keyframes_of(const ClaimedSighting&) const;  // of the owner's, those that see the landmark
  const std::deque<VisualMap>& maps_;
  std::vector<ClaimedSighting> sightings_;
  std::map<std::pair<std::size_t, std::size_t>, std::vector<const ClaimedSighting*>> of_pair_;  // the lower map first
};

}  // namespace mapweave::fusion
