#include "sheet_collector.h"

#include <algorithm>
#include <cstdio>
#include <map>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kMostFrames = 24;  // then every other one is dropped, and half as many are taken from there on
constexpr std::size_t kTrackFrames = 8;

}  // namespace

void SheetCollector::add(const visual::Frame& frame, const std::vector<visual::SeenLandmark>& seen,
                         double since_start_s) {
  before_.push_back(seen);
  if (before_.size() > kTrackFrames) before_.pop_front();
  if (count_++ % stride_ != 0) return;
  if (frames_.size() == kMostFrames) {
    for (std::size_t i = 0; 2 * i < frames_.size(); ++i) std::swap(frames_[i], frames_[2 * i]);
    frames_.resize(kMostFrames / 2);
    stride_ *= 2;
    if ((count_ - 1) % stride_ != 0) return;
  }
  exporters::SheetFrame picked{frame.grey.width, frame.grey.height, frame.grey.pixels, {}, {}};
  char caption[80];
  std::snprintf(caption, sizeof caption, "%.1f s, %zu landmarks%s", since_start_s, seen.size(),
                seen.empty() ? ": not tracked" : "");
  picked.caption = caption;
  std::map<int, std::size_t> track_of;
  for (const visual::SeenLandmark& landmark : seen) {
    track_of[landmark.landmark] = picked.tracks.size();
    picked.tracks.push_back({{}, static_cast<float>(landmark.depth_m)});
  }
  for (const auto& earlier : before_)
    for (const visual::SeenLandmark& landmark : earlier)
      if (const auto found = track_of.find(landmark.landmark); found != track_of.end())
        picked.tracks[found->second].pixels.emplace_back(static_cast<float>(landmark.pixel.x()),
                                                         static_cast<float>(landmark.pixel.y()));
  frames_.push_back(exporters::shrunk(std::move(picked)));
}

}  // namespace mapweave::runtime
