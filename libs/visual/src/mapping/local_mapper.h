#pragma once
// The map around the camera: how it begins, what keyframes add to it, what is refined around them, and what is not
// worth keeping.

#include "mono/mono_start.h"

#include <vector>

namespace mapweave::visual {

// A session's first keyframes.
struct MapBeginning {
  std::vector<int> keyframes;
  std::vector<Match> matches;  // of the last one
};

class LocalMapper {
 public:
  explicit LocalMapper(const ClientOptions& options) : options_(options) {}

  // Begins the frame's session with it, whatever its view; nullopt where it would have nothing to hold on to. A camera
  // without depth takes several frames.
  std::optional<MapBeginning> begin(LandmarkMap& map, const PosedFrame& frame);
  // Of a frame that was tracked in a map without depth: landmarks whose depth is known now.
  std::vector<Match> learn_depths(LandmarkMap& map, const PosedFrame& frame, const std::vector<Match>& matches);
  void forget_beginning() { mono_start_.clear(); }

  // Around the newest keyframe, which shows `matches`: local bundle adjustment, landmarks that exist twice or are not
  // found again.
  void refine(LandmarkMap& map, int newest, const std::vector<Match>& matches, const Pyramid& picture) const;
  // Keyframes that are not worth keeping are gone, and answered.
  std::vector<int> cull_keyframes(LandmarkMap& map, int newest);
  std::size_t forgotten() const { return forgotten_; }  // of those, because the map was full
  // A frame of the trajectory.
  void keep_frame(LandmarkMap& map, Stamp stamp, const View& view, int reference);

 private:
  ClientOptions options_;
  MonoStart mono_start_;
  std::size_t frames_ = 0;  // of the trajectory, at most
  std::size_t forgotten_ = 0;
};

}  // namespace mapweave::visual
