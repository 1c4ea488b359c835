#include "landmark_map.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <functional>

namespace mapweave::visual {
namespace {

template <class Thing>
int put(std::vector<Thing>& things, std::vector<int>& free, Thing thing) {
  if (free.empty()) {
    things.push_back(std::move(thing));
    return static_cast<int>(things.size()) - 1;
  }
  const int slot = free.back();
  free.pop_back();
  things[static_cast<std::size_t>(slot)] = std::move(thing);
  return slot;
}

void strike(std::vector<int>& list, int id) { list.erase(std::remove(list.begin(), list.end(), id), list.end()); }

// A landmark lives for hours, and would keep room for the most keyframes that ever saw it at once.
void give_back_room(std::vector<Observation>& seen) {
  constexpr std::size_t kSpare = 4;  // sightings of room that are worth no copy
  if (seen.capacity() > 2 * seen.size() + kSpare) seen.shrink_to_fit();
}

}  // namespace

AnchoredFrame anchored(Stamp stamp, const View& frame_from_keyframe) {
  const Pose3 pose = pose_of(frame_from_keyframe);
  return {stamp, pose.t.cast<float>(), pose.q.coeffs().cast<float>()};
}

View frame_from_keyframe(const AnchoredFrame& frame) {
  Pose3 pose;
  pose.t = frame.centre.cast<double>();
  pose.q.coeffs() = frame.turn.cast<double>();
  pose.q.normalize();
  return view_of(pose);
}

Eigen::Vector2d LandmarkMap::slack_of(const ClientLandmark& seen, const View& view) const {
  constexpr double kStep = 0.01;  // of the distance, for a derivative by differences
  const Eigen::Vector3d from_first = seen.point - keyframe(seen.seen.front().keyframe).view.centre();
  const Eigen::Vector3d here = view * seen.point, there = here + kStep * (view.rotation * from_first);
  if (!(here.z() > kNearestAligned_m && there.z() > kNearestAligned_m)) return Eigen::Vector2d::Zero();
  return seen.share_unknown / kStep * (camera.project(there) - camera.project(here));
}

void LandmarkMap::widen(Sighting& sighting, const ClientLandmark& seen, double depth_m) const {
  const double depth = std::max(depth_m, kNearest_m), away = seen.borrowed->sigma_m / depth;
  sighting.sigma_px =
      std::sqrt(sighting.sigma_px * sighting.sigma_px + seen.borrowed->sigma_px * seen.borrowed->sigma_px +
                camera.fx * camera.fx * away * away);
  if (sighting.inverse_depth_sigma > 0.0)
    sighting.inverse_depth_sigma = std::hypot(sighting.inverse_depth_sigma, away / depth);
}

int LandmarkMap::add(Keyframe keyframe) {
  keyframe.serial = keyframes_made++;
  return put(keyframes, free_keyframes, std::move(keyframe));
}

int LandmarkMap::add(ClientLandmark landmark) {
  landmark.serial = landmarks_made++;
  return put(landmarks, free_landmarks, std::move(landmark));
}

void LandmarkMap::see(int id, const Observation& observation) {
  landmark(id).seen.push_back(observation);
  keyframe(observation.keyframe).landmarks.push_back(id);
}

void LandmarkMap::forget(int id, int number) {
  auto& seen = landmark(id).seen;
  seen.erase(std::remove_if(seen.begin(), seen.end(), [number](const Observation& o) { return o.keyframe == number; }),
             seen.end());
  give_back_room(seen);
  strike(keyframe(number).landmarks, id);
  if (seen.empty() ||
      (seen.size() == 1 && monocular && !landmark(id).borrowed && seen.front().sighting.inverse_depth_sigma <= 0.0))
    remove_landmark(id);
}

void LandmarkMap::remove_landmark(int id) {
  ClientLandmark& removed = landmark(id);
  if (removed.gone) return;
  for (const Observation& o : removed.seen) strike(keyframe(o.keyframe).landmarks, id);
  removed = ClientLandmark();
  removed.gone = true;
  free_landmarks.push_back(id);
}

void LandmarkMap::remove_keyframe(int number, int new_parent) {
  MAPWEAVE_EXPECT(number != new_parent && !keyframe(new_parent).gone, "another keyframe takes over");
  const View parent_from_removed = keyframe(new_parent).view * keyframe(number).view.inverse();
  const View removed_from_parent = parent_from_removed.inverse();
  const std::vector<int> listed = keyframe(number).landmarks;
  for (int id : listed) {
    forget(id, number);
    if (landmark(id).seen.size() < 2) remove_landmark(id);  // not worth a keyframe, so not worth keeping
  }
  for (ClientLandmark& other : landmarks)
    for (Appearance& appearance : other.appearances)
      if (appearance.keyframe == number) {
        appearance.keyframe = new_parent;
        appearance.from_keyframe = appearance.from_keyframe * removed_from_parent;
      }
  for (const AnchoredFrame& frame : keyframe(number).frames)
    keyframe(new_parent).frames.push_back(anchored(frame.stamp, frame_from_keyframe(frame) * removed_from_parent));
  for (ForgottenKeyframe& one : keyframe(number).forgotten) {
    one.place = anchored(one.place.stamp, frame_from_keyframe(one.place) * removed_from_parent);
    keyframe(new_parent).forgotten.push_back(one);
  }
  keyframe(number) = Keyframe();
  keyframe(number).gone = true;
  free_keyframes.push_back(number);
}

void LandmarkMap::forget_keyframe(int number, int new_parent) {
  if (!remembers_forgotten) return remove_keyframe(number, new_parent);
  const Keyframe& forgotten = keyframe(number);
  const View forgotten_from_parent = forgotten.view * keyframe(new_parent).view.inverse();
  const ForgottenKeyframe kept{forgotten.serial, anchored(forgotten.stamp, forgotten_from_parent)};
  std::vector<std::pair<int, std::uint32_t>> seen;  // own landmarks, and their serial numbers
  for (int id : forgotten.landmarks)
    if (!landmark(id).borrowed) seen.emplace_back(id, landmark(id).serial);
  remove_keyframe(number, new_parent);
  for (const auto& [id, serial] : seen)
    if (landmark(id).gone) forgotten_landmarks.push_back(serial);
  keyframe(new_parent).forgotten.push_back(kept);
}

void LandmarkMap::fuse(int kept, int other) {
  ClientLandmark& target = landmark(kept);
  const ClientLandmark source = landmark(other);
  remove_landmark(other);
  for (const Observation& o : source.seen) {
    const auto sees = [&](const Observation& mine) { return mine.keyframe == o.keyframe; };
    if (std::none_of(target.seen.begin(), target.seen.end(), sees)) see(kept, o);
  }
  for (const Appearance& appearance : source.appearances)
    if (target.appearances.size() < kMostAppearances) target.appearances.push_back(appearance);
  target.tried += source.tried;
  target.found += source.found;
}

void LandmarkMap::discard(int number) {
  const std::vector<int> listed = keyframe(number).landmarks;
  for (int id : listed) forget(id, number);
  keyframe(number) = Keyframe();
  keyframe(number).gone = true;
  free_keyframes.push_back(number);
}

std::vector<CovisibleKeyframe> covisible(const LandmarkMap& map, int keyframe) {
  std::vector<int> counts(map.keyframes.size(), 0);
  for (int id : map.keyframe(keyframe).landmarks)
    for (const Observation& o : map.landmark(id).seen) ++counts[static_cast<std::size_t>(o.keyframe)];
  counts[static_cast<std::size_t>(keyframe)] = 0;
  std::vector<CovisibleKeyframe> result;
  for (std::size_t i = 0; i < counts.size(); ++i)
    if (counts[i] > 0) result.push_back({static_cast<int>(i), counts[i]});
  return result;
}

std::vector<CovisibleKeyframe> most_first(std::vector<CovisibleKeyframe> shared) {
  std::sort(shared.begin(), shared.end(), [](const CovisibleKeyframe& a, const CovisibleKeyframe& b) {
    return a.landmarks != b.landmarks ? a.landmarks > b.landmarks : a.keyframe > b.keyframe;
  });
  return shared;
}

namespace {

template <class Better>
int best_of(const LandmarkMap& map, int session, Better better) {
  int best = -1;
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    const Keyframe& keyframe = map.keyframes[i];
    if (!keyframe.gone && keyframe.session == session &&
        (best < 0 || better(keyframe.serial, map.keyframe(best).serial)))
      best = static_cast<int>(i);
  }
  return best;
}

}  // namespace

int first_of(const LandmarkMap& map, int session) { return best_of(map, session, std::less<>()); }
int newest_of(const LandmarkMap& map, int session) { return best_of(map, session, std::greater<>()); }

}  // namespace mapweave::visual
