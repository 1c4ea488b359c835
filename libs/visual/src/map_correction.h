#pragma once
// A session's map is straightened after a loop, aside from tracking: on a copy, to be applied to a map that went on meanwhile. First the
// essential graph (ORB-SLAM, section VII-C; CORB-SLAM 2.1), then bundle adjustment of all that is kept.

#include "bundle.h"
#include "loop_closer.h"

namespace mapweave::visual {

class MapCorrection {
 public:
  MapCorrection(const LandmarkMap& map, FoundLoop loop, double sigma_px);
  void run();  // pure; on any thread, once
  // After run(). What was added since moves along with the keyframe before it. The newest keyframe sees the earlier landmarks from now on.
  void apply(LandmarkMap& map) const;
  const FoundLoop& loop() const { return loop_; }

 private:
  struct Name {
    int slot;
    std::uint32_t serial;
  };
  PinholeCamera camera_;
  FoundLoop loop_;
  std::vector<Name> keyframes_, landmarks_;  // of the bundle's views and points
  std::vector<int> anchors_;                 // of the points: views
  std::vector<Tie> ties_;                    // of views
  std::size_t newest_ = 0, earlier_ = 0;     // views
  Bundle bundle_;
};

// Newer keyframes of another session become part of the older one.
void join_sessions(LandmarkMap& map, const FoundLoop& loop);
// The newest keyframe sees what the loop found.
void see_matches(LandmarkMap& map, const FoundLoop& loop, double sigma_px);

}  // namespace mapweave::visual
