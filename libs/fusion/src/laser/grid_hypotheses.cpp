// How two teams lie to each other that have map_server grids in them.

#include "laser_team.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::fusion {
namespace {

constexpr double kSurest = 0.99;                     // no pair of grids is surer than this
constexpr double kAlike_m = 2.0, kAlike_rad = 0.15;  // grids bend: within that, two say the same

struct GridsOfTeams {
  double probability;
  double support_m;
  std::size_t a, b;  // a < b
};

double middle_distance_m(const Pose2& one, const Pose2& other, const matching::Point2f& place) {
  const Pose2 here = compose(one, Pose2(place.x, place.y, 0.0)), there = compose(other, Pose2(place.x, place.y, 0.0));
  return std::hypot(here.x - there.x, here.y - there.y);
}

PairHypothesis grid_hypothesis(const GridVerification& counts) {
  PairHypothesis hypothesis;
  hypothesis.sense = Sense::grids;
  hypothesis.a_from_b = {spatial(counts.a_from_b.pose), counts.a_from_b.scale};
  hypothesis.matches = 1;
  const double p = std::clamp(counts.probability, 1e-9, 1.0 - 1e-9);
  hypothesis.log_odds = std::log(p / (1.0 - p));
  hypothesis.coinciding_m = counts.mean_fit_m();
  hypothesis.contradicted_m = counts.mean_conflict_m();
  hypothesis.support_m = counts.support_m;
  hypothesis.overlap = counts.overlap;
  hypothesis.contradictions = counts.conflicts;
  return hypothesis;
}

}  // namespace

// Of the maps' frames, where their submaps are nearest to each other.
Pose2 LaserMerger::a_from_b(const SolvedSubmaps& solved, std::size_t a, std::size_t b) const {
  std::tuple<double, std::size_t, std::size_t> nearest{1e300, 0, 0};
  for (std::size_t i = 0; i < maps_[a].submaps.size(); ++i)
    for (std::size_t j = 0; j < maps_[b].submaps.size(); ++j) {
      const Eigen::Vector2d apart = middle_of(maps_[a], i, solved.pose_of(graph_.number(a, i))) -
                                    middle_of(maps_[b], j, solved.pose_of(graph_.number(b, j)));
      nearest = std::min(nearest, {apart.norm(), i, j});
    }
  const auto team_from = [&](std::size_t map, std::size_t s) {
    return compose(solved.pose_of(graph_.number(map, s)), inverse(maps_[map].map_from_submap[s]));
  };
  return between(team_from(a, std::get<1>(nearest)), team_from(b, std::get<2>(nearest)));
}

// A further pair of grids under a hypothesis: its matches are added where it says the same. False where it contradicts.
bool LaserMerger::add_grid_pair(MergeHypothesis& hypothesis, std::size_t a, std::size_t b) const {
  const GridAlignments::Pair& pair = *grids_.pair(a, b);
  const Pose2 implied = a_from_b(hypothesis.solved, a, b);
  if (pair.is_sure) {
    const Pose2 own = grids_.a_from_b(a, b);
    const auto& middle = maps_[b].centres[maps_[b].centres.size() / 2];
    if (middle_distance_m(own, implied, middle) > kAlike_m || std::abs(wrap_angle(own.phi - implied.phi)) > kAlike_rad)
      return false;
    const auto matches = grids_.matches(a, b, maps_, graph_);
    hypothesis.matches.insert(hypothesis.matches.end(), matches.begin(), matches.end());
    return true;
  }
  return grids_.may_lie(a, b, implied);
}

std::vector<MergeHypothesis> LaserMerger::grid_hypotheses(const LaserTeam& x, const LaserTeam& z) const {
  std::vector<GridsOfTeams> known;
  for (const std::size_t one : x.maps)
    for (const std::size_t other : z.maps) {
      const auto [a, b] = std::minmax(one, other);
      const GridAlignments::Pair* pair = grids_.pair(a, b);
      if (pair == nullptr || pair->is_vetoed || refused_.count({a, b}) != 0) continue;
      known.push_back({pair->result.probability,
                       pair->result.hypotheses.empty() ? 0.0 : pair->result.hypotheses.front().support_m, a, b});
    }
  std::stable_sort(known.begin(), known.end(), [](const GridsOfTeams& l, const GridsOfTeams& r) {
    return std::make_pair(l.probability, l.support_m) > std::make_pair(r.probability, r.support_m);
  });
  std::vector<MergeHypothesis> result;
  if (known.empty() || !grids_.pair(known.front().a, known.front().b)->is_sure) return result;
  MergeHypothesis hypothesis;
  hypothesis.is_of_grids = true;
  const auto solve = [&] {
    std::vector<SubmapMatch> matches = x.matches;
    matches.insert(matches.end(), z.matches.begin(), z.matches.end());
    matches.insert(matches.end(), hypothesis.matches.begin(), hypothesis.matches.end());
    std::vector<std::size_t> members;
    std::set_union(x.maps.begin(), x.maps.end(), z.maps.begin(), z.maps.end(), std::back_inserter(members));
    hypothesis.solved = graph_.solve(members, matches);
  };
  const GridsOfTeams& best = known.front();
  hypothesis.matches = grids_.matches(best.a, best.b, maps_, graph_);
  const double p = std::min(kSurest, best.probability);
  hypothesis.log_odds = hypothesis.matches.empty() ? -kSurestLogOdds : std::log(p / (1.0 - p));
  solve();
  for (std::size_t i = 1; i < known.size(); ++i)
    if (!add_grid_pair(hypothesis, known[i].a, known[i].b)) hypothesis.log_odds = -kSurestLogOdds;
  if (known.size() > 1) solve();
  hypothesis.prior_log_odds = priors_.log_odds(hypothesis.solved, x.maps, z.maps);
  hypothesis.log_odds = std::max(-kSurestLogOdds, hypothesis.log_odds + hypothesis.prior_log_odds);
  hypothesis.walls.coinciding_m = best.support_m;
  result.push_back(std::move(hypothesis));
  return result;
}

// What is said of two grids, apart from whether they were merged.
void LaserMerger::describe_grids(std::size_t a, std::size_t b, Verdict& verdict) const {
  const GridAlignments::Pair& pair = *grids_.pair(a, b);
  verdict.proposer = kGridProposer;
  verdict.alignment = pair.result.alignment;
  verdict.probability = pair.result.probability;
  verdict.overlap = pair.result.evidence.overlap;
  verdict.conflict = pair.result.evidence.conflict;
  verdict.second_best = pair.result.evidence.second_best_ratio;
  verdict.detail = pair.result.note;
  // Found twice, they are one.
  const auto& middle = maps_[b].centres[maps_[b].centres.size() / 2];
  const double scale = grids_.scale(b);
  const matching::Point2f in_b{static_cast<float>(middle.x / scale), static_cast<float>(middle.y / scale)};
  const auto lie_together = [&](const matching::PlanarSimilarity& one, const matching::PlanarSimilarity& other) {
    const auto here = matching::transformed(one, in_b), there = matching::transformed(other, in_b);
    return std::hypot(here.x - there.x, here.y - there.y) < kAlike_m &&
           std::abs(wrap_angle(one.pose.phi - other.pose.phi)) < kAlike_rad;
  };
  std::vector<const GridVerification*> reported;
  for (const GridVerification& counts : pair.result.hypotheses) {
    if (reported.size() == kMostPairHypotheses) break;
    if (std::none_of(reported.begin(), reported.end(),
                     [&](const GridVerification* other) { return lie_together(counts.a_from_b, other->a_from_b); }))
      reported.push_back(&counts);
  }
  verdict.hypotheses.clear();
  for (const GridVerification* counts : reported) verdict.hypotheses.push_back(grid_hypothesis(*counts));
}

}  // namespace mapweave::fusion
