#include <mapweave/evaluation/absolute_error.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::evaluation {
namespace {

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
      // path_m never falls: the best is the first at or past the goal, or the first of those as far along as the one
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

AlignedTracks aligned_tracks(const std::vector<Compared>& compared, const TrajectoryErrorOptions& options) {
  AlignedTracks result;
  std::vector<PosePair> all;
  for (const auto& [estimate, reference] : compared) {
    result.tracks.push_back(associated(estimate, reference, options.max_stamp_difference_s));
    if (result.tracks.back().empty())
      throw Error(ErrorCode::kBadInput,
                  "no pose of the estimate (" + std::to_string(estimate.size()) + " poses) is within " +
                      std::to_string(options.max_stamp_difference_s) + " s of one of the reference (" +
                      std::to_string(reference.size()) + " poses)",
                  {}, "give trajectories of the same log with stamps of the same clock");
    all.insert(all.end(), result.tracks.back().begin(), result.tracks.back().end());
  }
  result.reference_from_estimate = reference_from_estimate(all, options.align);
  for (auto& track : result.tracks)
    for (auto& pair : track) pair.estimate = transformed(pair.estimate, result.reference_from_estimate);
  return result;
}

TrajectoryError absolute_error(const AlignedTracks& together) {
  std::vector<double> translations_m, rotations_deg;
  for (const auto& track : together.tracks)
    for (const auto& pair : track) {
      translations_m.push_back((pair.estimate.t - pair.reference.t).norm());
      rotations_deg.push_back(angle_deg(pair.reference.q.conjugate() * pair.estimate.q));
    }
  const std::size_t pairs = translations_m.size();
  return {pairs, together.reference_from_estimate, statistics_of(std::move(translations_m)),
          statistics_of(std::move(rotations_deg))};
}

TrajectoryError relative_error(const AlignedTracks& together, const RelativeErrorOptions& relative) {
  const bool by_frames = relative.unit == DeltaUnit::frames;
  MAPWEAVE_EXPECT(
      relative.delta > 0.0 && (!by_frames || (relative.delta < 1e9 && relative.delta == std::floor(relative.delta))),
      "delta must be positive, and whole where it counts frames");
  std::vector<double> translations_m, rotations_deg;
  std::size_t matched = 0;
  for (const auto& track : together.tracks) {
    matched += track.size();
    for (const auto& [begin, end] :
         by_frames ? pieces_by_frames(track.size(), static_cast<std::size_t>(relative.delta), relative.all_pairs)
                   : pieces_by_path(track, relative)) {
      const Pose3 error = between(between(track[begin].reference, track[end].reference),
                                  between(track[begin].estimate, track[end].estimate));
      translations_m.push_back(error.t.norm());
      rotations_deg.push_back(angle_deg(error.q));
    }
  }
  if (translations_m.empty())
    throw Error(ErrorCode::kBadInput,
                "no piece of the trajectory (" + std::to_string(matched) + " matched poses) is " +
                    std::to_string(relative.delta) + (by_frames ? " frames" : " m") + " long",
                {}, "choose a smaller delta");
  const std::size_t pieces = translations_m.size();
  return {pieces, together.reference_from_estimate, statistics_of(std::move(translations_m)),
          statistics_of(std::move(rotations_deg))};
}

TrajectoryError absolute_error(const Trajectory& estimate, const Trajectory& reference,
                               const TrajectoryErrorOptions& options) {
  return absolute_error(aligned_tracks({{estimate, reference}}, options));
}

TrajectoryError relative_error(const Trajectory& estimate, const Trajectory& reference,
                               const TrajectoryErrorOptions& options, const RelativeErrorOptions& relative) {
  return relative_error(aligned_tracks({{estimate, reference}}, options), relative);
}

}  // namespace mapweave::evaluation
