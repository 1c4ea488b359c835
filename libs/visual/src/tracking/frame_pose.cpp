#include "frame_pose.h"

#include <algorithm>

namespace mapweave::visual {

PoseFromPoints pose_by(const LandmarkMap& map, int session, const std::vector<Match>& found, const View& start,
                       const TrackingOptions& options) {
  std::vector<Sighting> all, own, known, borrowed;
  for (const Match& match : found) {
    all.push_back(map.sighting_of(match, options.sigma_px, &start));
    const Landmark& landmark = map.landmark(match.landmark);
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

int most_seen(const LandmarkMap& map, const std::vector<Match>& matches) {
  std::vector<int> counts(map.keyframes.size(), 0);
  for (const Match& match : matches)
    for (const Observation& o : map.landmark(match.landmark).seen) ++counts[static_cast<std::size_t>(o.keyframe)];
  return static_cast<int>(std::max_element(counts.begin(), counts.end()) - counts.begin());
}

}  // namespace mapweave::visual
