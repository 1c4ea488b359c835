#include <mapweave/evaluation/drift.h>

#include <algorithm>

namespace mapweave::evaluation {
namespace {

void add(LengthDrift& drift, double translation, double rotation) {
  drift.translation_percent += translation;
  drift.rotation_deg_per_m += rotation;
  ++drift.pieces;
}

void finish(LengthDrift& drift) {
  if (drift.pieces == 0) return;
  drift.translation_percent *= 100.0 / static_cast<double>(drift.pieces);
  drift.rotation_deg_per_m *= 180.0 / M_PI / static_cast<double>(drift.pieces);
}

}  // namespace

Drift drift(const std::vector<std::vector<PosePair>>& tracks) {
  constexpr std::size_t kStep = 10;
  constexpr double kUnit_m = 100.0;
  Drift result;
  for (std::size_t i = 0; i < result.by_length.size(); ++i)
    result.by_length[i].length_m = kUnit_m * static_cast<double>(i + 1);
  for (const auto& track : tracks) {
    std::vector<double> path_m(track.size(), 0.0);
    for (std::size_t i = 1; i < track.size(); ++i)
      path_m[i] = path_m[i - 1] + (track[i].reference.t - track[i - 1].reference.t).norm();
    for (std::size_t first = 0; first < track.size(); first += kStep)
      for (LengthDrift& length : result.by_length) {
        const auto last = std::upper_bound(path_m.begin() + static_cast<std::ptrdiff_t>(first), path_m.end(),
                                           path_m[first] + length.length_m);
        if (last == path_m.end()) break;
        const PosePair &from = track[first], &to = track[static_cast<std::size_t>(last - path_m.begin())];
        const Pose3 error = between(between(from.estimate, to.estimate), between(from.reference, to.reference));
        const double translation = error.t.norm() / length.length_m;
        const double rotation = error.q.angularDistance(Eigen::Quaterniond::Identity()) / length.length_m;
        add(length, translation, rotation);
        add(result.all, translation, rotation);
      }
  }
  for (LengthDrift& length : result.by_length) finish(length);
  finish(result.all);
  return result;
}

}  // namespace mapweave::evaluation
