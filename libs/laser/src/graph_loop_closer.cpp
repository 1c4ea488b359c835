#include "graph_loop_closer.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/maps/map_noise.h>

#include <Eigen/LU>
#include <algorithm>
#include <queue>

namespace mapweave::laser {
namespace {

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
// Where two loops support each other, each step between them may be off by a standard deviation: 0.07 m and 0.008 rad
// of 4 m (maps/map_noise.h).
constexpr double kAgree_m = 0.15, kAgreePerStep_m = 0.08, kAgree_rad = 0.02, kAgreePerStep_rad = 0.01;
constexpr double kOutlier = 0.5;  // weight after graduated non-convexity, where weights are near 0 or near 1
// At the end: pairs whose walls overlap, and whose windows are hardly wider than what is believed without a second loop
// (three times that, and confirm_radius_m). The second round looks from where the loops of the first one put them.
constexpr double kFinishApart_m = 6.0, kFinishSigma_m = 0.7;
constexpr int kFinishRounds = 2;
constexpr double kFarBefore_m = 4.0;  // and more than kFinishApart_m: far from each other before
constexpr int kFoldRounds = 3;

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
  if (number < kSharing + 1) return;

  const auto uncertainty = uncertainty_from(number);
  const std::vector<Eigen::Vector2d> centres = centres_by(poses_);
  std::vector<std::pair<double, std::size_t>> near, alike;
  for (std::size_t i = 0; i + kSharing < number; ++i) {
    const double distance = (centres[i] - centres[number]).norm();
    const double reach = std::min(kReachSigmas * uncertainty[i].position_m, options_.loops.max_radius_m);
    const double extent =
        matching::kOverlapShare * std::min(matching::kLargestOverlapRadius_m, submaps_[i].radius_m) +
        matching::kOverlapShare * std::min(matching::kLargestOverlapRadius_m, submaps_[number].radius_m);
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
  for (const auto i : chosen) found = search(i, number, uncertainty[i], map) == Found::loop || found;
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
    if (loop.state == State::committed) {
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

bool LaserLoopCloser::is_known(std::size_t a, std::size_t b) const {
  return std::any_of(loops_.begin(), loops_.end(), [&](const Loop& loop) { return loop.a == a && loop.b == b; });
}

matching::SubmapView LaserLoopCloser::view_of(std::size_t number, const Map& map) {
  const Submap& submap = *map.submaps.find(submaps_[number].id);
  return {submap.id, submap.content, cache_.get(submap, map.nodes)};
}

LaserLoopCloser::Found LaserLoopCloser::search(std::size_t a, std::size_t b, const Uncertainty& uncertainty,
                                               const Map& map) {
  matching::WideWindow window;
  window.a_from_b = between(poses_[a], poses_[b]);
  window.radius_m = std::clamp(kWindowSigmas * uncertainty.position_m, kLeastRadius_m, options_.loops.max_radius_m);
  window.yaw_rad = std::min(M_PI, kLeastYaw_rad + kWindowSigmas * uncertainty.yaw_rad);
  return search(a, b, window, map);
}

Judgement LaserLoopCloser::judged(std::size_t a, std::size_t b, const matching::WideWindow& window,
                                  const matching::JudgeOptions& options, const Map& map) {
  throw_if_interrupted();
  return matching::judge(view_of(a, map), view_of(b, map), window, options);
}

bool LaserLoopCloser::is_believed(const Judgement& judgement) const {
  return !judgement.hypotheses.empty() && judgement.doubt == Reason::none &&
         judgement.probability >= options_.loops.min_probability;
}

LaserLoopCloser::Loop LaserLoopCloser::loop_of(std::size_t a, std::size_t b, Judgement judgement) {
  Loop loop;
  loop.a = a;
  loop.b = b;
  loop.a_from_b = planar(judgement.hypotheses.front().a_from_b.pose);
  loop.information = planar(judgement.hypotheses.front().covariance).inverse();
  loop.judgement = std::move(judgement);
  return loop;
}

LaserLoopCloser::Found LaserLoopCloser::search(std::size_t a, std::size_t b, const matching::WideWindow& window,
                                               const Map& map) {
  Judgement judgement = judged(a, b, window, options_.judge, map);
  if (contradicts(judgement)) return Found::contradiction;
  if (!is_believed(judgement)) return Found::nothing;
  Loop loop = loop_of(a, b, std::move(judgement));
  loop.sure = window.radius_m <= options_.loops.confirm_radius_m;
  loops_.push_back(std::move(loop));
  return Found::loop;
}

// Whether two loops between the same two stretches of the path say the same. The path along each is short, so that it
// hardly drifts.
bool LaserLoopCloser::agree(const Loop& one, const Loop& other) const {
  const std::size_t steps_a = std::max(one.a, other.a) - std::min(one.a, other.a);
  const std::size_t steps_b = std::max(one.b, other.b) - std::min(one.b, other.b);
  if (steps_a > kSupporting || steps_b > kSupporting || steps_a + steps_b == 0) return false;
  const Pose2 by_other = compose(compose(between(poses_[one.a], poses_[other.a]), other.a_from_b),
                                 between(poses_[other.b], poses_[one.b]));
  const Pose2 apart = between(one.a_from_b, by_other);
  const auto steps = static_cast<double>(steps_a + steps_b);
  return std::hypot(apart.x, apart.y) < kAgree_m + kAgreePerStep_m * steps &&
         std::abs(apart.phi) < kAgree_rad + kAgreePerStep_rad * steps;
}

// A loop from a wide window is believed once a second one, of other submaps, says the same.
void LaserLoopCloser::commit_agreeing() {
  for (auto& loop : loops_)
    if (loop.state == State::open && (loop.sure || std::any_of(loops_.begin(), loops_.end(), [&](const Loop& other) {
                                        return other.state != State::folding && agree(loop, other);
                                      })))
      loop.state = State::committed;
}

std::vector<graph::Edge> LaserLoopCloser::steps() const {
  std::vector<graph::Edge> edges;
  for (std::size_t i = 0; i + 1 < submaps_.size(); ++i)
    edges.push_back({static_cast<std::uint32_t>(i), static_cast<std::uint32_t>(i + 1),
                     between(submaps_[i].local_from_submap, submaps_[i + 1].local_from_submap),
                     submap_step_information(submaps_[i].length_m, options_.loops.drift_per_m,
                                             options_.loops.drift_yaw_per_submap_rad),
                     false});
  return edges;
}

graph::Edge LaserLoopCloser::edge_of(const Loop& loop) const {
  const Eigen::Matrix3d information = (loop.information.inverse() + submap_bend_covariance()).inverse();
  return {static_cast<std::uint32_t>(loop.a), static_cast<std::uint32_t>(loop.b), loop.a_from_b,
          0.5 * (information + information.transpose()), true};
}

void LaserLoopCloser::solve() {
  std::vector<graph::Edge> edges = steps();
  std::vector<std::size_t> of_loop;
  for (std::size_t i = 0; i < loops_.size(); ++i) {
    if (loops_[i].state != State::committed) continue;
    edges.push_back(edge_of(loops_[i]));
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

std::vector<Eigen::Vector2d> LaserLoopCloser::centres_by(const std::vector<Pose2>& poses) const {
  std::vector<Eigen::Vector2d> centres;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const auto& centre = submaps_[i].centre;
    const Pose2 placed = compose(poses[i], Pose2{centre.x, centre.y, 0.0});
    centres.emplace_back(placed.x, placed.y);
  }
  return centres;
}

void LaserLoopCloser::finish(const Map& map) {
  look_near(map, poses_);
  for (int round = 0; round < kFoldRounds && take_back_folds(map); ++round) look_near(map, poses_);
  close_unexpected(map);
  cache_.clear();
}

int LaserLoopCloser::look_near(const Map& map, const std::vector<Pose2>& before, const Pairs& counted) {
  const std::vector<Eigen::Vector2d> centres_before = centres_by(before);
  int balance = 0;
  for (int round = 0; round < kFinishRounds; ++round) {
    bool found = false;
    const std::vector<Eigen::Vector2d> centres = centres_by(poses_);
    for (std::size_t b = kSharing + 1; b < submaps_.size(); ++b) {
      const std::vector<Uncertainty> uncertainty = uncertainty_from(b);
      std::vector<std::pair<double, std::size_t>> near;
      for (std::size_t a = 0; a + kSharing < b; ++a) {
        const double distance = (centres[a] - centres[b]).norm();
        if (distance < kFinishApart_m && uncertainty[a].position_m < kFinishSigma_m && !is_known(a, b))
          near.emplace_back(distance, a);
      }
      std::sort(near.begin(), near.end());
      if (near.size() > static_cast<std::size_t>(options_.loops.nearest))
        near.resize(static_cast<std::size_t>(options_.loops.nearest));
      for (const auto& candidate : near) {
        const std::size_t a = candidate.second;
        const Found here = search(a, b, uncertainty[a], map);
        found = here == Found::loop || found;
        if ((centres_before[a] - centres_before[b]).norm() < kFinishApart_m + kFarBefore_m || counted.count({a, b}) > 0)
          continue;
        balance += here == Found::loop ? 1 : here == Found::contradiction ? -1 : 0;
      }
    }
    commit_agreeing();
    solve();
    if (!found) break;
  }
  return balance;
}

std::size_t LaserLoopCloser::folding_loops() const {
  return static_cast<std::size_t>(
      std::count_if(loops_.begin(), loops_.end(), [](const Loop& loop) { return loop.state == State::folding; }));
}

std::vector<Constraint> LaserLoopCloser::loops() const {
  std::vector<Constraint> result;
  for (const auto& loop : loops_) {
    if (loop.state != State::committed) continue;
    Eigen::Matrix3d information = (loop.information.inverse() + own_anchors_covariance()).inverse();
    Constraint constraint =
        planar_constraint({ConstraintKind::loop, submaps_[loop.a].anchor, submaps_[loop.b].anchor, 0}, loop.a_from_b,
                          0.5 * (information + information.transpose()));
    constraint.because = loop.judgement.id;
    result.push_back(std::move(constraint));
  }
  return result;
}

}  // namespace mapweave::laser
