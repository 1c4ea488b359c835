#pragma once
// Was a camera led astray? Who walks close by takes it along: fewer and fewer landmarks are where they should be, then
// many of another world are, and odometry says otherwise. Wheels alone may slip.

#include "frame_pose.h"
#include "geometry/driven_motion.h"

#include <deque>
#include <functional>

namespace mapweave::visual {

// Of the landmarks found, how many are where they should be.
double share_of(const Attempt& attempt);

// Those of the last second.
class RecentFrames {
 public:
  void add(const Station& station, double share);
  void clear() { frames_.clear(); }
  bool is_empty() const { return frames_.empty(); }
  const Station& oldest() const { return frames_.front().station; }
  // Never without odometry, and where all of them knew where they were.
  bool contradict(const Attempt& attempt, const Station& now, const SessionOptions& options) const;

 private:
  struct Recent {
    Station station;
    double share;
  };
  std::deque<Recent> frames_;
};

// A session's keyframes after `stamp`, and what is known of frames there; `removing` is called with each keyframe
// before.
void remove_since(LandmarkMap& map, int session, Stamp stamp, const std::function<void(int)>& removing);

}  // namespace mapweave::visual
