#include "guided_search.h"

#include <mapweave/core/error.h>
#include <mapweave/core/median.h>
#include <mapweave/core/options.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <set>

namespace mapweave::matching {
namespace {

using Eigen::Vector2d;

// Bounds of the search for a rival.
constexpr int kRivalIterations = 200;
constexpr std::size_t kRivalFeatures = 500, kRivalLandmarks = 2000;

// A side with what is looked up often.
struct Side {
  const PlaceView& place;
  KeyframeFeatureGrid grid;                     // of the first keyframe
  std::vector<std::optional<FeatureId>> shown;  // of each landmark, the first feature that shows it
  std::vector<double> depth;                    // of the first keyframe's features; 0: unknown

  explicit Side(const PlaceView& view) : place(view), grid(view.keyframes.front()) {
    shown.resize(view.landmarks.size());
    for (std::uint32_t k = 0; k < view.keyframes.size(); ++k)
      for (std::uint32_t f = 0; f < view.keyframes[k].features.count; ++f) {
        const int landmark = landmark_of({k, f});
        if (landmark >= 0 && !shown[static_cast<std::size_t>(landmark)])
          shown[static_cast<std::size_t>(landmark)] = FeatureId{k, f};
      }
    const KeyframeView& first = view.keyframes.front();
    depth.assign(first.features.count, 0.0);
    const Pose3 camera_from_side = inverse(first.side_from_camera);
    for (std::uint32_t f = 0; f < first.features.count; ++f)
      if (const auto point = point_of({0, f})) depth[f] = transformed(*point, camera_from_side).z();
  }
  int landmark_of(const FeatureId& id) const {
    const KeyframeView& keyframe = place.keyframes[id.keyframe];
    const int landmark = keyframe.landmark_of_feature == nullptr ? -1 : keyframe.landmark_of_feature[id.feature];
    MAPWEAVE_EXPECT(landmark < static_cast<int>(place.landmarks.size()), "a feature names a landmark of its side");
    return landmark;
  }
  std::optional<Eigen::Vector3d> point_of(const FeatureId& id) const {
    const int landmark = landmark_of(id);
    return landmark < 0 ? std::nullopt
                        : std::optional(place.landmarks[static_cast<std::size_t>(landmark)].point_in_side);
  }
  // The landmark, or the feature where it has none: what must not be matched twice.
  std::int64_t key_of(const FeatureId& id) const {
    const int landmark = landmark_of(id);
    return landmark >= 0 ? landmark : -1 - ((static_cast<std::int64_t>(id.keyframe) << 32) + id.feature);
  }
};

// Pairs with the features that they are made of; each thing with each thing at most once.
class Pairs {
 public:
  Pairs(const Side& a, const Side& b, double sigma_px) : a_(a), b_(b), sigma_px_(sigma_px) {
    problem.freedom = a.place.metric && b.place.metric ? Freedom::rigid : Freedom::similarity;
    // A picture alone has no scale to differ by.
    if (a.place.landmarks.empty() || b.place.landmarks.empty()) problem.freedom = Freedom::rigid;
    for (const KeyframeView& keyframe : a.place.keyframes)
      problem.cameras_a.push_back({keyframe.camera, keyframe.side_from_camera});
    for (const KeyframeView& keyframe : b.place.keyframes)
      problem.cameras_b.push_back({keyframe.camera, keyframe.side_from_camera});
  }
  void add(const FeatureId& of_a, const FeatureId& of_b) {
    FeaturePair pair;
    pair.point_in_a = a_.point_of(of_a);
    pair.point_in_b = b_.point_of(of_b);
    if (!pair.point_in_a && !pair.point_in_b) return;
    if (!keys_.insert({a_.key_of(of_a), b_.key_of(of_b)}).second) return;
    pair.camera_a = of_a.keyframe;
    pair.camera_b = of_b.keyframe;
    std::tie(pair.pixel_a, pair.sigma_a_px) = seen(a_, of_a);
    std::tie(pair.pixel_b, pair.sigma_b_px) = seen(b_, of_b);
    problem.pairs.push_back(pair);
    matches.push_back({of_a, of_b});
  }

  AlignmentProblem problem;
  std::vector<VisualJudgement::Match> matches;

 private:
  std::pair<Vector2d, double> seen(const Side& side, const FeatureId& id) const {
    const KeyframeView& keyframe = side.place.keyframes[id.keyframe];
    const FeaturePoint& point = keyframe.features.points[id.feature];
    return {Vector2d(point.u_px, point.v_px), sigma_px_ * std::pow(keyframe.level_scale, point.level)};
  }
  const Side& a_;
  const Side& b_;
  double sigma_px_;
  std::set<std::pair<std::int64_t, std::int64_t>> keys_;
};

// An alignment with all that agrees with it.
struct Grown {
  AlignmentFit fit;
  std::vector<VisualJudgement::Match> matches;
  std::vector<FeaturePair> pairs;
  double found = 0.0, conflict = 0.0;
};

double share(double part, double whole) { return whole > 0.0 ? part / whole : 0.0; }

// Whether the two put b's landmarks at clearly different places, as seen from b.
bool distinct(const Sim3& one, const Sim3& other, const Grown& best) {
  constexpr double kFar = 0.1;  // of the distance
  int apart = 0, together = 0;
  for (const FeaturePair& pair : best.pairs) {
    const Eigen::Vector3d point = pair.point_in_a ? transformed(*pair.point_in_a, inverse(one)) : *pair.point_in_b;
    const Eigen::Vector3d moved = transformed(transformed(point, one), inverse(other));
    ((moved - point).norm() > kFar * point.norm() ? apart : together) += 1;
  }
  return apart > together;
}

// Landmarks share the errors of the keyframes they come from, so that the spread of many matches claims too much:
// never better than half a degree, and half a percent of the distance.
Alignment alignment_of(const Grown& grown) {
  constexpr double kTurn = 0.009, kShare = 0.005;  // radians; of the distance
  Alignment alignment;
  alignment.a_from_b = grown.fit.a_from_b;
  alignment.covariance = grown.fit.covariance.topLeftCorner<6, 6>();
  std::vector<double> distances;
  const Sim3 b_from_a = inverse(alignment.a_from_b);
  for (const FeaturePair& pair : grown.pairs)
    distances.push_back((pair.point_in_b ? *pair.point_in_b : transformed(*pair.point_in_a, b_from_a)).norm());
  alignment.covariance.diagonal().head<3>().array() += std::pow(kShare * median(std::move(distances)), 2);
  alignment.covariance.diagonal().tail<3>().array() += kTurn * kTurn;
  return alignment;
}

// How wide the matches lie over the picture, along the wider and the narrower direction; 1: as if spread evenly over
// all of it.
Eigen::Vector2d spread_over(const std::vector<Vector2d>& pixels, const Pinhole& camera) {
  if (pixels.size() < 2) return Vector2d::Zero();
  Vector2d mean = Vector2d::Zero();
  for (const Vector2d& pixel : pixels) mean += pixel / static_cast<double>(pixels.size());
  Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
  const Vector2d even(camera.width / std::sqrt(12.0), camera.height / std::sqrt(12.0));
  for (const Vector2d& pixel : pixels) {
    const Vector2d d = (pixel - mean).cwiseQuotient(even);
    spread += d * d.transpose() / static_cast<double>(pixels.size());
  }
  const Vector2d values = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spread).eigenvalues();
  return {std::min(1.0, std::sqrt(std::max(0.0, values(1)))), std::min(1.0, std::sqrt(std::max(0.0, values(0))))};
}

// Weights fitted by hand to pairs of real pictures with known poses: each unit of the sum is a factor e of the odds.
// What moves along with the camera (a car ahead) agrees well among itself, but little else that should be in view is
// found.
double probability_of(const Evidence& e, int inliers) {
  const double logit = 1.5 * std::log(std::max(1, inliers) / 40.0) + 12.0 * (e.inliers - 0.12) +
                       3.0 * (e.observability(1) - 0.25) - 3.0 * e.conflict -
                       4.0 * std::max(0.0, e.second_best_ratio - 0.3);
  return 1.0 / (1.0 + std::exp(-logit));
}

class Judge {
 public:
  Judge(const PlaceView& a, const PlaceView& b, const VisualJudgeOptions& options) : a_(a), b_(b), options_(options) {}

  VisualJudgement operator()() const {
    VisualJudgement result;
    Judgement& judgement = result.judgement;
    judgement.id = visual_judgement_id(a_.place.content, b_.place.content, options_);
    judgement.a = a_.place.id;
    judgement.b = b_.place.id;
    judgement.content_a = a_.place.content;
    judgement.content_b = b_.place.content;
    judgement.doubt = Reason::little_overlap;
    auto best = aligned(0);
    if ((!best || doubt_of(evidence_of(*best), static_cast<int>(best->matches.size())) != Reason::none) &&
        options_.neighbours > 0)
      if (auto wider = aligned(static_cast<std::uint32_t>(options_.neighbours))) best = std::move(wider);
    if (!best) return result;
    result.matches = best->matches;
    const auto inliers = static_cast<int>(best->matches.size());
    judgement.hypotheses.push_back(alignment_of(*best));
    judgement.scores.push_back(best->found);
    judgement.evidence = evidence_of(*best);
    judgement.doubt = doubt_of(judgement.evidence, inliers);
    if (judgement.doubt != Reason::none) {
      // Nobody asks for a rival of what is not believed.
    } else if (const auto rival = rival_of(*best)) {
      judgement.hypotheses.push_back(alignment_of(*rival));
      judgement.scores.push_back(rival->found);
      judgement.evidence.second_best_ratio =
          std::min(1.0, share(static_cast<double>(rival->matches.size()), static_cast<double>(best->matches.size())));
      judgement.doubt = doubt_of(judgement.evidence, inliers);
    }
    judgement.probability =
        probability_of(judgement.evidence, inliers) * (judgement.doubt == Reason::none ? 1.0 : kProbabilityOfDoubt);
    return result;
  }

 private:
  // By the features of the first keyframes, and of as many neighbours of each.
  std::optional<Grown> aligned(std::uint32_t neighbours) const {
    const Pairs candidates = candidates_by_descriptor(neighbours);
    const auto found = search_alignment(candidates.problem, options_.alignment);
    return found ? grown(*found, candidates) : std::nullopt;
  }

  Pairs candidates_by_descriptor(std::uint32_t neighbours) const {
    Pairs pairs(a_, b_, options_.sigma_px);
    const auto match = [&](std::uint32_t of_a, std::uint32_t of_b) {
      for (const FeatureMatch& found :
           match_features(a_.place.keyframes[of_a].features, b_.place.keyframes[of_b].features, options_.matching))
        pairs.add({of_a, found.a}, {of_b, found.b});
    };
    match(0, 0);
    for (std::uint32_t i = 1; i < a_.place.keyframes.size() && i <= neighbours; ++i) match(i, 0);
    for (std::uint32_t i = 1; i < b_.place.keyframes.size() && i <= neighbours; ++i) match(0, i);
    return pairs;
  }

  // Landmarks of one side in the first picture of the other, both ways, then least squares; twice, the second time
  // nearer.
  std::optional<Grown> grown(const AlignmentFit& start, const Pairs& candidates) const {
    AlignmentFit fit = start;
    std::optional<Grown> result;
    constexpr int kRounds = 2;  // the second one searches from the first one's pose
    for (int round = 0; round < kRounds; ++round) {
      const double radius = options_.guided_radius_px / (1 << round);
      const GuidedSearch in_b = guided(a_, b_, inverse(fit.a_from_b), radius),
                         in_a = guided(b_, a_, fit.a_from_b, radius);
      Pairs pairs(a_, b_, options_.sigma_px);
      for (const auto& found : in_b.found)
        if (a_.shown[found.landmark]) pairs.add(*a_.shown[found.landmark], {0, found.feature});
      const std::size_t of_a = pairs.matches.size();
      for (const auto& found : in_a.found)
        if (b_.shown[found.landmark]) pairs.add({0, found.feature}, *b_.shown[found.landmark]);
      if (round == 0)
        for (const std::uint32_t i : fit.inliers) pairs.add(candidates.matches[i].a, candidates.matches[i].b);
      const auto refined = refine_alignment(pairs.problem, fit.a_from_b, options_.alignment);
      if (!refined) return result;
      fit = *refined;
      result.emplace();
      result->fit = fit;
      double right_in_b = 0.0, right_in_a = 0.0;
      for (const std::uint32_t i : fit.inliers) {
        result->matches.push_back(pairs.matches[i]);
        result->pairs.push_back(pairs.problem.pairs[i]);
        const FeaturePair& pair = pairs.problem.pairs[i];
        right_in_b += i < of_a || (pair.point_in_a && pair.camera_b == 0);
        right_in_a += pair.point_in_b && pair.camera_a == 0;
      }
      const double found_in_b = share(right_in_b, in_b.expected), found_in_a = share(right_in_a, in_a.expected);
      result->found = std::min(1.0, in_b.expected == 0   ? found_in_a
                                    : in_a.expected == 0 ? found_in_b
                                                         : std::min(found_in_a, found_in_b));
      result->conflict = std::max(share(in_b.seen_through, in_b.seen_through + right_in_b),
                                  share(in_a.seen_through, in_a.seen_through + right_in_a));
    }
    return result;
  }

  GuidedSearch guided(const Side& from, const Side& to, const Sim3& to_from_from, double radius) const {
    const Pose3 camera_from_to = inverse(to.grid.keyframe().side_from_camera);
    Sim3 camera_from_side = to_from_from;
    camera_from_side.pose = compose(camera_from_to, to_from_from.pose);
    return search_landmarks(from.place.landmarks, camera_from_side, to.grid, to.depth, radius,
                            options_.guided_max_distance);
  }

  // The best alignment of what the best one does not explain: features may look like several landmarks, so each is
  // paired with the landmark that looks most like it elsewhere than where the best alignment has it.
  std::optional<Grown> rival_of(const Grown& best) const {
    const bool of_a = !a_.place.landmarks.empty();
    const Side& map = of_a ? a_ : b_;
    const Side& picture = of_a ? b_ : a_;
    const Sim3 picture_from_map = of_a ? inverse(best.fit.a_from_b) : best.fit.a_from_b;
    const KeyframeView& keyframe = picture.place.keyframes.front();
    const Pose3 camera_from_picture = inverse(keyframe.side_from_camera);
    std::vector<OrbDescriptor> descriptors;
    std::vector<Vector2d> expected;
    std::vector<std::uint32_t> number;
    const std::size_t step = 1 + map.place.landmarks.size() / kRivalLandmarks,
                      feature_step = 1 + keyframe.features.count / kRivalFeatures;
    for (std::uint32_t i = 0; i < map.place.landmarks.size(); i += static_cast<std::uint32_t>(step)) {
      if (!map.shown[i]) continue;
      const LandmarkView& landmark = map.place.landmarks[i];
      number.push_back(i);
      const Eigen::Vector3d point =
          transformed(transformed(landmark.point_in_side, picture_from_map), camera_from_picture);
      descriptors.push_back(landmark.descriptor);
      expected.push_back(point.z() > 0.0 ? keyframe.camera.project(point) : Vector2d::Constant(-1e6));
    }
    Pairs pairs(a_, b_, options_.sigma_px);
    std::vector<std::uint32_t> others;
    for (std::uint32_t f = 0; f < keyframe.features.count; f += static_cast<std::uint32_t>(feature_step)) {
      const Vector2d pixel(keyframe.features.points[f].u_px, keyframe.features.points[f].v_px);
      const double far = 4.0 * options_.guided_radius_px;
      others.clear();
      for (std::uint32_t i = 0; i < expected.size(); ++i)
        if ((expected[i] - pixel).squaredNorm() > far * far) others.push_back(i);
      const NearestDescriptors nearest =
          nearest_descriptors(keyframe.features.descriptors[f], descriptors.data(), others.data(), others.size());
      if (nearest.distance > options_.matching.max_distance) continue;
      const FeatureId of_map = *map.shown[number[others[nearest.first]]], of_picture{0, f};
      if (of_a)
        pairs.add(of_map, of_picture);
      else
        pairs.add(of_picture, of_map);
    }
    AlignmentOptions few = options_.alignment;
    few.iterations = std::min(few.iterations, kRivalIterations);
    const auto found = search_alignment(pairs.problem, few);
    if (!found) return std::nullopt;
    auto rival = grown(*found, pairs);
    if (!rival || !distinct(best.fit.a_from_b, rival->fit.a_from_b, best)) return std::nullopt;
    return rival;
  }

  Evidence evidence_of(const Grown& best) const {
    Evidence evidence;
    evidence.inliers = best.found;
    evidence.conflict = best.conflict;
    std::vector<Vector2d> in_a, in_b;
    std::set<std::pair<int, int>> cells;
    std::vector<double> gaps;
    int meeting = 0;
    constexpr double kMeeting = 0.1;        // of the distance: stereo measures far depths no better
    constexpr int kColumns = 8, kRows = 6;  // of the picture, as its sides are to each other
    const Pinhole& camera_a = a_.place.keyframes.front().camera;
    const Pinhole& camera_b = b_.place.keyframes.front().camera;
    for (const FeaturePair& pair : best.pairs) {
      if (pair.camera_a == 0) in_a.push_back(pair.pixel_a);
      if (pair.camera_b == 0) {
        in_b.push_back(pair.pixel_b);
        cells.insert({static_cast<int>(pair.pixel_b.x() * kColumns / camera_b.width),
                      static_cast<int>(pair.pixel_b.y() * kRows / camera_b.height)});
      }
      if (!pair.point_in_a || !pair.point_in_b) continue;
      const Eigen::Vector3d there = transformed(*pair.point_in_b, best.fit.a_from_b);
      gaps.push_back((there - *pair.point_in_a).norm());
      meeting += gaps.back() <
                 kMeeting * transformed(there, inverse(a_.place.keyframes[pair.camera_a].side_from_camera)).norm();
    }
    const Vector2d spread = spread_over(in_a, camera_a).cwiseMin(spread_over(in_b, camera_b));
    evidence.observability = {spread(0), spread(1), 1.0};
    evidence.overlap = std::min(1.0, static_cast<double>(cells.size()) / (kColumns * kRows));
    if (!gaps.empty()) {
      evidence.verifier_inliers = share(meeting, static_cast<double>(gaps.size()));
      evidence.verifier_disagreement_m = median(std::move(gaps));
    } else {
      evidence.verifier_inliers = 1.0;
    }
    return evidence;
  }

  Reason doubt_of(const Evidence& e, int inliers) const {
    if (inliers < options_.min_inliers) return Reason::little_overlap;
    if (e.inliers < options_.min_found || e.conflict > options_.max_conflict) return Reason::contradiction;
    constexpr double kLeastMeeting = 0.5;  // most of what both sides measured has to agree
    if (e.verifier_inliers < kLeastMeeting) return Reason::inconsistent;
    if (e.second_best_ratio > options_.max_second_best) return Reason::ambiguous;
    if (e.observability(1) < options_.min_spread) return Reason::unobservable;
    return Reason::none;
  }

  Side a_, b_;
  const VisualJudgeOptions& options_;
};

}  // namespace

Hash visual_judgement_id(const Hash& content_a, const Hash& content_b, const VisualJudgeOptions& options) {
  return Hasher().add("visual judge 2").add(content_a).add(content_b).add(to_yaml(options)).finish();
}

VisualJudgement judge_places(const PlaceView& a, const PlaceView& b, const VisualJudgeOptions& options) {
  MAPWEAVE_EXPECT(a.id < b.id, "a judgement names the lower place first");
  MAPWEAVE_EXPECT(!a.keyframes.empty() && !b.keyframes.empty(), "a place has a keyframe");
  for (const PlaceView* place : {&a, &b})
    for (const KeyframeView& keyframe : place->keyframes)
      MAPWEAVE_EXPECT(keyframe.camera.width > 0 && keyframe.camera.height > 0 && keyframe.camera.fx > 0.0 &&
                          keyframe.camera.fy > 0.0,
                      "a camera is calibrated");
  return Judge(a, b, options)();
}

}  // namespace mapweave::matching
