#include "graph_loop_closer.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/maps/map_noise.h>

#include <Eigen/LU>
#include <algorithm>
#include <queue>

namespace mapweave::laser {
namespace {

// Submaps this near in the sequence share scans, or nearly: matching them says nothing new.
constexpr std::size_t kNeighbours = 2;
// Two submaps may show the same walls while their middles are nearer than this share of their radii together. What is
// seen at the end of a hall makes a circle large and is too little to match by: hence the bound on a radius.
constexpr double kOverlapping = 0.6;
constexpr float kLargestRadius_m = 12.0F;
// Of the uncertainty of where submaps lie: what is compared at all, and the wider window in which it is searched.
constexpr double kReachSigmas = 2.5, kWindowSigmas = 3.0;
constexpr double kLeastRadius_m = 0.6, kLeastYaw_rad = 0.05;  // of a window: a few cells, what matches are off
// Of a step between submaps, as a path: in place it costs as much as a metre, since headings drift on turns; a loop
// costs less than any step, and holds the heading better than a step does (a share of a step's variance).
constexpr double kStepPath_m = 1.0, kLoopPath_m = 0.5, kStepTurns = 1.0, kLoopTurns = 0.2;
// The drift from one submap to the next is half of that of a path that bends one way (maps/map_noise.h). A heading that
// errs by more and more along a straight path leads 1 / sqrt(3) = 0.58 of its last error aside; paths that bend and
// come back lead less far.
constexpr double kStepDrift = 0.5, kAside = 0.4;
constexpr double kMatch_m = 0.15, kMatch_rad = 0.02;  // that two submaps are off where no path is between them
// Two loops support each other up to so many submaps apart; farther, the chain between them drifts too much to tell.
// Each step of it may be off by a standard deviation: 0.07 m and 0.008 rad of 4 m (maps/map_noise.h).
constexpr std::size_t kSupporting = 6;
constexpr double kAgree_m = 0.15, kAgreePerStep_m = 0.08, kAgree_rad = 0.02, kAgreePerStep_rad = 0.01;
constexpr double kOutlier = 0.5;  // weight after graduated non-convexity, where weights are near 0 or near 1
// At the end: pairs whose walls overlap, and whose windows are hardly wider than what is believed without a second loop
// (three times that, and confirm_radius_m). The second round looks from where the loops of the first one put them.
constexpr double kFinishApart_m = 6.0, kFinishSigma_m = 0.7;
constexpr int kFinishRounds = 2;
// No loop is stiffer than 2 cm and 3 mrad: chosen as what the anchors of two submaps are known to at best.
constexpr double kLoopVariance_m2 = 4e-4, kLoopVariance_rad2 = 9e-6;

}  // namespace

LaserLoopCloser::LaserLoopCloser(const GraphMapperOptions& options)
    : options_(options), cache_(static_cast<std::size_t>(options.loops.cache_mb) << 20) {}

void LaserLoopCloser::add(const Submap& submap, const Map& map) {
  const auto model = cache_.get(submap, map.nodes);
  Kept kept{submap.id,
            submap.anchor(),
            planar(map.nodes.find(submap.anchor())->map_from_node),
            options_.judge.min_score,
            model->centre(),
            model->radius_m(),
            model->ring_keys()};
  kept.length_m = 0.0;
  const Pose2* last = nullptr;
  Pose2 storage;
  for (const auto& member : submap.submap_from_node) {
    const Pose2 here = planar(member.second);
    if (last != nullptr) kept.length_m += std::hypot(here.x - last->x, here.y - last->y);
    storage = here;
    last = &storage;
  }
  kept.length_m *= 0.5;  // the next starts half-way
  const std::size_t number = submaps_.size();
  poses_.push_back(number == 0
                       ? kept.local_from_submap
                       : compose(poses_.back(), between(submaps_.back().local_from_submap, kept.local_from_submap)));
  submaps_.push_back(std::move(kept));
  if (number < kNeighbours + 1) return;

  const auto uncertainty = uncertainty_from(number);
  const auto [x, y] = centre_of(number);
  std::vector<std::pair<double, std::size_t>> near, alike;
  for (std::size_t i = 0; i + kNeighbours < number; ++i) {
    const auto [ix, iy] = centre_of(i);
    const double distance = std::hypot(ix - x, iy - y);
    const double reach = std::min(kReachSigmas * uncertainty[i].position_m, options_.loops.max_radius_m);
    const double extent = kOverlapping * std::min(kLargestRadius_m, submaps_[i].radius_m) +
                          kOverlapping * std::min(kLargestRadius_m, submaps_[number].radius_m);
    if (distance > reach + extent) continue;
    near.emplace_back(distance, i);
    alike.emplace_back(matching::ring_distance(submaps_[i].keys, submaps_[number].keys), i);
  }
  std::sort(near.begin(), near.end());
  std::sort(alike.begin(), alike.end());
  std::vector<std::size_t> chosen;
  for (std::size_t i = 0; i < near.size() && i < static_cast<std::size_t>(options_.loops.nearest); ++i)
    chosen.push_back(near[i].second);
  for (std::size_t i = 0; i < alike.size() && i < static_cast<std::size_t>(options_.loops.alike); ++i)
    chosen.push_back(alike[i].second);
  std::sort(chosen.begin(), chosen.end());
  chosen.erase(std::unique(chosen.begin(), chosen.end()), chosen.end());
  bool found = false;
  for (const auto i : chosen) found = search(i, number, uncertainty[i], map) || found;
  if (!found) return;
  commit_agreeing();
  solve();
}

std::vector<LaserLoopCloser::Uncertainty> LaserLoopCloser::uncertainty_from(std::size_t from) const {
  // Dijkstra over the variance of the heading, which is what makes positions uncertain.
  const std::size_t count = submaps_.size();
  std::vector<double> cost(count, 1e300), length(count, 0.0), turns(count, 0.0);
  std::vector<std::vector<std::pair<std::size_t, double>>> paths(count);  // neighbour, path; a loop has none
  for (std::size_t i = 0; i + 1 < count; ++i) {
    paths[i].emplace_back(i + 1, submaps_[i].length_m + kStepPath_m);
    paths[i + 1].emplace_back(i, submaps_[i].length_m + kStepPath_m);
  }
  for (const auto& loop : loops_)
    if (loop.committed) {
      paths[loop.a].emplace_back(loop.b, kLoopPath_m);
      paths[loop.b].emplace_back(loop.a, kLoopPath_m);
    }
  std::priority_queue<std::pair<double, std::size_t>, std::vector<std::pair<double, std::size_t>>, std::greater<>> open;
  cost[from] = 0.0;
  open.emplace(0.0, from);
  while (!open.empty()) {
    const auto [value, here] = open.top();
    open.pop();
    if (value > cost[here]) continue;
    for (const auto& [next, path] : paths[here]) {
      if (value + path >= cost[next]) continue;
      cost[next] = value + path;
      length[next] = length[here] + path;
      turns[next] = turns[here] + (path > kLoopPath_m ? kStepTurns : kLoopTurns);
      open.emplace(cost[next], next);
    }
  }
  std::vector<Uncertainty> result(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double yaw = options_.loops.drift_yaw_per_submap_rad * std::sqrt(turns[i]);
    result[i] = {kMatch_m + options_.loops.drift_per_m * length[i] * kStepDrift + yaw * length[i] * kAside,
                 kMatch_rad + yaw};
  }
  return result;
}

bool LaserLoopCloser::search(std::size_t a, std::size_t b, const Uncertainty& uncertainty, const Map& map) {
  throw_if_interrupted();
  const auto view = [&](std::size_t i) {
    const Submap& submap = *map.submaps.find(submaps_[i].id);
    return matching::SubmapView{submap.id, submap.content, cache_.get(submap, map.nodes)};
  };
  matching::WideWindow window;
  window.a_from_b = between(poses_[a], poses_[b]);
  window.radius_m = std::clamp(kWindowSigmas * uncertainty.position_m, kLeastRadius_m, options_.loops.max_radius_m);
  window.yaw_rad = std::min(M_PI, kLeastYaw_rad + kWindowSigmas * uncertainty.yaw_rad);
  Judgement judgement = matching::judge(view(a), view(b), window, options_.judge);
  if (judgement.hypotheses.empty() || judgement.doubt != Reason::none ||
      judgement.probability < options_.loops.min_probability)
    return false;
  Loop loop;
  loop.a = a;
  loop.b = b;
  loop.a_from_b = planar(judgement.hypotheses.front().a_from_b.pose);
  loop.information = planar(judgement.hypotheses.front().covariance).inverse();
  loop.sure = window.radius_m <= options_.loops.confirm_radius_m;
  loop.judgement = std::move(judgement);
  loops_.push_back(std::move(loop));
  return true;
}

// A loop from a wide window is believed once a second one, of other submaps, says the same.
void LaserLoopCloser::commit_agreeing() {
  for (auto& loop : loops_) {
    if (loop.committed) continue;
    if (loop.sure) {
      loop.committed = true;
      continue;
    }
    for (const auto& other : loops_) {
      if (&other == &loop || (other.a == loop.a && other.b == loop.b)) continue;
      if (std::max(other.a, loop.a) - std::min(other.a, loop.a) > kSupporting ||
          std::max(other.b, loop.b) - std::min(other.b, loop.b) > kSupporting)
        continue;
      // Around the cycle: a -> b -> other.b -> other.a -> a. The chain along the robot's path is short, so it hardly
      // drifts.
      const Pose2 by_other = compose(compose(between(poses_[loop.a], poses_[other.a]), other.a_from_b),
                                     between(poses_[other.b], poses_[loop.b]));
      const Pose2 apart = between(loop.a_from_b, by_other);
      const auto steps = static_cast<double>(std::max(other.a, loop.a) - std::min(other.a, loop.a) +
                                             std::max(other.b, loop.b) - std::min(other.b, loop.b));
      if (std::hypot(apart.x, apart.y) < kAgree_m + kAgreePerStep_m * steps &&
          std::abs(apart.phi) < kAgree_rad + kAgreePerStep_rad * steps) {
        loop.committed = true;
        break;
      }
    }
  }
}

void LaserLoopCloser::solve() {
  std::vector<graph::Edge> edges;
  std::vector<std::size_t> of_loop;
  for (std::size_t i = 0; i + 1 < submaps_.size(); ++i)
    edges.push_back({static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(i + 1),
                     between(submaps_[i].local_from_submap, submaps_[i + 1].local_from_submap),
                     submap_step_information(submaps_[i].length_m, options_.loops.drift_per_m,
                                             options_.loops.drift_yaw_per_submap_rad),
                     false});
  for (std::size_t i = 0; i < loops_.size(); ++i) {
    if (!loops_[i].committed) continue;
    Eigen::Matrix3d information = (loops_[i].information.inverse() + submap_bend_covariance()).inverse();
    information = (0.5 * (information + information.transpose())).eval();
    edges.push_back({static_cast<std::uint32_t>(loops_[i].a), static_cast<std::uint32_t>(loops_[i].b),
                     loops_[i].a_from_b, information, true});
    of_loop.push_back(i);
  }
  if (of_loop.empty()) return;
  const auto solution = graph::solve(poses_, edges, options_.solve);
  poses_ = solution.poses;
  std::vector<bool> wrong(loops_.size(), false);
  for (std::size_t k = 0; k < of_loop.size(); ++k)
    wrong[of_loop[k]] = solution.weight[submaps_.size() - 1 + k] < kOutlier;
  std::vector<Loop> kept;
  for (std::size_t i = 0; i < loops_.size(); ++i)
    if (!wrong[i]) kept.push_back(std::move(loops_[i]));
  loops_ = std::move(kept);
}

std::pair<double, double> LaserLoopCloser::centre_of(std::size_t submap) const {
  const Pose2& p = poses_[submap];
  const auto& c = submaps_[submap].centre;
  return {p.x + std::cos(p.phi) * c.x - std::sin(p.phi) * c.y, p.y + std::sin(p.phi) * c.x + std::cos(p.phi) * c.y};
}

void LaserLoopCloser::finish(const Map& map) {
  for (int round = 0; round < kFinishRounds; ++round) {
    bool found = false;
    std::vector<Uncertainty> uncertainty;
    for (std::size_t b = kNeighbours + 1; b < submaps_.size(); ++b) {
      uncertainty = uncertainty_from(b);
      std::vector<std::pair<double, std::size_t>> near;
      for (std::size_t a = 0; a + kNeighbours < b; ++a) {
        if (std::any_of(loops_.begin(), loops_.end(), [&](const Loop& l) { return l.a == a && l.b == b; })) continue;
        const auto [ax, ay] = centre_of(a);
        const auto [bx, by] = centre_of(b);
        const double distance = std::hypot(ax - bx, ay - by);
        if (distance < kFinishApart_m && uncertainty[a].position_m < kFinishSigma_m) near.emplace_back(distance, a);
      }
      std::sort(near.begin(), near.end());
      if (near.size() > static_cast<std::size_t>(options_.loops.nearest))
        near.resize(static_cast<std::size_t>(options_.loops.nearest));
      for (const auto& candidate : near)
        found = search(candidate.second, b, uncertainty[candidate.second], map) || found;
    }
    commit_agreeing();
    solve();
    if (!found) break;
  }
  cache_.clear();
}

std::vector<Constraint> LaserLoopCloser::loops() const {
  std::vector<Constraint> result;
  for (const auto& loop : loops_) {
    if (!loop.committed) continue;
    const Eigen::Matrix3d floor = Eigen::Vector3d(kLoopVariance_m2, kLoopVariance_m2, kLoopVariance_rad2).asDiagonal();
    Eigen::Matrix3d information = (loop.information.inverse() + floor).inverse();
    Constraint constraint =
        planar_constraint({ConstraintKind::loop, submaps_[loop.a].anchor, submaps_[loop.b].anchor, 0}, loop.a_from_b,
                          0.5 * (information + information.transpose()));
    constraint.because = loop.judgement.id;
    result.push_back(std::move(constraint));
  }
  return result;
}

}  // namespace mapweave::laser
