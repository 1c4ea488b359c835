// How likely it is that two teams lie as their matches say: hypotheses, each grown and judged by whole maps, weighed
// against each other and against other places of the same maps.

#include "laser_team.h"

#include "decision/commitment.h"
#include "room_widths.h"
#include "self_repetition.h"
#include "sorted_numbers.h"

#include <mapweave/maps/map_noise.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr std::size_t kMostHypotheses = 4;  // evaluated for two groups of maps
constexpr double kLeastSeed = 1.0;          // log odds of the matches that a hypothesis begins with
constexpr double kLeastWeight = 0.05;  // log odds of a match: an unlikely one still counts for those it agrees with
constexpr double kUnobservableShare = 0.3;   // of the log odds of a match that slides along its walls
constexpr std::size_t kSearchSteps = 20000;  // for each set of matches
// Walls are compared where the graph knows to this how the two lie to each other.
constexpr double kCompared_m = 20.0, kCompared_sigma_m = 0.4;
constexpr int kMostRounds = 12;              // of a search: bounds the time; most end before, as nothing new is found
constexpr int kMostMendings = 2;             // of a hypothesis, which may be wrong; a team has six (DECISIONS.md, 68)
constexpr std::size_t kFewestToMend = 3;     // matches
constexpr double kAsGoodAFit = 0.9;          // of the best one's wall on wall: less is what another place has by chance
constexpr double kPriorDistinguishes = 2.0;  // log odds of a prior: it tells places apart that look alike

}  // namespace

Hash hash_of(std::initializer_list<const std::vector<SubmapMatch>*> matches) {
  Hasher hasher;
  for (const std::vector<SubmapMatch>* some : matches) {
    hasher.add(static_cast<std::int64_t>(some->size()));
    for (const SubmapMatch& match : *some) {
      const Pose2& pose = match.from_from_to;
      hasher.add(match.judgement).add(pose.x).add(pose.y).add(pose.phi);
    }
  }
  return hasher.finish();
}

std::vector<const SubmapAnswer*> LaserMerger::answers_between(const LaserTeam& x, const LaserTeam& z) const {
  std::vector<MapPair> pairs;
  for (const std::size_t a : x.maps)
    for (const std::size_t b : z.maps) pairs.push_back(std::minmax(a, b));
  std::sort(pairs.begin(), pairs.end());
  std::vector<const SubmapAnswer*> result;
  for (const MapPair& pair : pairs) {
    const auto state = pairs_.find(pair);
    if (state == pairs_.end()) continue;
    for (const SubmapAnswer& answer : state->second.answers) result.push_back(&answer);
  }
  return result;
}

// Sets of matches that agree with each other, the heaviest first; what contradicts a set begins another.
std::vector<MergeHypothesis> LaserMerger::seeds(const LaserTeam& x, const LaserTeam& z) const {
  struct Entry {
    SubmapMatch match;  // from x to z
    const SubmapAnswer* answer;
  };
  std::vector<Entry> entries;
  for (const SubmapAnswer* answer : answers_between(x, z))
    for (const SubmapMatch& match : answer->hypotheses)
      entries.push_back({contains(x.maps, graph_.map_of(match.from)) ? match : turned(match), answer});
  std::vector<MergeHypothesis> result;
  if (entries.empty()) return result;
  graph::RelativeCovariance in_x = x.solved.covariance(), in_z = z.solved.covariance();
  const std::size_t count = entries.size();
  std::vector<char> agree(count * count, false);
  for (std::size_t i = 0; i < count; ++i)
    for (std::size_t j = i + 1; j < count; ++j)
      if (entries[i].answer != entries[j].answer)
        agree[i * count + j] = agree[j * count + i] =
            inconsistency(entries[i].match, entries[j].match, x.solved, in_x, z.solved, in_z) < kConsistent;
  std::vector<double> weights;
  for (const Entry& entry : entries)
    weights.push_back(std::max(kLeastWeight, log_odds(entry.match.probability)) *
                          (entry.match.is_observable ? 1.0 : kUnobservableShare) +
                      priors_.weight(entry.match));
  for (const Commitment& set : commit(agree, weights, {kMostHypotheses, kLeastSeed, kSearchSteps})) {
    MergeHypothesis& hypothesis = result.emplace_back();
    for (const std::size_t i : set.agreeing) {
      hypothesis.matches.push_back(entries[i].match);
      hypothesis.proposer = std::max(hypothesis.proposer, entries[i].answer->proposer);
    }
  }
  return result;
}

WallAgreement LaserMerger::agreement(const SolvedSubmaps& solved, const std::vector<std::size_t>& a,
                                     const std::vector<std::size_t>& b) const {
  const auto pose_of = [&](std::size_t map, std::size_t s) { return solved.pose_of(graph_.number(map, s)); };
  const std::vector<PlacedSubmap> placed[2] = {this->placed(a, pose_of), this->placed(b, pose_of)};
  // Elsewhere nothing is expected to coincide.
  graph::RelativeCovariance covariance = solved.covariance();
  std::vector<char> is_known[2] = {std::vector<char>(placed[0].size()), std::vector<char>(placed[1].size())};
  for (std::size_t i = 0; i < placed[0].size(); ++i)
    for (std::size_t j = 0; j < placed[1].size(); ++j) {
      const PlacedSubmap &one = placed[0][i], &other = placed[1][j];
      if ((is_known[0][i] != 0 && is_known[1][j] != 0) ||
          std::hypot(one.x_m - other.x_m, one.y_m - other.y_m) > kCompared_m)
        continue;
      const Eigen::Matrix3d apart = covariance.between(static_cast<std::uint32_t>(solved.place_of(one.number)),
                                                       static_cast<std::uint32_t>(solved.place_of(other.number)));
      if (std::sqrt(std::max(apart(0, 0), apart(1, 1))) < kCompared_sigma_m) is_known[0][i] = is_known[1][j] = true;
    }
  std::vector<PlacedSubmap> sides[2];
  for (int side = 0; side < 2; ++side)
    for (std::size_t i = 0; i < placed[side].size(); ++i)
      if (is_known[side][i] != 0) sides[side].push_back(placed[side][i]);
  // What several maps of a team have counts once.
  const auto walls_m_of = [&](const std::vector<std::size_t>& maps, const std::vector<PlacedSubmap>& all) {
    return maps.size() == 1 ? maps_[maps.front()].walls_m : length_of_walls(all);
  };
  const double walls_m[2] = {walls_m_of(a, placed[0]), walls_m_of(b, placed[1])};
  WallAgreement walls = wall_agreement(sides[0], walls_m[0], sides[1], walls_m[1], sight_of({&sides[0], &sides[1]}));
  // Walls of map_server grids are as thick as their cells.
  for (auto& side : sides)
    side.erase(std::remove_if(side.begin(), side.end(),
                              [&](const PlacedSubmap& submap) { return maps_[graph_.map_of(submap.number)].is_grid; }),
               side.end());
  // Whose walls are looked up does not depend on names.
  const auto lowest_fingerprint = [&](const std::vector<PlacedSubmap>& side) {
    std::optional<Hash> lowest;
    for (const PlacedSubmap& submap : side) {
      const Hash& hash = maps_[graph_.map_of(submap.number)].fingerprints[graph_.submap_of(submap.number)];
      if (!lowest || hash < *lowest) lowest = hash;
    }
    return lowest;
  };
  const std::size_t first = lowest_fingerprint(sides[1]) < lowest_fingerprint(sides[0]) ? 1 : 0;
  const double wider_m = compare_widths(sides[first], sides[1 - first]).certain_m();
  walls.wider_m = first == 0 ? wider_m : 0.0 - wider_m;
  // A prior tells places apart that look alike.
  walls.is_placed = priors_.log_odds(solved, a, b) >= kPriorDistinguishes;
  return walls;
}

void LaserMerger::grow(MergeHypothesis& hypothesis, const LaserTeam& x, const LaserTeam& z) {
  std::vector<SubmapMatch> matches = x.matches;
  matches.insert(matches.end(), z.matches.begin(), z.matches.end());
  matches.insert(matches.end(), hypothesis.matches.begin(), hypothesis.matches.end());
  const auto between_groups = [&](std::size_t i, std::size_t j) {
    const std::size_t a = graph_.map_of(i), b = graph_.map_of(j);
    return contains(x.maps, a) != contains(x.maps, b) && refused_.count(std::minmax(a, b)) == 0 && !are_grids(i, j);
  };
  const auto between_maps = [&](std::size_t a, std::size_t b) { return contains(x.maps, a) != contains(x.maps, b); };
  const std::vector<std::size_t> both = united(x.maps, z.maps);
  std::set<Hash> asked;
  SearchExtent extent = SearchExtent::quick;
  for (int mendings = 0;; ++mendings) {
    ConstraintSearchResult found = search_.run(both, std::move(matches), between_groups, kMostRounds, extent);
    hypothesis.matches.clear();
    for (const SubmapMatch& match : found.matches)
      if (between_maps(graph_.map_of(match.from), graph_.map_of(match.to))) hypothesis.matches.push_back(match);
    hypothesis.solved = std::move(found.solved);
    hypothesis.log_odds = -kSurestLogOdds;
    const bool may_be_bent = hypothesis.matches.size() >= kFewestToMend;
    if (hypothesis.matches.empty() || (found.is_hopeless && !may_be_bent)) return;
    hypothesis.walls = agreement(hypothesis.solved, x.maps, z.maps);
    // Places that do not match may be bent; where walls contradict as well, nothing comes of it.
    const bool is_refuted = found.is_hopeless && weighed(hypothesis.walls).sum_m < 0.0;
    if (found.is_hopeless && !is_refuted) {
      extent = SearchExtent::thorough;
      matches = std::move(found.matches);
      --mendings;
      continue;
    }
    hypothesis.prior_log_odds = priors_.log_odds(hypothesis.solved, x.maps, z.maps);
    hypothesis.log_odds =
        std::clamp(log_odds_of(hypothesis.walls) + hypothesis.prior_log_odds, -kSurestLogOdds, kSurestLogOdds);
    if (is_refuted || hypothesis.log_odds == kSurestLogOdds || !may_be_bent || mendings == kMostMendings) return;
    const std::vector<SubmapMatch> mending =
        mending_between(both, hypothesis.solved, between_maps, PlaceSizes::regions, asked).matches;
    if (mending.empty()) return;
    matches = std::move(found.matches);
    matches.insert(matches.end(), mending.begin(), mending.end());
  }
}

const LaserMerger::Evaluation& LaserMerger::evaluated(const LaserTeam& x, const LaserTeam& z) {
  Evaluation& evaluation = evaluations_[{x.maps, z.maps}];
  const std::size_t answers = answers_between(x, z).size() + 1;  // 0: never evaluated
  if (evaluation.answers == answers) return evaluation;
  const Evaluation before = std::move(evaluation);
  evaluation = {answers, refused_.size(), seeds(x, z), 0.0, false, 0.0};
  for (MergeHypothesis& hypothesis : evaluation.hypotheses) {
    hypothesis.grown_from = hash_of({&x.matches, &z.matches, &hypothesis.matches});
    const auto as_before =
        std::find_if(before.hypotheses.begin(), before.hypotheses.end(),
                     [&](const MergeHypothesis& other) { return other.grown_from == hypothesis.grown_from; });
    if (before.refused != refused_.size() || as_before == before.hypotheses.end()) {
      grow(hypothesis, x, z);
      continue;
    }
    const Proposer proposer = hypothesis.proposer;
    hypothesis = *as_before;
    hypothesis.proposer = proposer;
  }
  for (MergeHypothesis& hypothesis : grid_hypotheses(x, z)) evaluation.hypotheses.push_back(std::move(hypothesis));
  std::stable_sort(evaluation.hypotheses.begin(), evaluation.hypotheses.end(),
                   [](const MergeHypothesis& l, const MergeHypothesis& r) { return l.log_odds > r.log_odds; });
  double sum = 1.0;
  for (const MergeHypothesis& hypothesis : evaluation.hypotheses) {
    const MergeHypothesis& best = evaluation.hypotheses.front();
    const double odds = std::exp(hypothesis.log_odds);
    if (&hypothesis == &best) {
      sum += odds;
      continue;
    }
    if (is_same(hypothesis, best)) continue;
    // Who lays as much wall on wall is a rival, however much of it would fit elsewhere too.
    const bool fits_as_well = fit_of(hypothesis.walls) >= kAsGoodAFit * fit_of(best.walls) && fit_of(best.walls) > 0.0;
    const double as_well = std::max(odds, std::exp(best.log_odds - best.prior_log_odds + hypothesis.prior_log_odds));
    sum += fits_as_well ? as_well : odds;
    evaluation.rival =
        std::max(evaluation.rival, std::min(1.0, (fits_as_well ? as_well : odds) / std::exp(best.log_odds)));
  }
  if (evaluation.hypotheses.empty()) return evaluation;
  evaluation.probability = std::exp(evaluation.hypotheses.front().log_odds) / sum;
  const MergeHypothesis& surest = evaluation.hypotheses.front();
  if (evaluation.probability < options_.merge_probability || surest.is_of_grids) return evaluation;
  // What stood twice does so still, however more answers move it.
  const bool stood_twice = before.repeats && is_same(before.hypotheses.front(), surest);
  evaluation.repeats = surest.prior_log_odds < kPriorDistinguishes &&
                       (stood_twice || fits_elsewhere(evaluation.hypotheses) || stands_twice(surest, x, z));
  if (evaluation.repeats) evaluation.probability *= 0.5;
  return evaluation;
}

// In whichever order they were compared; nullptr where nothing was found.
const LaserMerger::Evaluation* LaserMerger::last_evaluation(const std::vector<std::size_t>& one,
                                                            const std::vector<std::size_t>& other) const {
  for (const auto& pair : {std::pair(one, other), std::pair(other, one)})
    if (const auto found = evaluations_.find(pair); found != evaluations_.end() && !found->second.hypotheses.empty())
      return &found->second;
  return nullptr;
}

// Whether the teams of two maps fit, and would fit elsewhere as well: more questions change nothing then.
bool LaserMerger::is_known_to_repeat(const MapPair& pair) const {
  const LaserTeam *one = team_of(pair.first), *other = team_of(pair.second);
  const Evaluation* evaluation = one == nullptr || other == nullptr ? nullptr : last_evaluation(one->maps, other->maps);
  return evaluation != nullptr && evaluation->repeats && evaluation->hypotheses.front().log_odds >= kCertain;
}

// Whether another place speaks against the best hypothesis, which is the first one: only one of them can be right.
bool LaserMerger::fits_elsewhere(const std::vector<MergeHypothesis>& hypotheses) const {
  const MergeHypothesis& best = hypotheses.front();
  const double enough = log_odds(options_.merge_probability);
  return std::any_of(hypotheses.begin() + 1, hypotheses.end(), [&](const MergeHypothesis& other) {
    return !other.is_of_grids && !is_same(other, best) &&
           fits_by_chance(best.walls, other.walls, other.log_odds, enough);
  });
}

// Whether what makes two teams fit stands more than once in one of them: then they would fit there as well, unless the
// rest of both would contradict that, as the graph bends them.
bool LaserMerger::stands_twice(const MergeHypothesis& hypothesis, const LaserTeam& x, const LaserTeam& z) {
  const auto pose_of = [&](std::size_t map, std::size_t s) { return hypothesis.solved.pose_of(graph_.number(map, s)); };
  const auto in_x = placed(x.maps, pose_of), in_z = placed(z.maps, pose_of);
  for (const Repetition& repetition : self_repetitions(in_x, in_z, sight_of({&in_x, &in_z}))) {
    const auto pose_elsewhere = [&](std::size_t map, std::size_t s) {
      return compose(repetition.b_moved, pose_of(map, s));
    };
    const auto elsewhere = placed(z.maps, pose_elsewhere);
    const WallAgreement rigid = wall_agreement(in_x, length_of_walls(in_x), elsewhere, length_of_walls(elsewhere),
                                               sight_of({&in_x, &elsewhere}));
    if (!is_contradicted(rigid, hypothesis.walls)) return true;
    MergeHypothesis rival;
    std::vector<SubmapQuestion> questions;
    for (const std::size_t a : x.maps)
      for (const std::size_t b : z.maps) {
        const auto in_a = placed({a}, pose_of), in_b = placed({b}, pose_of);
        const auto some = proposals_.of_most_shared(in_a, in_b, repetition.b_moved, kBentRadius_m, kBentYaw_rad,
                                                    sight_of({&in_a, &in_b}));
        questions.insert(questions.end(), some.begin(), some.end());
      }
    for (const SubmapAnswer& answer : judge_.ask(questions))
      if (answer.holds) rival.matches.push_back(answer.hypotheses.front());
    grow(rival, x, z);
    if (rival.walls.coinciding_m > 0.0 && !is_contradicted(rival.walls, hypothesis.walls)) return true;
  }
  return false;
}

// Whether two hypotheses came to the same: each has the places that the other one matched where that one has them, as
// surely as both graphs know.
bool LaserMerger::is_same(const MergeHypothesis& one, const MergeHypothesis& other) const {
  if (one.matches.empty() || other.matches.empty()) return false;
  graph::RelativeCovariance covariance[2] = {one.solved.covariance(), other.solved.covariance()};
  const SolvedSubmaps* solved[2] = {&one.solved, &other.solved};
  const auto agree_at = [&](const SubmapMatch& match) {
    Pose2 from_from_to[2];
    Eigen::Matrix3d both = submap_bend_covariance();
    for (int k = 0; k < 2; ++k) {
      from_from_to[k] = between(solved[k]->pose_of(match.from), solved[k]->pose_of(match.to));
      both += covariance[k].between(static_cast<std::uint32_t>(solved[k]->place_of(match.from)),
                                    static_cast<std::uint32_t>(solved[k]->place_of(match.to)));
    }
    const Pose2 apart = between(from_from_to[0], from_from_to[1]);
    const Eigen::Vector3d error(apart.x, apart.y, apart.phi);
    return error.dot(both.ldlt().solve(error)) < kConsistent;
  };
  return agree_at(one.matches.front()) && agree_at(other.matches.front());
}

}  // namespace mapweave::fusion
