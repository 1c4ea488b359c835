#include "map_report.h"

#include <algorithm>

namespace mapweave::visual {
namespace {

std::vector<PlacedFrame> by_stamp(std::vector<PlacedFrame> frames) {
  std::sort(frames.begin(), frames.end(), [](const PlacedFrame& a, const PlacedFrame& b) { return a.stamp < b.stamp; });
  return frames;
}

}  // namespace

std::vector<PlacedFrame> frames_of(const LandmarkMap& map) {
  std::vector<PlacedFrame> result;
  for (const Keyframe& keyframe : map.keyframes)
    for (const AnchoredFrame& frame : keyframe.frames)
      result.push_back({frame.stamp, pose_of(frame_from_keyframe(frame) * keyframe.view), keyframe.session});
  return by_stamp(std::move(result));
}

std::vector<PlacedFrame> keyframes_of(const LandmarkMap& map) {
  std::vector<PlacedFrame> result;
  for (const Keyframe& keyframe : map.keyframes)
    if (!keyframe.gone) result.push_back({keyframe.stamp, pose_of(keyframe.view), keyframe.session});
  return by_stamp(std::move(result));
}

std::vector<MappedLandmark> landmarks_of(const LandmarkMap& map) {
  std::vector<MappedLandmark> result;
  for (const ClientLandmark& landmark : map.landmarks)
    if (!landmark.gone && !landmark.borrowed)
      result.push_back({landmark.point, static_cast<int>(landmark.seen.size()),
                        map.keyframe(landmark.seen.front().keyframe).session});
  return result;
}

std::size_t borrowed_of(const LandmarkMap& map) {
  const auto is_borrowed = [](const ClientLandmark& landmark) { return !landmark.gone && landmark.borrowed; };
  return static_cast<std::size_t>(std::count_if(map.landmarks.begin(), map.landmarks.end(), is_borrowed));
}

std::vector<int> sessions_of(const LandmarkMap& map) {
  std::vector<int> result;
  for (const Keyframe& keyframe : map.keyframes)
    if (!keyframe.gone) result.push_back(keyframe.session);
  std::sort(result.begin(), result.end());
  result.erase(std::unique(result.begin(), result.end()), result.end());
  return result;
}

}  // namespace mapweave::visual
