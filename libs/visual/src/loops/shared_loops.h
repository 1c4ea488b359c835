#pragma once
// The camera is where another client was, as a keyframe says that a server shared: the own map has drifted since the
// place beside which that keyframe was put. Believed is what several keyframes say alike, and what the path since then
// could have led to. Needs no server.

#include "loop_detector.h"

#include "sharing/shared_keyframes.h"

namespace mapweave::visual {

class SharedLoopDetector {
 public:
  explicit SharedLoopDetector(const ClientOptions& options) : options_(options) {}
  // For each new keyframe, once. repeats_m: as VisualLoopDetector has it. Nothing where the map lies as it should.
  std::optional<FoundLoop> look(const LandmarkMap& map, const SharedKeyframes& shared, int newest,
                                const Pyramid& picture, double repeats_m);

 private:
  struct Claim {
    std::uint32_t serial;  // of the keyframe that makes it
    int session;
    View correction;
    Eigen::Vector3d centre;
    double scale;
  };
  std::optional<FoundLoop> compare(const LandmarkMap& map, const SharedKeyframes& shared, const SharedPlace& place,
                                   int newest, const Pyramid& picture) const;
  bool could_lead(const LandmarkMap& map, const FoundLoop& loop, std::uint32_t anchor, double repeats_m) const;
  int agreeing_with(const Claim& claim) const;

  ClientOptions options_;
  std::deque<Claim> claims_;
};

}  // namespace mapweave::visual
