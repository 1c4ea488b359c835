#include "recent_frames.h"

#include "mapping/culling.h"

namespace mapweave::visual {
namespace {

constexpr double kRecent_s = 1.0;  // of frames that odometry is compared with
constexpr double kTorn =
    0.75;  // with a smaller share of landmarks where they should be, a frame does not know where it is

}  // namespace

double share_of(const Attempt& attempt) {
  return static_cast<double>(attempt.pose.count) / static_cast<double>(std::max<std::size_t>(1, attempt.found.size()));
}

void RecentFrames::add(const Station& station, double share) {
  frames_.push_back({station, share});
  while (seconds_between(frames_.front().station.stamp, station.stamp) > kRecent_s) frames_.pop_front();
}

bool RecentFrames::contradict(const Attempt& attempt, const Station& now, const SessionOptions& options) const {
  if (frames_.empty() || !now.driven.odometry_from_camera || !oldest().driven.odometry_from_camera) return false;
  const bool torn = share_of(attempt) < kTorn ||
                    std::any_of(frames_.begin(), frames_.end(), [](const Recent& one) { return one.share < kTorn; });
  const Departure off = departure(oldest(), now, options);
  return torn && off.error_m > off.reach_m;
}

void remove_since(LandmarkMap& map, int session, Stamp stamp, const std::function<void(int)>& removing) {
  const auto is_since = [&](const AnchoredFrame& frame) { return stamp < frame.stamp; };
  for (Keyframe& keyframe : map.keyframes)
    if (!keyframe.gone && keyframe.session == session)
      keyframe.frames.erase(std::remove_if(keyframe.frames.begin(), keyframe.frames.end(), is_since),
                            keyframe.frames.end());
  for (int newest = newest_of(map, session); stamp < map.keyframe(newest).stamp; newest = newest_of(map, session)) {
    const int new_parent = new_parent_of(map, newest);
    if (new_parent < 0) break;
    removing(newest);
    map.remove_keyframe(newest, new_parent);
  }
}

}  // namespace mapweave::visual
