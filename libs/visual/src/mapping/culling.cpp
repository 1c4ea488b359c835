#include "culling.h"

#include <algorithm>

namespace mapweave::visual {
namespace {

constexpr std::uint32_t kProbation = 2;  // keyframes after the one that made a landmark
constexpr std::uint32_t kPatience = 15;  // keyframes: what none but the first of them saw is not found again
constexpr int kLeastTries = 8;           // of fewer, a share says nothing
constexpr std::uint32_t kStaying = 3;    // newest keyframes
constexpr int kAsked = 60;               // keyframes at once
// Two landmarks that are one: pixels on the feature's level, share of the depth.
constexpr double kSamePixel = 1.5, kSameDepth = 0.05;

// How many landmarks of a keyframe fewer than `views` others see at least as finely, and how many landmarks it has.
std::pair<int, int> own_landmarks(const LandmarkMap& map, int number, int views) {
  int own = 0, all = 0;
  for (int id : map.keyframe(number).landmarks) {
    const auto& seen = map.landmark(id).seen;
    double sigma_px = 0;
    for (const Observation& o : seen)
      if (o.keyframe == number) sigma_px = o.sighting.sigma_px;
    int others = 0;
    for (const Observation& o : seen) others += o.keyframe != number && o.sighting.sigma_px <= sigma_px;
    ++all;
    own += others < views;
  }
  return {own, all};
}

bool may_go(const LandmarkMap& map, int number, int newest) {
  const Keyframe &keyframe = map.keyframe(number), &last = map.keyframe(newest);
  return !keyframe.gone && (keyframe.session != last.session || keyframe.serial + kStaying <= last.serial) &&
         number != first_of(map, keyframe.session);
}

}  // namespace

void cull_landmarks(LandmarkMap& map, int newest, const MemoryOptions& options) {
  const std::uint32_t now = map.keyframe(newest).serial;
  const auto rarely_found = [&](const ClientLandmark& landmark) {
    return landmark.tried >= kLeastTries && landmark.found < options.found_share * landmark.tried;
  };
  auto kept = map.recent_landmarks.begin();
  for (const auto& [id, made] : map.recent_landmarks) {
    const ClientLandmark& landmark = map.landmark(id);
    const bool grown = now >= made + kProbation, old = now >= made + kPatience;
    if (landmark.gone) continue;
    const bool alone = landmark.seen.size() < 2;
    if (rarely_found(landmark) || (alone && (old || (grown && 2 * landmark.found < landmark.tried))))
      map.remove_landmark(id);
    else if (!old)
      *kept++ = {id, made};
  }
  map.recent_landmarks.erase(kept, map.recent_landmarks.end());
  const std::vector<int> listed = map.keyframe(newest).landmarks;
  for (int id : listed)
    if (rarely_found(map.landmark(id))) map.remove_landmark(id);
}

int keyframe_to_cull(const LandmarkMap& map, int newest, const MemoryOptions& options) {
  int best = -1;
  double least = 1.0 - options.redundant_share;
  for (const CovisibleKeyframe& shared : covisible(map, newest)) {
    if (!may_go(map, shared.keyframe, newest)) continue;
    const auto [own, all] = own_landmarks(map, shared.keyframe, options.redundant_views);
    if (own <= least * all && (best < 0 || own < least * all)) {
      best = shared.keyframe;
      least = static_cast<double>(own) / std::max(1, all);
    }
  }
  return best;
}

int keyframe_to_forget(const LandmarkMap& map, int newest, const MemoryOptions& options) {
  if (map.keyframe_count() <= options.keyframes) return -1;
  int best = -1;
  // Whoever takes fewest landmarks away, of some that are asked in turn; of equals the earliest.
  const int slots = static_cast<int>(map.keyframes.size()), asked = std::min(slots, kAsked);
  const auto start = static_cast<int>(static_cast<std::uint64_t>(map.keyframe(newest).serial) * kAsked %
                                      static_cast<std::uint64_t>(slots));
  for (int round = 0; round < 2 && best < 0; ++round) {
    int fewest = 0;
    for (int i = 0; i < (round == 0 ? asked : slots); ++i) {
      const int number = (start + i) % slots;
      if (!may_go(map, number, newest)) continue;
      const int own = own_landmarks(map, number, 1).first;
      if (best < 0 || own < fewest || (own == fewest && map.keyframe(number).serial < map.keyframe(best).serial)) {
        best = number;
        fewest = own;
      }
    }
  }
  return best;
}

int new_parent_of(const LandmarkMap& map, int keyframe) {
  const auto shared = most_first(covisible(map, keyframe));
  if (!shared.empty()) return shared.front().keyframe;
  const Keyframe& removed = map.keyframe(keyframe);
  int new_parent = -1;
  const auto apart = [&](int number) {
    return std::abs(static_cast<std::int64_t>(map.keyframe(number).serial) - static_cast<std::int64_t>(removed.serial));
  };
  for (int number = 0; number < static_cast<int>(map.keyframes.size()); ++number)
    if (number != keyframe && !map.keyframe(number).gone && map.keyframe(number).session == removed.session &&
        (new_parent < 0 || apart(number) < apart(new_parent)))
      new_parent = number;
  return new_parent;
}

std::size_t thin_frames(LandmarkMap& map, std::size_t most) {
  std::size_t count = 0;
  for (const Keyframe& keyframe : map.keyframes) count += keyframe.frames.size();
  if (count <= most) return count;
  count = 0;
  for (Keyframe& keyframe : map.keyframes) {
    std::vector<AnchoredFrame> kept;
    kept.reserve((keyframe.frames.size() + 1) / 2);
    for (std::size_t i = 0; i < keyframe.frames.size(); i += 2) kept.push_back(keyframe.frames[i]);
    keyframe.frames = std::move(kept);
    count += keyframe.frames.size();
  }
  return count;
}

void fuse_duplicates(LandmarkMap& map, const std::vector<int>& keyframes, const std::vector<Match>& matches,
                     const Pyramid& picture, const View& view) {
  constexpr int kCell = 8;  // pixels of a bin: speed alone
  const int columns = map.camera.width / kCell + 1, rows = map.camera.height / kCell + 1;
  std::vector<const Match*> shown(static_cast<std::size_t>(columns * rows), nullptr);
  std::vector<char> known(map.landmarks.size(), 0);
  const auto cell_of = [&](const Eigen::Vector2d& pixel) {
    return static_cast<std::size_t>(static_cast<int>(pixel.y()) / kCell * columns +
                                    static_cast<int>(pixel.x()) / kCell);
  };
  for (const Match& match : matches) {
    known[static_cast<std::size_t>(match.landmark)] = 1;
    if (map.landmark(match.landmark).borrowed) continue;
    if (match.pixel.x() >= 0 && match.pixel.y() >= 0 && match.pixel.x() < map.camera.width &&
        match.pixel.y() < map.camera.height)
      shown[cell_of(match.pixel)] = &match;
  }
  for (int k : keyframes) {
    const std::vector<int> listed = map.keyframe(k).landmarks;
    for (int id : listed) {
      if (known[static_cast<std::size_t>(id)]) continue;
      known[static_cast<std::size_t>(id)] = 1;
      const ClientLandmark& landmark = map.landmark(id);
      const Eigen::Vector3d p = view * landmark.point;
      if (p.z() < kNearest_m || landmark.borrowed) continue;
      const Eigen::Vector2d pixel = map.camera.project(p);
      if (!(pixel.x() >= kCell && pixel.y() >= kCell && pixel.x() < map.camera.width - kCell &&
            pixel.y() < map.camera.height - kCell))
        continue;
      const Match* same = nullptr;
      for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
          const Match* match = shown[cell_of(pixel + Eigen::Vector2d(dx * kCell, dy * kCell))];
          if (match != nullptr && (match->pixel - pixel).norm() < kSamePixel * (1 << match->level)) same = match;
        }
      if (same == nullptr || map.landmark(same->landmark).gone) continue;
      const double depth = (view * map.landmark(same->landmark).point).z();
      if (std::abs(depth - p.z()) > kSameDepth * p.z()) continue;
      const auto there = find_landmark(map, landmark, picture, view, pixel);
      if (there && (there->pixel - same->pixel).norm() < 0.7 * (1 << same->level)) map.fuse(same->landmark, id);
    }
  }
}

}  // namespace mapweave::visual
