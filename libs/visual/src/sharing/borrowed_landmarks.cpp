#include "borrowed_landmarks.h"

#include <algorithm>
#include <cmath>

namespace mapweave::visual {
namespace {

constexpr std::size_t kMost = 3000;                          // bounds memory and time of a client
constexpr std::uint32_t kPatience = 30;                      // keyframes out of view
constexpr int kMostFailures = 5;                             // keyframes without it; then it is forgotten
constexpr int kLeastTries = 8;                               // of fewer, a share says nothing
constexpr double kFoundShare = 0.3;                          // below which it is not where it should be
constexpr double kLeastCosine = 0.5, kMostRangeRatio = 2.5;  // of how it was seen by others
constexpr double kBorder = 8.0;                              // pixels

constexpr double kReach = 0.02, kLeastReach_px = 8.0;  // widths of the picture: how far keyframes look
// Landmarks that may say together where the camera is, if half of them agree and it is no farther than that from where
// tracking has it. Fewer, or a farther place, may agree by chance: each is then compared where the camera is.
constexpr std::size_t kLeastTogether = 12;
constexpr double kNear_m = 0.3, kNear_rad = 0.1;

struct Expected {
  Eigen::Vector2d pixel, feature;
};

// Where the camera should see it, and its feature; nothing where it should not.
std::optional<Expected> expected(const matching::DescribedLandmark& known, const Pinhole& camera, const View& view) {
  const Eigen::Vector3d p = view * known.point_in_map,
                        q = view * (known.point_in_map + known.feature_from_point).eval();
  if (!(p.z() > kNearest_m && q.z() > kNearest_m)) return std::nullopt;
  const Expected at{camera.project(p), camera.project(q)};
  for (const Eigen::Vector2d& pixel : {at.pixel, at.feature})
    if (!(pixel.x() >= kBorder && pixel.y() >= kBorder && pixel.x() < camera.width - kBorder &&
          pixel.y() < camera.height - kBorder))
      return std::nullopt;
  const Eigen::Vector3d ray = known.point_in_map - view.centre();
  const double range = ray.norm();
  if (!known.direction.isZero(0.0) && ray.dot(known.direction) < kLeastCosine * range) return std::nullopt;
  if (known.farthest_m > 0.0 &&
      (range > kMostRangeRatio * known.farthest_m || kMostRangeRatio * range < known.nearest_m))
    return std::nullopt;
  return at;
}

}  // namespace

bool is_expected(const matching::DescribedLandmark& known, const Pinhole& camera, const View& view) {
  return expected(known, camera, view).has_value();
}

std::vector<DescribedLandmark> without_own(const std::vector<DescribedLandmark>& landmarks, const LandmarkMap& map,
                                           const SessionId& own, const Pose3& robot_from_camera) {
  const Pose3 camera_from_robot = inverse(robot_from_camera);
  const auto is_own = [&](const DescribedLandmark& landmark) { return landmark.id.session == own; };
  std::vector<std::uint32_t> had;  // serial numbers
  if (std::any_of(landmarks.begin(), landmarks.end(), is_own))
    for (const ClientLandmark& landmark : map.landmarks)
      if (!landmark.gone) had.push_back(landmark.serial);
  std::sort(had.begin(), had.end());
  std::vector<DescribedLandmark> result;
  for (const DescribedLandmark& landmark : landmarks)
    if (!is_own(landmark) ||
        (landmark.id.index < map.landmarks_made && !std::binary_search(had.begin(), had.end(), landmark.id.index)))
      result.push_back(matching::transformed(landmark, {camera_from_robot, 1.0}));
  return result;
}

PoseFromPoints agreement(const LandmarkMap& map, const std::vector<Match>& found, const View& view,
                         const TrackingOptions& options) {
  std::vector<Sighting> sightings;
  for (const Match& match : found) sightings.push_back(map.sighting_of(match, options.sigma_px, &view));
  if (found.size() >= kLeastTogether) {
    PoseFromPoints pose = pose_from_points(sightings, map.camera, view, map.calibration, options.gate_sigmas);
    const View apart = pose.view * view.inverse();
    if (2 * pose.count > static_cast<int>(found.size()) && apart.translation.norm() < kNear_m &&
        Eigen::AngleAxisd(apart.rotation).angle() < kNear_rad)
      return pose;
  }
  PoseFromPoints here;
  here.view = view;
  Residual r;
  for (const Sighting& sighting : sightings) {
    here.fits.push_back(residual_of(sighting, view * sighting.point_in_map, map.camera, map.calibration, r) &&
                        r.value.head<2>().norm() < options.gate_sigmas);
    here.count += here.fits.back();
  }
  return here;
}

bool BorrowedLandmarks::is_held(const LandmarkMap& map, Entry& entry) const {
  if (entry.slot < 0) return false;
  const ClientLandmark& landmark = map.landmark(entry.slot);
  if (!landmark.gone && landmark.serial == entry.serial) return true;
  entry.slot = -1;
  ++entry.failures;  // no keyframe saw it any longer
  return false;
}

void BorrowedLandmarks::take_out(LandmarkMap& map, Entry& entry) const {
  if (is_held(map, entry)) map.remove_landmark(entry.slot);
  entry.slot = -1;
}

int BorrowedLandmarks::receive(LandmarkMap& map, int session,
                               const std::vector<matching::DescribedLandmark>& landmarks) {
  int taken = 0;
  for (const matching::DescribedLandmark& landmark : landmarks) {
    if (!matching::problem_with(landmark).empty()) continue;
    ++taken;
    Entry& entry = entries_[landmark.id];
    if (entry.session != session) {
      take_out(map, entry);
      entry.failures = 0;
    }
    if ((entry.known.point_in_map - landmark.point_in_map).norm() > landmark.sigma_m)
      entry.failures = 0;  // another chance
    entry.known = landmark;
    entry.session = session;
    entry.in_view = keyframes_;
    if (is_held(map, entry)) {
      ClientLandmark& held = map.landmark(entry.slot);
      held.point = landmark.point_in_map;
      held.borrowed->sigma_m = landmark.sigma_m;
    }
  }
  limit(map);
  return taken;
}

std::vector<Match> BorrowedLandmarks::look(LandmarkMap& map, const PosedFeatures& seen,
                                           const std::vector<Match>& matches, double radius_px) {
  const auto& [features, sigma_px, session, view, motion] = seen;
  std::vector<char> matched(map.landmarks.size(), 0), taken(static_cast<std::size_t>(features.size()), 0);
  for (const Match& match : matches) matched[static_cast<std::size_t>(match.landmark)] = 1;
  std::vector<Match> result;
  for (auto& [id, entry] : entries_) {
    const bool held = is_held(map, entry);
    if (entry.session != session || entry.failures >= kMostFailures) continue;
    if (held && static_cast<std::size_t>(entry.slot) < matched.size() && matched[static_cast<std::size_t>(entry.slot)])
      continue;
    const auto at = expected(entry.known, map.camera, view);
    if (!at) continue;
    const Eigen::Vector2d flow = row_flow(map.camera, motion, at->pixel, (view * entry.known.point_in_map).z());
    const int feature =
        features.find(entry.known.descriptor, at->feature + map.calibration.readout_s * flow, radius_px, taken);
    if (feature < 0) continue;
    taken[static_cast<std::size_t>(feature)] = 1;
    if (!held) {
      ClientLandmark landmark;
      landmark.point = entry.known.point_in_map;
      landmark.descriptor = entry.known.descriptor;
      landmark.borrowed = BorrowedLandmark{id, entry.known.sigma_m, sigma_px * (1 << features.level(feature))};
      entry.slot = map.add(std::move(landmark));
      entry.serial = map.landmark(entry.slot).serial;
    }
    const Eigen::Vector2d pixel = features.pixel(feature) - (at->feature - at->pixel);
    result.push_back({entry.slot, pixel, flow, features.level(feature), feature});
  }
  return result;
}

void BorrowedLandmarks::look_in_keyframe(LandmarkMap& map, int keyframe, const PosedFrame& frame,
                                         std::vector<Match>& matches, const TrackingOptions& options) {
  if (size() == 0) return;
  const auto& features = frame.picture.features;
  const FrameFeatureGrid grid = features ? *features : grid_of(map.keyframe(keyframe).features, map.camera);
  const PosedFeatures seen{grid, features ? 0.0 : kFeature_px, frame.session, frame.view, frame.motion};
  std::vector<Match> found = look(map, seen, matches, std::max(kLeastReach_px, kReach * map.camera.width));
  keep(map, found, agreement(map, found, frame.view, options).fits);
  for (const Match& match : found) see_borrowed(map, keyframe, frame.picture, match, options.sigma_px);
  matches.insert(matches.end(), found.begin(), found.end());
}

void BorrowedLandmarks::keep(LandmarkMap& map, std::vector<Match>& matches, const std::vector<char>& fits) {
  std::vector<Match> kept;
  for (std::size_t i = 0; i < matches.size(); ++i) {
    const ClientLandmark& landmark = map.landmark(matches[i].landmark);
    if (fits[i])
      kept.push_back(matches[i]);
    else if (landmark.seen.empty())
      take_out(map, entries_[landmark.borrowed->id]);
  }
  matches = std::move(kept);
}

void BorrowedLandmarks::tidy(LandmarkMap& map, int session, const View& view) {
  ++keyframes_;
  for (auto entry = entries_.begin(); entry != entries_.end();) {
    Entry& one = entry->second;
    if (is_held(map, one)) {
      const ClientLandmark& landmark = map.landmark(one.slot);
      if (landmark.tried >= kLeastTries && landmark.found < kFoundShare * landmark.tried) {
        take_out(map, one);
        one.failures = kMostFailures;
      }
    }
    if (one.session == session && expected(one.known, map.camera, view)) one.in_view = keyframes_;
    if (one.in_view + kPatience >= keyframes_) {
      ++entry;
      continue;
    }
    take_out(map, one);
    entry = entries_.erase(entry);
  }
}

// Those longest out of view go first.
void BorrowedLandmarks::limit(LandmarkMap& map) {
  if (entries_.size() <= kMost) return;
  std::vector<std::pair<std::uint32_t, LandmarkId>> order;
  for (const auto& [id, entry] : entries_) order.emplace_back(entry.in_view, id);
  std::sort(order.begin(), order.end());
  order.resize(order.size() - kMost);
  for (const auto& [in_view, id] : order) {
    take_out(map, entries_[id]);
    entries_.erase(id);
  }
}

void BorrowedLandmarks::forget(LandmarkMap& map, int session) {
  if (size() > 0) ++times_forgotten_;
  drop(map, session);
}

void BorrowedLandmarks::drop(LandmarkMap& map, int session) {
  for (auto entry = entries_.begin(); entry != entries_.end();) {
    if (entry->second.session != session) {
      ++entry;
      continue;
    }
    take_out(map, entry->second);
    entry = entries_.erase(entry);
  }
}

}  // namespace mapweave::visual
