#pragma once
// Landmarks that others made and a server shares (CVS III-C, local map augmentation): until a keyframe shows them, and
// whether they are where they are said to be.

#include "geometry/motion.h"
#include "mapping/keyframe_maker.h"
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

// What landmarks that were found by their descriptors say of the view: those that agree with each other near `view`, or
// where they are too few for that, with `view` itself.
PoseFromPoints agreement(const LandmarkMap& map, const std::vector<Match>& found, const View& view,
                         const TrackingOptions& options);

// Those that the map does not have, in the frame of the map in memory: that of the first camera, not of the robot. What
// `own` made is among them once the map has forgotten it.
std::vector<DescribedLandmark> without_own(const std::vector<DescribedLandmark>& landmarks, const LandmarkMap& map,
                                           const SessionId& own, const Pose3& robot_from_camera);

// Whether a camera there should see it.
bool is_expected(const matching::DescribedLandmark& known, const Pinhole& camera, const View& view);

class BorrowedLandmarks {
 public:
  // In the frame of the session's map in memory (its first camera's). Known ones take their new place, in the map too.
  // What is not sound is left out; how many were not is answered.
  int receive(LandmarkMap& map, int session, const std::vector<matching::DescribedLandmark>& landmarks);

  // Those that the features show within `radius_px` of where they should be, as landmarks of the map; without those in
  // `matches`.
  std::vector<Match> look(LandmarkMap& map, const PosedFeatures& seen, const std::vector<Match>& matches,
                          double radius_px);

  // Those that a new keyframe shows are seen by it, and added to `matches`: frames follow them by how it does.
  void look_in_keyframe(LandmarkMap& map, int keyframe, const PosedFrame& frame, std::vector<Match>& matches,
                        const TrackingOptions& options);

  // Of matches just found, those that fit stay; landmarks of the others that no keyframe sees are none again.
  void keep(LandmarkMap& map, std::vector<Match>& matches, const std::vector<char>& fits);

  // For each keyframe, once: those that are not found where they should be are dropped, those out of the way forgotten.
  void tidy(LandmarkMap& map, int session, const View& view);
  void drop(LandmarkMap& map, int session);    // all of them
  void forget(LandmarkMap& map, int session);  // the same, because the session's map changes; counted
  std::uint32_t times_forgotten() const { return times_forgotten_; }
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
  std::uint32_t keyframes_ = 0, times_forgotten_ = 0;
};

}  // namespace mapweave::visual
