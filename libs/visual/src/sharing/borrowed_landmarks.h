#pragma once
// Landmarks that others made and a server shares (CVS III-C, local map augmentation): until a keyframe shows them, and
// whether they are where they are said to be.

#include "geometry/motion.h"
#include "mapping/landmark_map.h"
#include "pictures/feature_grid.h"

#include <mapweave/matching/landmark_index.h>

#include <map>

namespace mapweave::visual {

inline constexpr double kFeature_px = 1.0;  // error of a picture's feature on its pyramid's first level

// Features of a picture, and where it was taken.
struct PosedFeatures {
  const FrameFeatureGrid& features;
  double sigma_px = 0.0;  // of a feature on its pyramid's first level
  int session = 0;
  View view;
  Motion motion;
};

class BorrowedLandmarks {
 public:
  // In the frame of the session's map in memory (its first camera's). Known ones take their new place, in the map too.
  // What is not sound is left out; how many were not is answered.
  int receive(LandmarkMap& map, int session, const std::vector<matching::DescribedLandmark>& landmarks);

  // Those that the features show within `radius_px` of where they should be, as landmarks of the map; without those in
  // `matches`.
  std::vector<Match> look(LandmarkMap& map, const PosedFeatures& seen, const std::vector<Match>& matches,
                          double radius_px);

  // Of matches just found, those that fit stay; landmarks of the others that no keyframe sees are none again.
  void keep(LandmarkMap& map, std::vector<Match>& matches, const std::vector<char>& fits);

  // For each keyframe, once: those that are not found where they should be are dropped, those out of the way forgotten.
  void tidy(LandmarkMap& map, int session, const View& view);
  void forget(LandmarkMap& map, int session);  // all of them
  std::size_t size() const { return entries_.size(); }

 private:
  struct Entry {
    matching::DescribedLandmark known;
    int session = 0;
    int slot = -1;  // in the map; -1: not seen yet
    std::uint32_t serial = 0;
    int failures = 0;
    std::uint32_t in_view = 0;  // the last keyframe, counted, that it was in the view of
  };
  void limit(LandmarkMap& map);
  bool is_held(const LandmarkMap& map, Entry& entry) const;
  void take_out(LandmarkMap& map, Entry& entry) const;

  std::map<LandmarkId, Entry> entries_;
  std::uint32_t keyframes_ = 0;
};

}  // namespace mapweave::visual
