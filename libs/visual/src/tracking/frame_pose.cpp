#include "frame_pose.h"

#include <mapweave/core/median.h>

#include <algorithm>

namespace mapweave::visual {
namespace {

// Median distance of points from their middle.
double spread_of(std::vector<Eigen::Vector3d> points) {
  Eigen::Vector3d centre;
  std::vector<double> values(points.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < points.size(); ++i) values[i] = points[i][axis];
    centre[axis] = median(values);
  }
  for (std::size_t i = 0; i < points.size(); ++i) values[i] = (points[i] - centre).norm();
  return median(std::move(values));
}

}  // namespace

PoseFromPoints pose_by(const LandmarkMap& map, int session, const std::vector<Match>& found, const View& start,
                       const TrackingOptions& options) {
  std::vector<Sighting> all, own, known, borrowed;
  for (const Match& match : found) {
    all.push_back(map.sighting_of(match, options.sigma_px, &start));
    const ClientLandmark& landmark = map.landmark(match.landmark);
    (landmark.borrowed ? borrowed : own).push_back(all.back());
    if (!landmark.borrowed && landmark.seen.size() > 2) known.push_back(all.back());
  }
  const std::vector<Sighting>* leading = nullptr;
  if (map.monocular && !borrowed.empty()) leading = map.is_reanchored(session) ? &borrowed : &own;
  if (!map.monocular && known.size() >= kEnough) leading = &known;
  if (!map.monocular && known.size() < kEnough && !borrowed.empty()) leading = &own;
  if (leading != nullptr && leading->size() >= kEnough) {
    const PoseFromPoints first = pose_from_points(*leading, map.camera, start, map.calibration, options.gate_sigmas);
    if (first.count >= static_cast<int>(kEnough))
      return pose_from_points(all, map.camera, first.view, map.calibration, options.gate_sigmas, options.gate_sigmas);
  }
  return pose_from_points(all, map.camera, start, map.calibration, options.gate_sigmas);
}

bool is_good(const LandmarkMap& map, const Attempt& attempt, bool followed, const TrackingOptions& options) {
  const int least = followed ? options.least_landmarks / 2 : options.least_landmarks;
  int found = 0;  // what others say of a place does not speak against it
  for (std::size_t i = 0; i < attempt.found.size(); ++i)
    found += attempt.pose.fits[i] || !map.landmark(attempt.found[i].landmark).borrowed;
  return attempt.pose.count >= least && 2 * attempt.pose.count >= found;
}

bool is_led_by_a_thing(const LandmarkMap& map, const Attempt& attempt, const TrackingOptions& options) {
  // What moves (a robot beside this one) is small, and the world around it large (DECISIONS.md, 108).
  constexpr std::size_t kFew = 8;  // landmarks that agree on another place
  constexpr double kThing_m = 0.4, kLarger = 2.0;
  std::vector<Eigen::Vector3d> of_thing, around;
  std::vector<Sighting> others;
  for (std::size_t i = 0; i < attempt.found.size(); ++i) {
    const ClientLandmark& landmark = map.landmark(attempt.found[i].landmark);
    if (landmark.borrowed) continue;
    if (attempt.pose.fits[i]) {
      of_thing.push_back(landmark.point);
    } else {
      others.push_back(map.sighting_of(attempt.found[i], options.sigma_px, &attempt.pose.view));
      around.push_back(landmark.point);
    }
  }
  if (others.size() < kFew || of_thing.empty()) return false;
  const double thing_m = spread_of(std::move(of_thing));
  if (thing_m > kThing_m) return false;
  const PoseFromPoints elsewhere =
      pose_from_points(others, map.camera, attempt.pose.view, map.calibration, options.gate_sigmas);
  for (std::size_t i = around.size(); i-- > 0;)
    if (!elsewhere.fits[i]) around.erase(around.begin() + static_cast<std::ptrdiff_t>(i));
  return around.size() >= kFew && 4 * around.size() >= 3 * others.size() &&
         spread_of(std::move(around)) >= kLarger * thing_m;
}

int most_seen(const LandmarkMap& map, const std::vector<Match>& matches) {
  std::vector<int> counts(map.keyframes.size(), 0);
  for (const Match& match : matches)
    for (const Observation& o : map.landmark(match.landmark).seen) ++counts[static_cast<std::size_t>(o.keyframe)];
  return static_cast<int>(std::max_element(counts.begin(), counts.end()) - counts.begin());
}

}  // namespace mapweave::visual
