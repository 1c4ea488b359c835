#include "shared_loops.h"

#include "loop_claims.h"
#include "sharing/borrowed_landmarks.h"
#include "sharing/shown_landmarks.h"

#include <algorithm>
#include <cmath>

namespace mapweave::visual {
namespace {

// Keyframes most alike that are named, of which kJudged are judged: a keyframe must not take longer than till the next.
constexpr std::size_t kLookedUp = 6;
constexpr std::size_t kCovisible = 2;                  // own keyframes that speak with the newest
constexpr double kStands_m = 0.1, kStands_rad = 0.03;  // less is no loop: tracking corrects it

// Landmarks that the features show within `radius_px` of where they should be.
std::vector<Sighting> shown(const std::vector<DescribedLandmark>& landmarks, const FrameFeatureGrid& features,
                            const Pinhole& camera, const View& view, double radius_px, double sigma_px) {
  std::vector<Sighting> result;
  std::vector<char> taken(static_cast<std::size_t>(features.size()), 0);
  for (const DescribedLandmark& landmark : landmarks) {
    const Eigen::Vector3d p = view * landmark.point_in_map,
                          q = view * (landmark.point_in_map + landmark.feature_from_point).eval();
    if (!(p.z() > kNearest_m && q.z() > kNearest_m)) continue;
    const Eigen::Vector2d pixel = camera.project(p), at = camera.project(q);
    const int feature = features.find(landmark.descriptor, at, radius_px, taken);
    if (feature < 0) continue;
    taken[static_cast<std::size_t>(feature)] = 1;
    Sighting sighting;
    sighting.point_in_map = landmark.point_in_map;
    sighting.pixel = features.pixel(feature) - (at - pixel);
    sighting.sigma_px = std::hypot(sigma_px * (1 << features.level(feature)), camera.fx * landmark.sigma_m / p.z());
    result.push_back(sighting);
  }
  return result;
}

}  // namespace

std::optional<FoundLoop> SharedLoopDetector::look(const LandmarkMap& map, const SharedKeyframes& shared, int newest,
                                                  const Pyramid& picture, double repeats_m) {
  const Keyframe& keyframe = map.keyframe(newest);
  if (!options_.loops.enabled || shared.empty()) return std::nullopt;
  while (!claims_.empty() && claims_.front().serial + kMemory < keyframe.serial) claims_.pop_front();
  const std::vector<int> own = with_covisible(map, newest, kCovisible);
  const JudgedPlace here = place_of(map, own);
  std::size_t judged = 0;
  for (const NodeId& id : shared.alike(keyframe.session, keyframe.features, kLookedUp)) {
    if (judged++ >= kJudged) break;
    const auto place = shared.judged(id, here);
    if (!place) continue;
    auto loop = compare(map, shared, *place, newest, picture);
    if (!loop) continue;
    const View correction = correction_of(map, *loop);
    const Eigen::Vector3d centre = keyframe.view.centre();
    if ((correction * centre - centre).norm() < kStands_m && angle_of(correction) < kStands_rad) return std::nullopt;
    if (!could_lead(map, *loop, place->anchor, repeats_m)) continue;
    claims_.push_back({keyframe.serial, keyframe.session, correction, centre, loop->scale});
    if (agreeing_with(claims_.back()) < options_.loops.agreeing_keyframes) return std::nullopt;
    claims_.clear();
    return loop;
  }
  return std::nullopt;
}

bool SharedLoopDetector::could_lead(const LandmarkMap& map, const FoundLoop& loop, std::uint32_t anchor,
                                    double repeats_m) const {
  const Keyframe& newest = map.keyframe(loop.newest);
  const View correction = correction_of(map, loop);
  const double path = path_between(map, loop.newest, keyframe_beside(map, newest.session, anchor));
  const double stretch = std::abs(std::log(loop.scale));
  Departure off;
  off.error_m = (correction * newest.view.centre() - newest.view.centre()).norm();
  off.reach_m = options_.loops.drift_m + (options_.loops.drift + stretch) * path;
  return stretch < kStretch && angle_of(correction) < kTurn + kTurnPerMetre * path &&
         allowed(off, repeats_m) == Allowed::yes;
}

// Keyframes that say the same, each once.
int SharedLoopDetector::agreeing_with(const Claim& claim) const {
  int agree = 0;
  std::optional<std::uint32_t> last;
  for (const Claim& other : claims_) {
    if (other.session != claim.session || last == other.serial) continue;
    const Eigen::Vector3d as_other = other.correction * other.centre +
                                     other.scale * (other.correction * claim.centre - other.correction * other.centre);
    if ((as_other - claim.correction * claim.centre).norm() <
            options_.loops.drift_m + options_.loops.drift * (other.centre - claim.centre).norm() &&
        angle_of(other.correction * claim.correction.inverse()) < kTurnApart &&
        std::abs(std::log(other.scale / claim.scale)) < kScaleApart) {
      ++agree;
      last = other.serial;
    }
  }
  return agree;
}

std::optional<FoundLoop> SharedLoopDetector::compare(const LandmarkMap& map, const SharedKeyframes& shared,
                                                     const SharedPlace& place, int newest,
                                                     const Pyramid& picture) const {
  const Keyframe& keyframe = map.keyframe(newest);
  const FrameFeatureGrid grid = picture.features ? *picture.features : grid_of(keyframe.features, map.camera);
  const double sigma_px = std::hypot(options_.tracking.sigma_px, picture.features ? 0.0 : kFeature_px);
  FoundLoop loop;
  loop.newest = newest;
  loop.earlier = -1;
  loop.serial = keyframe.serial;
  loop.view = place.view;
  loop.scale = map.monocular ? place.scale : 1.0;
  loop.fixed = FixedPlace{place.keyframe, place.keyframe_view, {}};
  for (const double reach : {kFar, kClose}) {
    const auto landmarks = shared.in_view(place.session, loop.view, map.camera);
    const auto found = shown(landmarks, grid, map.camera, loop.view, reach * map.camera.width, sigma_px);
    const PoseFromPoints pose =
        pose_from_points(found, map.camera, loop.view, map.calibration, options_.tracking.gate_sigmas);
    if (pose.count < kLeastShown || pose.count < kShownShare * static_cast<double>(found.size())) return std::nullopt;
    loop.view = pose.view;
    loop.fixed->sightings.clear();
    for (std::size_t i = 0; i < found.size(); ++i)
      if (pose.fits[i]) loop.fixed->sightings.push_back(found[i]);
  }
  return loop;
}

}  // namespace mapweave::visual
