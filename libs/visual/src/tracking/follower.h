#pragma once
// Where a camera is in its map, frame by frame: followed from the frame before, or found again. It reads the map and
// changes nothing of it.

#include "frame_pose.h"
#include "landmark_finder.h"
#include "loops/loop_closer.h"
#include "pictures/feature_grid.h"

#include <mapweave/visual/visual_client.h>

#include <optional>

namespace mapweave::visual {

constexpr double kCarried_s = 0.5;  // in so long a camera may have come anywhere

struct Follower {
  ClientOptions options;
  std::optional<VisualLoopCloser> closer;
  LandmarkMap map;
  LandmarkFinder finder;

  // Of the last frame that was tracked.
  Pyramid last;
  Stamp last_stamp;
  DrivenMotion last_driven;
  View view, motion;  // camera_from_map; view from the view before
  std::vector<Match> matches;
  int session = 0;
  int reference = -1;   // the newest keyframe, or the one where the camera found itself again
  DrivenMotion driven;  // to the frame that is looked at
  double lost_s = 0.0;  // of seeing something since

  // From the frame before: pictures are laid on each other.
  Attempt follow(const Frame& frame, const Pyramid& picture, double interval_s);
  // By features: first around where it was, then wherever it looks alike. Places that look alike but are not the same
  // are no answer, nor are those to which the way did not lead. best: what following came to.
  Attempt find_again(const Pyramid& picture, Stamp now, Attempt best);
  bool is_good(const Attempt& attempt, bool followed = false) const;

 private:
  Attempt locate(const Pyramid& picture, int among, const View& start, const Motion& speed, double wider = 1.0);
  // Without pictures to lay on each other, motion is expected to go on, and landmarks are looked for far and then near.
  Attempt follow_features(const Pyramid& picture, double interval_s);
  // By wheels or gyroscopes where they are, else as before.
  View expected_motion(const Frame& frame) const;
  Departure departure_to(const View& found, int among, Stamp now) const;
};

}  // namespace mapweave::visual
