#pragma once
// The first two keyframes of a camera that measures no depth: corners of a first picture are followed until the camera
// has moved far enough to measure their distance.

#include "mapping/keyframe_maker.h"

#include <utility>

namespace mapweave::visual {

class MonoStart {
 public:
  // The session's first two keyframes once there are any: of an earlier frame and of this one (whatever
  // its view), whose landmarks are in `matches`. The first camera's frame is the session's. Scale by odometry where
  // both frames have it; otherwise the landmarks' middle depth is 1 m.
  std::optional<std::pair<int, int>> add(LandmarkMap& map, const PosedFrame& frame, std::vector<Match>& matches,
                                         const ClientOptions& options);

  void clear() {
    tracks_.clear();
    first_ = last_ = Pyramid();
    first_frame_ = Frame();
  }

 private:
  struct Track {
    Eigen::Vector2d first, now;
    Patch patch;  // of the first picture
  };
  void begin(const Frame& frame, const Pyramid& picture, const ClientOptions& options);
  void follow(const Pyramid& picture, const Pinhole& camera, const ClientOptions& options);

  std::vector<Track> tracks_;
  std::size_t began_with_ = 0;
  Frame first_frame_;
  Pyramid first_, last_;
  View motion_;  // of the last two pictures, as if all were 1 m away
};

}  // namespace mapweave::visual
