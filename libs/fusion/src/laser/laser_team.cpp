#include "laser_team.h"

#include "../commitment.h"
#include "self_repetition.h"

#include <mapweave/core/interrupt.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::fusion {
namespace {

constexpr std::size_t kMostHypotheses = 4;   // evaluated for two groups of maps
constexpr double kCertain = 15.0;            // log odds from which a merge waits for no other
constexpr double kLeastSeed = 1.0;           // log odds of the matches that a hypothesis begins with
constexpr std::size_t kSearchSteps = 20000;  // for each set of matches
// Walls are compared where the graph knows to this how the two lie to each other.
constexpr double kCompared_m = 20.0, kCompared_sigma_m = 0.4;
constexpr int kMostRounds = 12, kMostRoundsFinal = 32;
constexpr int kMostMendings = 6, kMostMendingsAlone = 2;    // of a team; of two groups that are not merged yet
constexpr std::size_t kFewestToMend = 3;                    // matches
constexpr std::size_t kMostAtOnce = std::size_t{1} << 20U;  // questions of a pair of maps: more than a pair has
constexpr double kBentRadius_m = 0.7, kBentYaw_rad = 0.06;  // how a submap may lie to what its region says
constexpr double kAsGoodAFit = 0.9;
constexpr double kPriorDistinguishes = 2.0;  // log odds of a prior

bool contains(const std::vector<std::size_t>& sorted, std::size_t value) {
  return std::binary_search(sorted.begin(), sorted.end(), value);
}

std::vector<std::size_t> united(const std::vector<std::size_t>& a, const std::vector<std::size_t>& b) {
  std::vector<std::size_t> all;
  std::set_union(a.begin(), a.end(), b.begin(), b.end(), std::back_inserter(all));
  return all;
}

}  // namespace

LaserMerger::LaserMerger(const std::vector<PreparedMap>& maps, const GridAlignments& grids, const FusionInput& input,
                         const FusionOptions& options, const std::set<std::pair<std::size_t, std::size_t>>& refused,
                         matching::ModelCache& cache, Memo& memo, WorkerPool& pool)
    : maps_(maps),
      grids_(grids),
      input_(input),
      options_(options),
      refused_(refused),
      memo_(memo),
      graph_(maps, options.solve),
      priors_(maps, graph_, input.priors),
      judge_(maps, graph_, options, input.vetoed, cache, memo, pool),
      search_(maps, graph_, judge_),
      proposals_(maps, graph_) {}

const LaserTeam* LaserMerger::team_of(std::size_t map) const {
  const auto team =
      std::find_if(teams_.begin(), teams_.end(), [&](const LaserTeam& t) { return contains(t.maps, map); });
  return team == teams_.end() ? nullptr : &*team;
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
    weights.push_back(std::max(0.05, log_odds(entry.match.probability)) * (entry.match.is_observable ? 1.0 : 0.3) +
                      priors_.weight(entry.match));
  for (const Commitment& set : commit(agree, weights, {kMostHypotheses, kLeastSeed, kSearchSteps})) {
    MergeHypothesis& hypothesis = result.emplace_back();
    for (const std::size_t i : set.agreeing) hypothesis.matches.push_back(entries[i].match);
  }
  return result;
}

std::vector<PlacedSubmap> LaserMerger::placed(const std::vector<std::size_t>& maps, const PoseOfSubmap& pose_of) const {
  std::vector<PlacedSubmap> result;
  for (const std::size_t m : maps)
    for (const std::size_t s : maps_[m].representatives) {
      const Pose2 pose = pose_of(m, s);
      const Eigen::Vector2d middle = middle_of(maps_[m], s, pose);
      result.push_back({graph_.number(m, s), pose, middle.x(), middle.y(), static_cast<double>(maps_[m].radii_m[s]),
                        &maps_[m].walls[s]});
    }
  return result;
}

SightOf LaserMerger::sight_of(const std::vector<const std::vector<PlacedSubmap>*>& sides) const {
  std::vector<std::size_t> numbers;
  for (const auto* side : sides)
    for (const PlacedSubmap& submap : *side) numbers.push_back(submap.number);
  judge_.prepare_sights(numbers);
  return [this](std::size_t number) { return judge_.sight(number); };
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
  return wall_agreement(sides[0], walls_m[0], sides[1], walls_m[1], sight_of({&sides[0], &sides[1]}));
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
  for (int mendings = 0;; ++mendings) {
    ConstraintSearchResult found = search_.run(both, std::move(matches), between_groups, kMostRounds, false);
    hypothesis.matches.clear();
    for (const SubmapMatch& match : found.matches)
      if (between_maps(graph_.map_of(match.from), graph_.map_of(match.to))) hypothesis.matches.push_back(match);
    hypothesis.solved = std::move(found.solved);
    hypothesis.log_odds = -kSurestLogOdds;
    const bool may_be_bent = hypothesis.matches.size() >= kFewestToMend;
    if (hypothesis.matches.empty() || (found.is_hopeless && !may_be_bent)) return;
    hypothesis.walls = agreement(hypothesis.solved, x.maps, z.maps);
    hypothesis.prior_log_odds = priors_.log_odds(hypothesis.solved, x.maps, z.maps);
    hypothesis.log_odds =
        std::clamp(log_odds_of(hypothesis.walls) + hypothesis.prior_log_odds, -kSurestLogOdds, kSurestLogOdds);
    if (hypothesis.log_odds == kSurestLogOdds || !may_be_bent || mendings == kMostMendingsAlone) return;
    const std::vector<SubmapMatch> mending = matches_at_ghosts(both, hypothesis.solved, between_maps, asked);
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
  evaluation = {answers, seeds(x, z), 0.0, false, 0.0};
  for (MergeHypothesis& hypothesis : evaluation.hypotheses) grow(hypothesis, x, z);
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
  // A prior distinguishes places that look alike.
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
        const auto some = proposals_.of_most_shared(a, b, in_a, in_b, repetition.b_moved, kBentRadius_m, kBentYaw_rad,
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

// Whether two hypotheses came to the same: a submap of the one lies where the other has it.
bool LaserMerger::is_same(const MergeHypothesis& one, const MergeHypothesis& other) const {
  if (one.matches.empty() || other.matches.empty()) return false;
  const SubmapMatch& match = one.matches.front();
  const Pose2 apart = between(between(one.solved.pose_of(match.from), one.solved.pose_of(match.to)),
                              between(other.solved.pose_of(match.from), other.solved.pose_of(match.to)));
  return std::hypot(apart.x, apart.y) < 0.5 && std::abs(apart.phi) < 0.1;
}

// Pairs of teams, those first whose places match most.
std::vector<std::pair<std::size_t, std::size_t>> LaserMerger::likeliest_first() const {
  std::vector<std::tuple<double, std::size_t, std::size_t>> order;
  for (std::size_t x = 0; x < teams_.size(); ++x)
    for (std::size_t z = x + 1; z < teams_.size(); ++z) {
      double weight = 0.0;
      for (const SubmapAnswer* answer : answers_between(teams_[x], teams_[z]))
        if (answer->holds)
          weight += log_odds(answer->hypotheses.front().probability) * answer->judgement.evidence.overlap_m2;
      order.emplace_back(-weight, x, z);
    }
  std::sort(order.begin(), order.end());
  std::vector<std::pair<std::size_t, std::size_t>> result;
  for (const auto& [weight, x, z] : order) result.emplace_back(x, z);
  return result;
}

// What is certain at once, the likeliest first; else the surest of all.
bool LaserMerger::merge_surest() {
  double surest = options_.merge_probability;
  std::size_t best_x = 0, best_z = 0;
  const Evaluation* best = nullptr;
  for (const auto& [x, z] : likeliest_first()) {
    const Evaluation& evaluation = evaluated(teams_[x], teams_[z]);
    if (evaluation.hypotheses.empty() || evaluation.probability < surest) continue;
    const MergeHypothesis& hypothesis = evaluation.hypotheses.front();
    if (best != nullptr && evaluation.probability == surest &&
        hypothesis.walls.distinctive_m <= best->hypotheses.front().walls.distinctive_m)
      continue;
    surest = evaluation.probability;
    best_x = x;
    best_z = z;
    best = &evaluation;
    if (hypothesis.log_odds >= kCertain && evaluation.rival <= options_.max_rival && !evaluation.repeats) break;
  }
  if (best == nullptr) return false;
  const MergeHypothesis& chosen = best->hypotheses.front();
  LaserTeam& x = teams_[best_x];
  const LaserTeam& z = teams_[best_z];
  merges_.push_back({x.maps, z.maps, best->probability});
  x.maps = united(x.maps, z.maps);
  x.matches.insert(x.matches.end(), z.matches.begin(), z.matches.end());
  x.matches.insert(x.matches.end(), chosen.matches.begin(), chosen.matches.end());
  x.solved = chosen.solved;
  teams_.erase(teams_.begin() + static_cast<std::ptrdiff_t>(best_z));
  return true;
}

void LaserMerger::close_loops(LaserTeam& team) {
  if (team.maps.size() < 2) return;
  const auto in_scope = [&](std::size_t i, std::size_t j) {
    return refused_.count(std::minmax(graph_.map_of(i), graph_.map_of(j))) == 0 && !are_grids(i, j);
  };
  const auto search = [&] {
    ConstraintSearchResult found = search_.run(team.maps, std::move(team.matches), in_scope, kMostRoundsFinal, true);
    team.matches = std::move(found.matches);
    team.solved = std::move(found.solved);
  };
  search();
  std::set<Hash> asked;
  for (int round = 0; round < kMostMendings; ++round) {
    const std::vector<SubmapMatch> found = matches_at_ghosts(
        team.maps, team.solved, [](std::size_t, std::size_t) { return true; }, asked);
    if (found.empty()) break;
    team.matches.insert(team.matches.end(), found.begin(), found.end());
    search();
  }
}

// New ones, where maps would no longer show something twice. `asked`: judgements that were tried.
std::vector<SubmapMatch> LaserMerger::matches_at_ghosts(const std::vector<std::size_t>& maps,
                                                        const SolvedSubmaps& solved,
                                                        const std::function<bool(std::size_t, std::size_t)>& may_match,
                                                        std::set<Hash>& asked) {
  const auto placed_maps =
      placed_apart(maps, [&](std::size_t map, std::size_t s) { return solved.pose_of(graph_.number(map, s)); });
  std::vector<const std::vector<PlacedSubmap>*> sides;
  for (const auto& side : placed_maps) sides.push_back(&side);
  const SightOf sight = sight_of(sides);
  const auto may_be_bent = [&](std::size_t i, std::size_t j) {
    const std::size_t a = maps[i], b = maps[j];
    return refused_.count({a, b}) == 0 && !(grids_.is_grid(a) && grids_.is_grid(b)) && may_match(a, b);
  };
  std::vector<SubmapQuestion> questions;
  for (const BentRegion& region : bent_regions(placed_maps, sight, may_be_bent)) {
    std::vector<PlacedSubmap> there[2];
    for (const std::size_t side : {0, 1})
      for (const PlacedSubmap& submap : placed_maps[side == 0 ? region.a : region.b])
        if (std::hypot(submap.x_m - region.x_m, submap.y_m - region.y_m) <
            submap.radius_m + 0.5 * RegionAgreement::kSide_m)
          there[side].push_back(submap);
    const auto some = proposals_.of_most_shared(maps[region.a], maps[region.b], there[0], there[1],
                                                inverse(region.moved), kBentRadius_m, kBentYaw_rad, sight);
    questions.insert(questions.end(), some.begin(), some.end());
  }
  std::vector<SubmapMatch> found;
  for (const SubmapAnswer& answer : judge_.ask(questions))
    if (asked.insert(answer.judgement.id).second && answer.holds) found.push_back(answer.hypotheses.front());
  return found;
}

std::vector<std::vector<PlacedSubmap>> LaserMerger::placed_apart(const std::vector<std::size_t>& maps,
                                                                 const PoseOfSubmap& pose_of) const {
  std::vector<std::vector<PlacedSubmap>> result;
  for (const std::size_t map : maps) result.push_back(placed({map}, pose_of));
  return result;
}

TeamAudit LaserMerger::audited(const std::vector<std::size_t>& maps, const PoseOfSubmap& pose_of) const {
  const auto placed_maps = placed_apart(maps, pose_of);
  std::vector<const std::vector<PlacedSubmap>*> sides;
  std::vector<double> walls_m;
  for (const std::size_t map : maps) walls_m.push_back(maps_[map].walls_m);
  for (const auto& side : placed_maps) sides.push_back(&side);
  // Two grids were compared with each other by what grids of other makers may differ in.
  const auto may_show_ghosts = [&](std::size_t a, std::size_t b) { return grids_.pair(maps[a], maps[b]) == nullptr; };
  return audit(placed_maps, walls_m, sight_of(sides), may_show_ghosts);
}

// A map that the others contradict, at a loop that was not found or anywhere else, is taken out of its team.
bool LaserMerger::take_back() {
  for (const LaserTeam& team : teams_) {
    if (team.maps.size() < 2) continue;
    const PoseOfSubmap pose_of = [&](std::size_t map, std::size_t s) {
      return team.solved.pose_of(graph_.number(map, s));
    };
    const TeamAudit audit = audited(team.maps, pose_of);
    if (!audit.taken_out) continue;
    const std::size_t who = team.maps[*audit.taken_out];
    for (PairAudit& ghost : ghosts_of(audit, team.maps, who, pose_of)) taken_apart_.push_back(std::move(ghost));
    for (const AuditedPair& pair : audit.pairs)
      if (const MapPair maps{team.maps[pair.a], team.maps[pair.b]};
          pair.ghosts_m > 0.0 && (maps.first == who || maps.second == who))
        contradicted_.insert(maps);
    remember_taken_back(team, audit, who);
    for (const std::size_t other : team.maps)
      if (other != who) {
        const MapPair pair = std::minmax(who, other);
        refused_.insert(pair);
        pairs_[pair].answers.clear();
      }
    return true;
  }
  return false;
}

void LaserMerger::merge_all() {
  teams_.clear();
  merges_.clear();
  evaluations_.clear();
  for (std::size_t m = 0; m < maps_.size(); ++m)
    if (!maps_[m].submaps.empty()) teams_.push_back({{m}, {}, graph_.alone(m)});
  bool any = true;
  for (std::size_t count = kFirstRound; any; count = std::min(4 * count, kMostAtOnce)) {
    any = false;
    std::set<MapPair> asked;
    do {
      while (merge_surest()) throw_if_interrupted();
    } while (ask_more(count, asked) && (any = true));
    any = any || propose_whole_maps();
  }
  for (LaserTeam& team : teams_) close_loops(team);
  split_unconnected();
}

// The last solution may have rejected all matches of a map with the others.
void LaserMerger::split_unconnected() {
  std::vector<LaserTeam> parts;
  for (LaserTeam& team : teams_) {
    std::vector<std::size_t> left = team.maps;
    while (!left.empty()) {
      std::vector<std::size_t> part{left.front()};
      for (bool any = true; any;) {
        any = false;
        for (const SubmapMatch& match : team.matches) {
          const std::size_t a = graph_.map_of(match.from), b = graph_.map_of(match.to);
          if (contains(part, a) == contains(part, b)) continue;
          part = united(part, {std::min(a, b), std::max(a, b)});
          any = true;
        }
      }
      if (part.size() == team.maps.size()) {
        parts.push_back(std::move(team));
        break;
      }
      LaserTeam own{part, {}, {}};
      for (const SubmapMatch& match : team.matches)
        if (contains(part, graph_.map_of(match.from))) own.matches.push_back(match);
      own.solved = graph_.solve(part, own.matches);
      parts.push_back(std::move(own));
      std::vector<std::size_t> others;
      std::set_difference(left.begin(), left.end(), part.begin(), part.end(), std::back_inserter(others));
      left = std::move(others);
    }
  }
  teams_ = std::move(parts);
}

void LaserMerger::run(Progress& progress) {
  open_pairs();
  if (pairs_.empty()) {
    merge_all();
    return;
  }
  const int task = progress.begin("comparing maps", pairs_.size(), "pairs of maps");
  do merge_all();
  while (take_back());
  progress.advance(task, pairs_.size());
  progress.end(task);
}

}  // namespace mapweave::fusion
