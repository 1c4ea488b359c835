#pragma once
// What keyframes say of landmarks that were lent to them (FusionInput::borrowed). Nobody vouches for it: it tells where to look first, and
// counts where features bear it out.

#include "visual_pair.h"

#include <deque>
#include <functional>
#include <map>

namespace mapweave::fusion {

struct ToldSighting {
  std::size_t map, keyframe;              // who says so: numbers of the map, and in it
  std::size_t map_of_landmark, landmark;  // of another map
  LandmarkSighting seen;
};

class Hearsay {
 public:
  Hearsay(const std::vector<LandmarkChange>& borrowed, const std::deque<VisualMap>& maps);

  // Keyframes of the two maps that would see the same, those that share most first; a few.
  std::vector<VisualQuestion> pairs(std::size_t a, std::size_t b) const;
  // Of the maps that `counts` names: map and keyframe that see most of what this keyframe was lent, where that is enough to tell.
  std::optional<std::pair<std::size_t, std::size_t>> most_told(std::size_t map, std::size_t keyframe,
                                                               const std::function<bool(std::size_t)>& counts) const;
  const std::vector<ToldSighting>& sightings() const { return sightings_; }  // by map, keyframe, map of the landmark, landmark

 private:
  std::vector<std::size_t> keyframes_of(const ToldSighting&) const;  // of the owner's, those that see the landmark
  const std::deque<VisualMap>& maps_;
  std::vector<ToldSighting> sightings_;
  std::map<std::pair<std::size_t, std::size_t>, std::vector<const ToldSighting*>> of_pair_;  // the lower map first
};

}  // namespace mapweave::fusion
