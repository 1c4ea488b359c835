#include "visits.h"

#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr double kStretch_m = 40.0;  // of path: drifts less than a ghost is wide, and is little to lay elsewhere

}  // namespace

std::vector<std::vector<PlacedSubmap>> visits_of(const std::vector<PlacedSubmap>& path) {
  std::vector<std::vector<PlacedSubmap>> visits;
  double length_m = kStretch_m;
  for (std::size_t i = 0; i < path.size(); ++i) {
    if (i > 0) {
      const Pose2 step = between(path[i - 1].team_from_submap, path[i].team_from_submap);
      length_m += std::hypot(step.x, step.y);
    }
    if (length_m >= kStretch_m) {
      visits.emplace_back();
      length_m = 0.0;
    }
    visits.back().push_back(path[i]);
  }
  return visits;
}

}  // namespace mapweave::fusion
