#include <mapweave/evaluation/absolute_error.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::evaluation {
namespace {

struct AlignedPairs {
  std::vector<PosePair> pairs;
  Sim3 reference_from_estimate;
};

AlignedPairs aligned_pairs(const Trajectory& estimate, const Trajectory& reference,
                           const TrajectoryErrorOptions& options) {
  AlignedPairs result;
  result.pairs = associated(estimate, reference, options.max_stamp_difference_s);
  if (result.pairs.empty())
    throw Error(ErrorCode::kBadInput,
                "no pose of the estimate (" + std::to_string(estimate.size()) + " poses) is within " +
                    std::to_string(options.max_stamp_difference_s) + " s of one of the reference (" +
                    std::to_string(reference.size()) + " poses)",
                {}, "give trajectories of the same log with stamps of the same clock");
  result.reference_from_estimate = reference_from_estimate(result.pairs, options.align);
  for (auto& pair : result.pairs) pair.estimate = transformed(pair.estimate, result.reference_from_estimate);
  return result;
}

double angle_deg(const Eigen::Quaterniond& q) {
  return 2.0 * std::atan2(q.vec().norm(), std::abs(q.w())) * 180.0 / M_PI;
}

using Piece = std::pair<std::size_t, std::size_t>;

std::vector<Piece> pieces_by_frames(std::size_t count, std::size_t delta, bool all_pairs) {
  std::vector<Piece> pieces;
  for (std::size_t i = 0; delta < count && i < count - delta; i += all_pairs ? 1 : delta)
    pieces.emplace_back(i, i + delta);
  return pieces;
}

std::vector<Piece> pieces_by_path(const std::vector<PosePair>& pairs, const RelativeErrorOptions& options) {
  std::vector<double> steps_m(pairs.size(), 0.0), path_m(pairs.size(), 0.0);
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    steps_m[i] = (pairs[i].estimate.t - pairs[i - 1].estimate.t).norm();
    path_m[i] = path_m[i - 1] + steps_m[i];
  }
  std::vector<Piece> pieces;
  if (options.all_pairs) {
    for (std::size_t i = 0; i + 1 < pairs.size(); ++i) {
      const auto off_by = [&](std::size_t j) { return std::abs(path_m[j] - path_m[i] - options.delta); };
      // way_m never falls: the best is the first at or past the goal, or the first of those as far along as the one
      // before it.
      const auto rest = path_m.begin() + static_cast<std::ptrdiff_t>(i) + 1;
      auto best = std::lower_bound(rest, path_m.end(), path_m[i] + options.delta);
      if (best == path_m.end() || (best != rest && off_by(static_cast<std::size_t>(best - path_m.begin()) - 1) <=
                                                       off_by(static_cast<std::size_t>(best - path_m.begin()))))
        best = std::lower_bound(rest, best, *std::prev(best));
      const std::size_t j = static_cast<std::size_t>(best - path_m.begin());
      if (off_by(j) <= options.delta * options.relative_tolerance) pieces.emplace_back(i, j);
    }
    return pieces;
  }
  std::size_t begin = 0;
  double since_m = 0.0;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    since_m += steps_m[i];
    if (since_m < options.delta) continue;
    pieces.emplace_back(begin, i);
    begin = i;
    since_m = 0.0;
  }
  return pieces;
}

}  // namespace

TrajectoryError absolute_error(const Trajectory& estimate, const Trajectory& reference,
                               const TrajectoryErrorOptions& options) {
  const AlignedPairs together = aligned_pairs(estimate, reference, options);
  std::vector<double> translations_m, rotations_deg;
  for (const auto& pair : together.pairs) {
    translations_m.push_back((pair.estimate.t - pair.reference.t).norm());
    rotations_deg.push_back(angle_deg(pair.reference.q.conjugate() * pair.estimate.q));
  }
  return {together.pairs.size(), together.reference_from_estimate, statistics_of(std::move(translations_m)),
          statistics_of(std::move(rotations_deg))};
}

TrajectoryError relative_error(const Trajectory& estimate, const Trajectory& reference,
                               const TrajectoryErrorOptions& options, const RelativeErrorOptions& relative) {
  const bool by_frames = relative.unit == DeltaUnit::frames;
  MAPWEAVE_EXPECT(
      relative.delta > 0.0 && (!by_frames || (relative.delta < 1e9 && relative.delta == std::floor(relative.delta))),
      "delta must be positive, and whole where it counts frames");
  const AlignedPairs together = aligned_pairs(estimate, reference, options);
  const auto pieces =
      by_frames ? pieces_by_frames(together.pairs.size(), static_cast<std::size_t>(relative.delta), relative.all_pairs)
                : pieces_by_path(together.pairs, relative);
  if (pieces.empty())
    throw Error(ErrorCode::kBadInput,
                "no piece of the trajectory (" + std::to_string(together.pairs.size()) + " matched poses) is " +
                    std::to_string(relative.delta) + (by_frames ? " frames" : " m") + " long",
                {}, "choose a smaller delta");
  std::vector<double> translations_m, rotations_deg;
  for (const auto& [begin, end] : pieces) {
    const Pose3 reference_step = between(together.pairs[begin].reference, together.pairs[end].reference);
    const Pose3 estimate_step = between(together.pairs[begin].estimate, together.pairs[end].estimate);
    const Pose3 error = between(reference_step, estimate_step);
    translations_m.push_back(error.t.norm());
    rotations_deg.push_back(angle_deg(error.q));
  }
  return {pieces.size(), together.reference_from_estimate, statistics_of(std::move(translations_m)),
          statistics_of(std::move(rotations_deg))};
}

}  // namespace mapweave::evaluation
