#pragma once
// A session's map is corrected after a loop, aside from tracking: on a copy, to be applied to a map that went on
// meanwhile. First the essential graph (ORB-SLAM, section VII-C; CORB-SLAM 2.1), then bundle adjustment of all that is
// kept. Where the loop was found on a keyframe that another client made, that one and its landmarks stay where they
// are.

#include "loop_detector.h"

#include <mapweave/graph/bundle_adjustment.h>
#include <mapweave/maps/map_update.h>

namespace mapweave::visual {

class MapCorrection {
 public:
  MapCorrection(const LandmarkMap& map, FoundLoop loop, double sigma_px);
  void run();  // pure; on any thread, once
  // After run(). What was added since moves along with the keyframe before it. Answers by how much the scale of each
  // keyframe has grown.
  std::vector<double> apply(LandmarkMap& map) const;
  const FoundLoop& loop() const { return loop_; }

 private:
  struct Name {
    int slot;
    std::uint32_t serial;
  };
  std::vector<double> stretches_of(const LandmarkMap& map) const;
  void add_fixed(const std::vector<Sighting>& sightings);
  FoundLoop loop_;
  std::vector<Name> keyframes_, landmarks_;           // of the bundle's views and points
  std::vector<int> anchors_;                          // of the points: views
  std::vector<CovisibilityEdge> covisibility_edges_;  // of views
  std::size_t newest_ = 0, earlier_ = 0;              // views; a fixed place is one more, after all
  graph::Bundle bundle_;
  bool monocular_ = false;
  std::vector<double> stretches_, scales_;  // of the views: as wheels have it, as it came out
};

// Where a keyframe is to be, and how its scale grows.
struct KeyframeMotion {
  int keyframe = 0;
  View view;
  double scale = 1.0;
};
// Of a session's keyframes to where others say that the robot was (Share::corrected, in the frame of the map that is
// published); nothing where that is not sound, or not about keyframes of `own`.
std::vector<KeyframeMotion> motions_to(const LandmarkMap& map, int session, const SessionId& own,
                                       const std::vector<MovedNode>& corrected, const Pose3& robot_from_camera,
                                       double scale);
// The other keyframes of the session move along with the one before them (those before the first stay), landmarks with
// the keyframe that saw them first, and what is measured in the map's unit grows with them. Answers the scales, by
// slot.
std::vector<double> move_keyframes(LandmarkMap& map, int session, const std::vector<KeyframeMotion>& motions);

// What keyframes measured themselves grows with them: depths, frames anchored to them. By slot.
void stretch(LandmarkMap& map, const std::vector<double>& scale_of_keyframe);
// Newer keyframes of another session become part of the older one; the loop speaks of that one then.
void join_sessions(LandmarkMap& map, FoundLoop& loop);
// The newest keyframe sees what the loop found.
void see_matches(LandmarkMap& map, const FoundLoop& loop, double sigma_px);

}  // namespace mapweave::visual
