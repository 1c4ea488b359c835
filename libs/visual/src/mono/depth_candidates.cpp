#include "depth_candidates.h"

#include "tracking/landmark_finder.h"

#include <algorithm>
#include <cmath>

namespace mapweave::visual {
namespace {

constexpr std::uint32_t kMostKeyframes = 10;  // that a candidate waits: later, its patch looks otherwise
constexpr int kMostMisses = 15;  // looks without success, more than those with: hidden for a while is not gone
constexpr std::size_t kMostCandidates = 600;  // the newest; bounds the time of a frame
// Sigma of the inverse depth as a share of it: of a landmark, and where no more is learnt. While the camera turns on
// the spot, landmarks leave the picture and no depth is learnt: then those of any depth hold its direction.
constexpr double kRoughlyKnown = 0.35, kKnown = 0.05;
constexpr std::size_t kFewMatches = 120;  // in a picture: with fewer, those of any depth are taken
constexpr double kCaution = 3.0;          // sigmas of neighbouring frames err alike
constexpr double kClearlyBetter = 0.95;   // of the sigma: a view that gains less is not taken for the best one
constexpr int kLeastFound = 2;            // once may be another thing that looks alike
// Of the inverse depth: how far the line is searched, which costs time; and how far off what is found there, aligned to
// a fraction of a pixel, may be.
constexpr double kSigmas = 2.0, kGateSigmas = 3.0;
constexpr double kFarthest = 1e-4;   // inverse depth; smaller ones show no parallax
constexpr double kNearest = 0.05;    // of the depth in the keyframe: nearer, the camera is all but beside it
constexpr double kBorder = 8.0;      // of the picture: twice the half of a patch that is compared
constexpr float kReach_px = 2.5F;    // of the alignment: more than the step and the line's error
constexpr double kOffLine_px = 1.5;  // after the alignment; the line is off as the camera's pose is
constexpr double kStep_px = 0.7;     // half of a pixel's diagonal: no pixel along the line is left out
constexpr int kFewestSteps = 3;      // of a line: shorter ones lie within kReach_px of their middle
constexpr int kMostSteps = 120;      // bounds the time; longer lines wait until the depth is known better
// Correlations: of what is taken for the same place, and of another place, beside the best, that makes it ambiguous.
constexpr float kLikely = 0.75F, kNearlyAsGood = 0.95F;
constexpr double kApart_px = 3.0;  // of the patch's level: another place

struct Line {  // of what lies on a candidate's ray, by inverse depth
  Eigen::Vector3d far, by_inverse_depth;
  std::optional<Eigen::Vector2d> at(double inverse_depth, const Pinhole& camera) const {
    const Eigen::Vector3d p = far + inverse_depth * by_inverse_depth;
    if (!(p.z() > kNearest)) return std::nullopt;
    const Eigen::Vector2d pixel = camera.project(p);
    if (!(pixel.x() >= kBorder && pixel.y() >= kBorder && pixel.x() < camera.width - kBorder &&
          pixel.y() < camera.height - kBorder))
      return std::nullopt;
    return pixel;
  }
};

// Zero-mean normalised, at whole pixels of the patch's level.
float likeness(const WarpedPatch& patch, const GreyImage& image, const Eigen::Vector2d& pixel) {
  constexpr int kStride = kAlignSize + 2, kCount = kAlignSize * kAlignSize;
  const int left = static_cast<int>(std::lround(at_level(pixel.x(), patch.level) - (kAlignHalf - 0.5))),
            top = static_cast<int>(std::lround(at_level(pixel.y(), patch.level) - (kAlignHalf - 0.5)));
  if (left < 0 || top < 0 || left + kAlignSize > image.width || top + kAlignSize > image.height) return -1.0F;
  float a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  for (int y = 0; y < kAlignSize; ++y) {
    const float* p = patch.values.data() + (y + 1) * kStride + 1;
    const std::uint8_t* q = image.row(top + y) + left;
    for (int x = 0; x < kAlignSize; ++x) {
      const auto value = static_cast<float>(q[x]);
      a += p[x];
      b += value;
      aa += p[x] * p[x];
      bb += value * value;
      ab += p[x] * value;
    }
  }
  const float variance_a = aa - a * a / kCount, variance_b = bb - b * b / kCount;
  return variance_a < 1.0F || variance_b < 1.0F ? -1.0F : (ab - a * b / kCount) / std::sqrt(variance_a * variance_b);
}

// Where on the line the patch is seen best. nullopt where nowhere, or at two places.
std::optional<Eigen::Vector2d> search_line(const WarpedPatch& patch, const GreyImage& image, const Line& line,
                                           double low, double high, const Pinhole& camera) {
  const auto from = line.at(low, camera), to = line.at(high, camera);
  if (!from || !to) return std::nullopt;
  const double length = (*to - *from).norm() / (1 << patch.level);
  const int steps = static_cast<int>(std::ceil(length / kStep_px));
  if (steps > kMostSteps) return std::nullopt;
  if (steps < kFewestSteps) return Eigen::Vector2d(0.5 * (*from + *to));
  std::vector<float> scores;
  for (int i = 0; i <= steps; ++i) scores.push_back(likeness(patch, image, *from + (*to - *from) * i / steps));
  const auto best = static_cast<int>(std::max_element(scores.begin(), scores.end()) - scores.begin());
  const float score = scores[static_cast<std::size_t>(best)];
  if (score < kLikely) return std::nullopt;
  for (int i = 0; i <= steps; ++i)
    if (std::abs(i - best) * length / steps > kApart_px && scores[static_cast<std::size_t>(i)] > kNearlyAsGood * score)
      return std::nullopt;
  return Eigen::Vector2d(*from + (*to - *from) * best / steps);
}

bool is_same(const ClientLandmark& landmark, std::uint32_t serial) {
  return !landmark.gone && landmark.serial == serial;
}

enum class Look { hidden, missed, found };

Look look_for(DepthCandidate& candidate, const LandmarkMap& map, const Pyramid& picture, const View& view,
              const TrackingOptions& options) {
  const Pinhole& camera = map.camera;
  const View new_from_old = view * map.keyframe(candidate.keyframe).view.inverse();
  const Eigen::Vector3d ray = camera.ray(candidate.pixel - map.calibration.readout_s * candidate.row_flow);
  const Line line{new_from_old.rotation * ray, new_from_old.translation};
  const double low = std::max(kFarthest, candidate.inverse_depth - kSigmas * candidate.sigma),
               high = candidate.inverse_depth + kSigmas * candidate.sigma;
  const double middle = std::max(low, candidate.inverse_depth), step = 0.01 * middle;
  const auto here = line.at(middle, camera), beside = line.at(middle + step, camera);
  if (!here || !beside) return Look::hidden;
  const double pixels_per_inverse_depth = (*beside - *here).norm() / step;
  const double sigma =
      M_SQRT2 * options.sigma_px * (1 << candidate.patch.level) / std::max(pixels_per_inverse_depth, 1e-9);
  candidate.now = *here;
  const bool gives_depth = sigma < kClearlyBetter * candidate.sigma;
  if (!gives_depth && candidate.landmark >= 0) return Look::hidden;

  const auto warped =
      warp_patch(candidate.patch, warp_to(camera, candidate.pixel, candidate.patch.level, new_from_old, 1.0 / middle));
  if (!warped) return Look::hidden;
  const auto start = search_line(*warped, picture[warped->level], line, low, high, camera);
  if (!start) return Look::missed;
  const auto match = align_patch(*warped, picture[warped->level], *start, kReach_px);
  if (!match || static_cast<double>(match->correlation) < options.min_correlation) return Look::missed;
  const Eigen::Vector3d seen = camera.ray(match->pixel), a = seen.cross(line.far),
                        b = seen.cross(line.by_inverse_depth);
  const double inverse_depth = -a.dot(b) / b.squaredNorm();
  if (!(inverse_depth > kFarthest)) return Look::missed;
  const auto there = line.at(inverse_depth, camera);
  if (!there || (*there - match->pixel).norm() > kOffLine_px * (1 << warped->level) ||
      std::abs(inverse_depth - candidate.inverse_depth) > kGateSigmas * std::hypot(sigma, candidate.sigma))
    return Look::missed;
  if (gives_depth) {
    candidate.inverse_depth = inverse_depth;
    candidate.sigma = sigma;
  }
  candidate.now = match->pixel;
  candidate.level_now = warped->level;
  return Look::found;
}

// What the keyframe's sighting of the landmark says of its depth.
void take_depth(LandmarkMap& map, const DepthCandidate& candidate) {
  ClientLandmark& landmark = map.landmark(candidate.landmark);
  landmark.share_unknown = candidate.sigma / candidate.inverse_depth;
  if (landmark.seen.front().keyframe != candidate.keyframe) return;
  Sighting& sighting = landmark.seen.front().sighting;
  sighting.inverse_depth = candidate.inverse_depth;
  sighting.inverse_depth_sigma = kCaution * candidate.sigma;
  if (landmark.seen.size() == 1)
    landmark.point =
        map.keyframe(candidate.keyframe).view.inverse() *
        (map.camera.ray(candidate.pixel - map.calibration.readout_s * candidate.row_flow) / candidate.inverse_depth);
}

void become_landmark(LandmarkMap& map, DepthCandidate& candidate, const Motion& motion, const View& view,
                     std::vector<Match>& matches, const TrackingOptions& options) {
  ClientLandmark landmark;
  Observation seen{candidate.keyframe, {}};
  seen.sighting.pixel = candidate.pixel;
  seen.sighting.row_flow = candidate.row_flow;
  seen.sighting.sigma_px = options.sigma_px * (1 << candidate.patch.level);
  landmark.appearances.push_back({candidate.patch, candidate.pixel, candidate.keyframe, View()});
  landmark.tried = landmark.found = 1;
  candidate.landmark = map.add(std::move(landmark));
  candidate.landmark_serial = map.landmark(candidate.landmark).serial;
  map.see(candidate.landmark, seen);
  map.recent_landmarks.emplace_back(candidate.landmark, map.keyframes_made - 1);
  take_depth(map, candidate);
  const double depth = (view * map.landmark(candidate.landmark).point).z();
  matches.push_back(
      {candidate.landmark, candidate.now, row_flow(map.camera, motion, candidate.now, depth), candidate.level_now});
}

}  // namespace

std::vector<Match> look_for_candidates(LandmarkMap& map, const Pyramid& picture, const View& view, const Motion& motion,
                                       std::size_t landmarks, const TrackingOptions& options) {
  std::vector<Match> matches;
  std::vector<DepthCandidate> kept;
  const std::size_t skipped = map.candidates.size() > kMostCandidates ? map.candidates.size() - kMostCandidates : 0;
  for (std::size_t i = skipped; i < map.candidates.size(); ++i) {
    DepthCandidate& candidate = map.candidates[i];
    const Keyframe& keyframe = map.keyframe(candidate.keyframe);
    if (keyframe.gone || keyframe.serial != candidate.keyframe_serial ||
        keyframe.serial + kMostKeyframes < map.keyframes_made)
      continue;
    if (candidate.landmark >= 0 && !is_same(map.landmark(candidate.landmark), candidate.landmark_serial)) continue;
    const Look look = look_for(candidate, map, picture, view, options);
    if (look == Look::found) ++candidate.found;
    if (look == Look::missed) ++candidate.missed;
    if (candidate.missed > candidate.found + kMostMisses) continue;
    if (look == Look::found && candidate.landmark >= 0) take_depth(map, candidate);
    const double share_unknown = candidate.sigma / candidate.inverse_depth;
    if (look == Look::found && candidate.landmark < 0 && candidate.found >= kLeastFound &&
        (share_unknown < kRoughlyKnown || landmarks + matches.size() < kFewMatches))
      become_landmark(map, candidate, motion, view, matches, options);
    if (candidate.landmark < 0 || share_unknown > kKnown) kept.push_back(candidate);
  }
  map.candidates = std::move(kept);
  return matches;
}

}  // namespace mapweave::visual
