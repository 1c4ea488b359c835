#include "local_mapper.h"

#include "culling.h"
#include "local_window.h"
#include "mono/depth_candidates.h"

namespace mapweave::visual {
namespace {

constexpr int kCulledAtOnce = 3;  // keyframes, of those that go because others show the same

}  // namespace

std::optional<MapBeginning> LocalMapper::begin(LandmarkMap& map, const PosedFrame& frame) {
  MapBeginning result;
  if (!frame.frame.shows_depth() && !frame.picture.features) {
    if (options_.session.await_place) return std::nullopt;
    const auto made = mono_start_.add(map, frame, result.matches, options_);
    if (!made) return std::nullopt;
    result.keyframes = {made->first, made->second};
    return result;
  }
  const PosedFrame first{frame.frame, frame.picture, frame.session, View(), Motion(), frame.driven};
  const int made = add_keyframe(map, first, {}, result.matches, options_);
  if (static_cast<int>(result.matches.size()) < options_.tracking.least_landmarks) {
    map.discard(made);
    return std::nullopt;
  }
  result.keyframes = {made};
  return result;
}

std::vector<Match> LocalMapper::learn_depths(LandmarkMap& map, const PosedFrame& frame,
                                             const std::vector<Match>& matches) {
  if (!map.monocular) return {};
  mono_start_.clear();
  return look_for_candidates(map, frame.picture, frame.view, frame.motion, matches.size(), options_.tracking);
}

void LocalMapper::refine(LandmarkMap& map, int newest, const std::vector<Match>& matches,
                         const Pyramid& picture) const {
  adjust_window(map, newest, options_.window);
  const Keyframe& keyframe = map.keyframe(newest);
  const auto near = near_keyframes(map, keyframe.session, matches, keyframe.view, options_.tracking.near_keyframes);
  fuse_duplicates(map, near, matches, picture, keyframe.view);
  cull_landmarks(map, newest, options_.memory);
}

std::vector<int> LocalMapper::cull_keyframes(LandmarkMap& map, int newest) {
  std::vector<int> gone;
  for (int count = 0; count < kCulledAtOnce || map.keyframe_count() > options_.memory.keyframes; ++count) {
    const int redundant = keyframe_to_cull(map, newest, options_.memory);
    const int number = redundant >= 0 ? redundant : keyframe_to_forget(map, newest, options_.memory);
    const int new_parent = number < 0 ? -1 : new_parent_of(map, number);
    if (new_parent < 0) break;
    if (redundant < 0) {
      map.forget_keyframe(number, new_parent);
      ++forgotten_;
    } else {
      map.remove_keyframe(number, new_parent);
    }
    gone.push_back(number);
  }
  return gone;
}

void LocalMapper::keep_frame(LandmarkMap& map, Stamp stamp, const View& view, int reference) {
  Keyframe& keyframe = map.keyframe(reference);
  keyframe.frames.push_back(anchored(stamp, view * keyframe.view.inverse()));
  if (const auto most = static_cast<std::size_t>(options_.memory.frames); ++frames_ > most)
    frames_ = thin_frames(map, most);
}

}  // namespace mapweave::visual
