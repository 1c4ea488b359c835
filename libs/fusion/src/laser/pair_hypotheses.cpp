// What is reported of a pair of maps beside the decision: the hypotheses there were, and what became of a prior.

#include "laser_team.h"

#include "grid/grid_conflicts.h"

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

// Hypotheses that a reader would not tell apart: the first of them is shown.
constexpr double kAlike_m = 0.5, kAlike_rad = 0.1;

Pose2 map_frame(const PreparedMap& map, const SubmapGraph& graph, std::size_t number, const SolvedSubmaps& solved) {
  return compose(solved.pose_of(graph.number(number, 0)), inverse(map.map_from_submap.front()));
}

// A place of the solved frame in a map's own one, by the submap that lies nearest.
Pose2 in_map(const PreparedMap& map, const SubmapGraph& graph, std::size_t number, const SolvedSubmaps& solved,
             double x_m, double y_m) {
  double nearest = 1e300;
  Pose2 result;
  for (std::size_t s = 0; s < map.submaps.size(); ++s) {
    const Pose2& pose = solved.pose_of(graph.number(number, s));
    const Eigen::Vector2d middle = middle_of(map, s, pose);
    const double distance = std::hypot(middle.x() - x_m, middle.y() - y_m);
    if (distance >= nearest) continue;
    nearest = distance;
    result = compose(compose(map.map_from_submap[s], inverse(pose)), Pose2{x_m, y_m, 0.0});
  }
  return result;
}

bool lie_together(const Sim3& one, const Sim3& other) {
  const Pose2 apart = between(planar(one.pose), planar(other.pose));
  return std::hypot(apart.x, apart.y) < kAlike_m && std::abs(apart.phi) < kAlike_rad;
}

}  // namespace

PairHypothesis LaserMerger::hypothesis_of(std::size_t a, std::size_t b, const SolvedSubmaps& solved,
                                          const WallAgreement& walls) const {
  PairHypothesis hypothesis;
  // Of the maps as they were given: grids may have another scale here.
  const double scale_a = grids_.scale(a);
  Pose2 a_from_b = between(map_frame(maps_[a], graph_, a, solved), map_frame(maps_[b], graph_, b, solved));
  a_from_b = {a_from_b.x / scale_a, a_from_b.y / scale_a, a_from_b.phi};
  hypothesis.a_from_b = {spatial(a_from_b), grids_.scale(b) / scale_a};
  hypothesis.coinciding_m = walls.coinciding_m;
  hypothesis.contradicted_m = walls.contradicted_m;
  hypothesis.unclear_m = walls.unclear_m;
  hypothesis.wider_m = walls.wider_m;
  const WeighedWalls weights = weighed(walls);
  hypothesis.distinctive_m = weights.unique_m;
  hypothesis.counted_unclear_m = weights.unclear_m;
  hypothesis.by_chance_m = weights.by_chance_m;
  hypothesis.overlap = walls.overlap;
  for (const Contradiction& place : walls.contradictions) {
    if (hypothesis.contradictions.size() == kMostPlaces) break;
    const Pose2 there = in_map(maps_[a], graph_, a, solved, place.x_m, place.y_m);
    hypothesis.contradictions.push_back({there.x / scale_a, there.y / scale_a, place.length_m});
  }
  return hypothesis;
}

std::vector<PairHypothesis> LaserMerger::hypotheses_of(std::size_t a, std::size_t b,
                                                       const WallAgreement* accepted) const {
  std::vector<PairHypothesis> result;
  const auto add = [&](PairHypothesis hypothesis, double log_odds, double prior, std::size_t matches) {
    if (std::any_of(result.begin(), result.end(),
                    [&](const PairHypothesis& h) { return lie_together(h.a_from_b, hypothesis.a_from_b); }))
      return;
    hypothesis.log_odds = log_odds;
    hypothesis.prior_log_odds = prior;
    hypothesis.matches = static_cast<std::uint32_t>(matches);
    result.push_back(std::move(hypothesis));
  };
  const LaserTeam *of_a = team_of(a), *of_b = team_of(b);
  if (of_a == nullptr || of_b == nullptr) return result;
  if (accepted != nullptr) {
    const double prior = priors_.log_odds(of_a->solved, {a}, {b});
    add(hypothesis_of(a, b, of_a->solved, *accepted), log_odds_of(*accepted) + prior, prior,
        matches_between(*of_a, a, b));
  }
  if (const auto taken = taken_back_.find({a, b}); taken != taken_back_.end() && accepted == nullptr)
    result.push_back(taken->second);
  // As their teams were compared at last, then as they were by themselves.
  const std::vector<std::size_t> only_a{a}, only_b{b};
  for (const auto& [one, other] :
       {std::tie(of_a->maps, of_b->maps), std::tie(of_b->maps, of_a->maps), std::tie(only_a, only_b)}) {
    const auto evaluation = evaluations_.find({one, other});
    if (evaluation == evaluations_.end()) continue;
    for (const MergeHypothesis& hypothesis : evaluation->second.hypotheses)
      if (!hypothesis.matches.empty()) {
        PairHypothesis of_teams = hypothesis_of(a, b, hypothesis.solved, hypothesis.walls);
        of_teams.is_of_teams = one.size() + other.size() > 2;
        add(std::move(of_teams), hypothesis.log_odds, hypothesis.prior_log_odds, hypothesis.matches.size());
      }
  }
  if (result.size() > kMostPairHypotheses) result.resize(kMostPairHypotheses);
  return result;
}

// By which two maps came into one team.
std::optional<TeamMerge> LaserMerger::merge_of(std::size_t a, std::size_t b) const {
  const auto has = [](const std::vector<std::size_t>& maps, std::size_t map) {
    return std::binary_search(maps.begin(), maps.end(), map);
  };
  const LaserTeam* team = team_of(a);
  if (team == nullptr || team != team_of(b)) return std::nullopt;
  const auto ids = [&](const std::vector<std::size_t>& maps) {
    std::vector<MapId> result;
    for (const std::size_t map : maps) result.push_back(maps_[map].map->id);
    return result;
  };
  for (const TeamsMerged& merge : merges_) {
    if ((has(merge.one, a) && has(merge.other, b)) || (has(merge.one, b) && has(merge.other, a))) {
      const bool is_in_order = merge.one.front() < merge.other.front();
      return TeamMerge{ids(is_in_order ? merge.one : merge.other), ids(is_in_order ? merge.other : merge.one),
                       merge.probability, merge.proposer};
    }
  }
  return std::nullopt;
}

std::size_t LaserMerger::matches_between(const LaserTeam& team, std::size_t a, std::size_t b) const {
  return static_cast<std::size_t>(
      std::count_if(team.matches.begin(), team.matches.end(), [&](const SubmapMatch& match) {
        return std::minmax(graph_.map_of(match.from), graph_.map_of(match.to)) == std::minmax(a, b);
      }));
}

void LaserMerger::remember_taken_back(const LaserTeam& team, const TeamAudit& audit, std::size_t who) {
  for (const AuditedPair& pair : audit.pairs) {
    const std::size_t a = team.maps[pair.a], b = team.maps[pair.b];
    const std::size_t matches = matches_between(team, a, b);
    if ((a != who && b != who) || matches == 0) continue;
    WallAgreement walls;
    walls.coinciding_m = pair.coinciding_m;
    walls.contradicted_m = pair.contradicted_m;
    walls.unclear_m = pair.unclear_m;
    walls.contradictions = pair.contradictions;
    PairHypothesis& hypothesis = taken_back_[{a, b}] = hypothesis_of(a, b, team.solved, walls);
    hypothesis.log_odds = log_odds_of(walls);
    hypothesis.is_taken_apart = true;
    hypothesis.by_chance_m = hypothesis.distinctive_m = 0.0;  // not weighed by the audit
    hypothesis.matches = static_cast<std::uint32_t>(matches);
  }
}

std::optional<PriorCheck> LaserMerger::check_of_prior(std::size_t a, std::size_t b,
                                                      const std::optional<Pose2>& a_from_b) const {
  return priors_.check(a, b, a_from_b, [&](const Pose2& there) {
    const auto in_a = placed({a}, [&](std::size_t map, std::size_t s) { return maps_[map].map_from_submap[s]; });
    const auto in_b =
        placed({b}, [&](std::size_t map, std::size_t s) { return compose(there, maps_[map].map_from_submap[s]); });
    return wall_agreement(in_a, maps_[a].walls_m, in_b, maps_[b].walls_m, sight_of({&in_a, &in_b}));
  });
}

}  // namespace mapweave::fusion
