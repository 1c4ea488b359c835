#pragma once
// Frames whose place is not known, and the server's answers about them (CVS III-B: monocular clients start so).

#include "borrowed_landmarks.h"
#include "map_publisher.h"

#include <deque>

namespace mapweave::visual {

struct UnplacedFrame {
  Frame frame;
  Pyramid picture;
  matching::OrbFeatures features;  // that were asked with
};

// What landmarks that were found by their descriptors say of the view: those that agree with each other near `view`, or
// where they are too few for that, with `view` itself.
PoseFromPoints agreement(const LandmarkMap& map, const std::vector<Match>& found, const View& view,
                         const TrackingOptions& options);

// Those that `own` did not make, in the frame of the map in memory: that of the first camera, not of the robot.
std::vector<DescribedLandmark> of_others(const std::vector<DescribedLandmark>& landmarks, const SessionId& own,
                                         const Pose3& robot_from_camera);

class PlaceExchange {
 public:
  // Of each frame that was not placed; the last one counts.
  void miss(const Frame& frame, const Pyramid& picture) { missed_ = UnplacedFrame{frame, picture, {}}; }
  void clear() { missed_.reset(), asked_.clear(); }  // the place is known

  std::optional<PlaceRequest> request(const LandmarkMap& map, const ClientPlace& place, const ClientOptions& options);
  std::optional<UnplacedFrame> take(Stamp stamp);  // that was asked for

 private:
  std::optional<UnplacedFrame> missed_;
  std::deque<UnplacedFrame> asked_;
};

// Landmarks of the session that the frame shows around `view`, as matches, and the view that they imply: nullopt where
// they do not agree. Those that it does not show are no landmarks of the map afterwards.
struct CheckedPlace {
  View view;
  std::vector<Match> matches;
};
std::optional<CheckedPlace> check_place(LandmarkMap& map, BorrowedLandmarks& borrowed, int session,
                                        const UnplacedFrame& asked, const View& view, const TrackingOptions& options);

// Features of a picture, as what a landmark's descriptor is looked for in.
FrameFeatureGrid grid_of(const matching::OrbFeatures& features, const Pinhole& camera);

}  // namespace mapweave::visual
