#include <mapweave/matching/rigid_from_points.h>
#include <mapweave/rig/aligned_trajectories.h>

namespace mapweave::rig {

using Eigen::Vector3d;

std::optional<double> scale_of_trajectories(const std::vector<CommonPose>& pairs) {
  constexpr double kLeastLength_m = 0.5, kStep_m = 0.1;  // shorter steps are noise
  double in_a = 0.0, in_b = 0.0;
  for (std::size_t i = 1, last = 0; i < pairs.size(); ++i) {
    const double step = (pairs[i].in_a.t - pairs[last].in_a.t).norm();
    if (step < kStep_m) continue;
    in_a += step;
    in_b += (pairs[i].in_b.t - pairs[last].in_b.t).norm();
    last = i;
  }
  if (in_a < kLeastLength_m || !(in_b > 0.0)) return std::nullopt;
  return in_a / in_b;
}

Sim3 aligned(const std::vector<CommonPose>& pairs, double scale) {
  // Each pose counts with the tips of its axes.
  std::vector<matching::PointPair> points;
  for (const CommonPose& pair : pairs)
    for (const Vector3d& tip : {Vector3d(0, 0, 0), Vector3d(1, 0, 0), Vector3d(0, 1, 0), Vector3d(0, 0, 1)})
      points.push_back({transformed(tip, pair.in_a), scale * pair.in_b.t + pair.in_b.q * tip, 1.0});
  const auto rigid = matching::align_points(points, matching::Freedom::rigid);
  return {rigid ? rigid->pose
                : compose(pairs.front().in_a, inverse(Pose3{scale * pairs.front().in_b.t, pairs.front().in_b.q})),
          scale};
}

}  // namespace mapweave::rig
