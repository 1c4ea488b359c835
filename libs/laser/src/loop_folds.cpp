// Loops between places that look alike, as aisles of a warehouse do, fold the map: then the robot has driven through
// walls. Clear views at walls would say so, too, but outdoors, where a laser tilts, they speak against right loops.

#include "graph_loop_closer.h"

#include <mapweave/core/interrupt.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

namespace mapweave::laser {
namespace {

constexpr double kMoved_m = 2.0;          // by a cluster of loops, that may fold a map
constexpr double kPairMoved_m = 1.0;      // two submaps against each other: what they say is news
constexpr double kLeastOverlap_m2 = 6.0;  // as judge.min_overlap_m2: what less of a place says is left out
// Shares of the path in the other submap's walls, and of walls that the other saw through. Measured on clusters that
// move a map by 2 m or more: right ones reach 0.4 % of the path (cars and people that were there before), wrong ones of
// simulated warehouses begin at 2.5 %; of walls 5 % indoors, 25 % outdoors, against 24 %.
constexpr double kThroughWalls = 0.01, kSeenThrough = 0.1;
constexpr double kLeastThroughWalls_m = 1.0;              // of the path: a share of a short one says little
constexpr double kStride_m = 0.05, kLongestStep_m = 2.0;  // farther, the way between two nodes is not known

struct Path {
  double known_m = 0.0, in_walls_m = 0.0;
};

// What the walls of one submap say about the path of the other.
Path through(const matching::SubmapModel& walls, const Submap& driven, const Pose2& walls_from_driven) {
  constexpr double kInverse = 1.0 / matching::SubmapModel::kSightResolution;
  Path path;
  std::optional<Pose2> last;
  for (const auto& member : driven.submap_from_node) {
    const Pose2 here = compose(walls_from_driven, planar(member.second));
    const double step_m = last ? std::hypot(here.x - last->x, here.y - last->y) : 0.0;
    const int strides = step_m < kLongestStep_m ? static_cast<int>(std::ceil(step_m / kStride_m)) : 0;
    for (int k = 0; k < strides; ++k) {
      const double t = (k + 0.5) / strides, x = last->x + t * (here.x - last->x), y = last->y + t * (here.y - last->y);
      const auto sight =
          walls.sight().get(static_cast<int>(std::floor(x * kInverse)), static_cast<int>(std::floor(y * kInverse)));
      if (sight != matching::Sight::unknown) path.known_m += step_m / strides;
      if (sight == matching::Sight::wall) path.in_walls_m += step_m / strides;
    }
    last = here;
  }
  return path;
}

double moved_m(const Pose2& before, const Pose2& after) { return std::hypot(after.x - before.x, after.y - before.y); }

}  // namespace

std::vector<LaserLoopCloser::Cluster> LaserLoopCloser::clusters() const {
  std::vector<std::size_t> parent(loops_.size());
  std::iota(parent.begin(), parent.end(), std::size_t{0});
  const auto root = [&](std::size_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  const auto is_near = [](std::size_t i, std::size_t j) { return std::max(i, j) - std::min(i, j) <= kSupporting; };
  for (std::size_t i = 0; i < loops_.size(); ++i)
    for (std::size_t j = 0; j < i; ++j) {
      const Loop &one = loops_[i], &other = loops_[j];
      if (one.state != State::committed || other.state != State::committed) continue;
      if (is_near(one.a, other.a) && is_near(one.b, other.b))
        parent[std::max(root(i), root(j))] = std::min(root(i), root(j));
    }
  std::vector<Cluster> by_root(loops_.size());
  for (std::size_t i = 0; i < loops_.size(); ++i)
    if (loops_[i].state == State::committed) by_root[root(i)].push_back(i);
  std::vector<std::pair<std::size_t, Cluster>> ordered;
  for (Cluster& cluster : by_root) {
    if (cluster.empty()) continue;
    const auto first = std::min_element(cluster.begin(), cluster.end(),
                                        [&](std::size_t l, std::size_t r) { return loops_[l].b < loops_[r].b; });
    ordered.emplace_back(loops_[*first].b, std::move(cluster));
  }
  std::sort(ordered.begin(), ordered.end());
  std::vector<Cluster> result;
  for (auto& entry : ordered) result.push_back(std::move(entry.second));
  return result;
}

bool LaserLoopCloser::take_back_folds(const Map& map) {
  std::vector<graph::Edge> edges = steps();
  std::vector<Pose2> before{submaps_.empty() ? Pose2{} : submaps_.front().local_from_submap};
  for (const graph::Edge& step : edges) before.push_back(compose(before.back(), step.from_from_to));
  bool is_folded = false;
  for (const Cluster& cluster : clusters()) {
    const std::size_t held = edges.size();
    for (const std::size_t i : cluster) {
      edges.push_back(edge_of(loops_[i]));
      edges.back().doubtful = false;
    }
    std::vector<Pose2> after = graph::solve(before, edges, options_.solve).poses;
    double most_m = 0.0;
    std::size_t last = 0;
    for (const std::size_t i : cluster) {
      const std::size_t a = loops_[i].a, b = loops_[i].b;
      most_m = std::max(most_m, moved_m(between(before[a], before[b]), between(after[a], after[b])));
      last = std::max(last, b);
    }
    if (most_m >= kMoved_m && folds(before, after, last, map)) {
      for (const std::size_t i : cluster) loops_[i].state = State::folding;
      edges.resize(held);
      is_folded = true;
    } else {
      before = std::move(after);
    }
  }
  if (is_folded) {
    poses_ = std::move(before);
    solve();
  }
  return is_folded;
}

// Whether loops that move submaps from `before` to `after` lead the path up to submap `last` through walls.
bool LaserLoopCloser::folds(const std::vector<Pose2>& before, const std::vector<Pose2>& after, std::size_t last,
                            const Map& map) {
  const std::vector<Eigen::Vector2d> centres = centres_by(after);
  Path path;
  double seen_through_m2 = 0.0, seen_m2 = 0.0;
  for (std::size_t b = kSharing + 1; b <= last; ++b)
    for (std::size_t a = 0; a + kSharing < b; ++a) {
      const auto reach = [&](std::size_t i) {
        return std::min(matching::kLargestOverlapRadius_m, submaps_[i].radius_m);
      };
      if ((centres[a] - centres[b]).norm() > matching::kOverlapShare * static_cast<double>(reach(a) + reach(b)))
        continue;
      const Pose2 a_from_b = between(after[a], after[b]);
      if (moved_m(between(before[a], before[b]), a_from_b) < kPairMoved_m) continue;
      throw_if_interrupted();
      const auto model_a = view_of(a, map).model, model_b = view_of(b, map).model;
      const Evidence evidence = matching::weigh(*model_a, *model_b, a_from_b);
      if (evidence.overlap_m2 < kLeastOverlap_m2) continue;
      seen_m2 += evidence.overlap_m2;
      seen_through_m2 += evidence.conflict * evidence.overlap_m2;
      for (const Path& one : {through(*model_a, *map.submaps.find(submaps_[b].id), a_from_b),
                              through(*model_b, *map.submaps.find(submaps_[a].id), inverse(a_from_b))}) {
        path.known_m += one.known_m;
        path.in_walls_m += one.in_walls_m;
      }
    }
  return path.in_walls_m > std::max(kLeastThroughWalls_m, kThroughWalls * path.known_m) &&
         seen_through_m2 > kSeenThrough * seen_m2;
}

}  // namespace mapweave::laser
