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

class PlaceExchange {
 public:
  // Of each frame that was not placed; the last one counts.
  void miss(const Frame& frame, const Pyramid& picture) { missed_ = UnplacedFrame{frame, picture, {}}; }
  void clear() {
    missed_.reset();
    asked_.clear();
  }  // the place is known

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

}  // namespace mapweave::visual
