// How sure a merge is, and what is said of a pair of maps.

#include "laser_team.h"

#include "decision/verdict.h"

#include <mapweave/fusion/wall_weights.h>
#include <mapweave/maps/alignment.h>
#include <mapweave/maps/map_noise.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

// Log odds of a merge: metres of wall that fit here and nowhere around speak for it, metres that the other saw through,
// or has close beside its own, against it. The weights are from hypotheses, right and wrong, of public buildings, of
// their mirror images and of simulated rooms.
constexpr double kPerMetre = 1.0;
// What would be found by chance: more where most of both maps lies beside each other, since there are more ways to lay
// them so; there a share of what fits, too.
constexpr double kByChance_m = 5.0, kByChanceBeside_m = 5.0, kByChanceShare = 0.08, kWholeOverlap = 0.7;
// Where one map covers the other, walls that the other saw only in part are doubtful as well; where they overlap less,
// its view just ends there.
constexpr double kPartlyOverlap = 0.35;
// Below it, ends of walls that slide along themselves count as well, up to as much as walls that face along them:
// more is taken for chance there.
constexpr double kEndsOverlap = 0.5;
// Observability of corridors and aisles. Where more walls face along each direction, ends are corners.
constexpr double kCorridor = 0.1;

Eigen::Vector2d placed_by(const Pose2& pose, const Eigen::Vector2d& place) {
  const double c = std::cos(pose.phi), s = std::sin(pose.phi);
  return {pose.x + c * place.x() - s * place.y(), pose.y + s * place.x() + c * place.y()};
}

// Two places that show the same, as a statement about the frames of their maps, and where they lie in each.
struct MatchedPlaces {
  Pose2 a_from_b;
  Eigen::Vector2d in_a, in_b;
  double weight = 1.0;
};

// Of b's frame in a's, at the middle of the places: the same from either side, though maps are bent.
Pose2 mean_transform(const std::vector<MatchedPlaces>& matches) {
  double sine = 0, cosine = 0, all = 0;
  Eigen::Vector2d in_a = Eigen::Vector2d::Zero(), in_b = Eigen::Vector2d::Zero();
  for (const MatchedPlaces& match : matches) {
    all += match.weight;
    sine += match.weight * std::sin(match.a_from_b.phi);
    cosine += match.weight * std::cos(match.a_from_b.phi);
    in_a += 0.5 * match.weight * (match.in_a + placed_by(match.a_from_b, match.in_b));
    in_b += 0.5 * match.weight * (match.in_b + placed_by(inverse(match.a_from_b), match.in_a));
  }
  in_a /= all;
  in_b /= all;
  const double phi = std::atan2(sine, cosine), c = std::cos(phi), s = std::sin(phi);
  return {in_a.x() - (c * in_b.x() - s * in_b.y()), in_a.y() - (s * in_b.x() + c * in_b.y()), phi};
}

Eigen::Vector2d vector_of(const matching::Point2f& point) { return {point.x, point.y}; }

// Submaps of two maps that a solved graph puts beside each other, whether they were matched or not: which of them are
// is chance.
std::vector<MatchedPlaces> places_beside(const PreparedMap& a, std::size_t first_of_a, const PreparedMap& b,
                                         std::size_t first_of_b, const SolvedSubmaps& solved) {
  constexpr double kBeside_m = 8.0;  // between middles: a submap's usual length
  std::vector<MatchedPlaces> places;
  for (std::size_t i = 0; i < a.submaps.size(); ++i)
    for (std::size_t j = 0; j < b.submaps.size(); ++j) {
      const Pose2 &of_i = solved.pose_of(first_of_a + i), &of_j = solved.pose_of(first_of_b + j);
      const double weight = 1.0 - (middle_of(a, i, of_i) - middle_of(b, j, of_j)).norm() / kBeside_m;
      if (weight <= 0.0) continue;
      const Pose2 a_from_b = compose(compose(a.map_from_submap[i], between(of_i, of_j)), inverse(b.map_from_submap[j]));
      places.push_back({a_from_b, vector_of(a.centres[i]), vector_of(b.centres[j]), weight});
    }
  return places;
}

}  // namespace

PairAudit pair_audit(const AuditedPair& pair, const PreparedMap& a, const PreparedMap& b) {
  constexpr std::size_t kMostConflicts = 20;  // for people; the longest first
  PairAudit audit{a.map->id, b.map->id, pair.coinciding_m, pair.contradicted_m, pair.unclear_m, {}};
  for (std::size_t i = 0; i < std::min(kMostConflicts, pair.contradictions.size()); ++i)
    audit.conflicts.push_back(
        {pair.contradictions[i].x_m, pair.contradictions[i].y_m, pair.contradictions[i].length_m});
  return audit;
}

std::vector<PairAudit> LaserMerger::ghosts_of(const TeamAudit& audit, const std::vector<std::size_t>& maps,
                                              std::size_t with, const PoseOfSubmap& pose_of) const {
  std::vector<PairAudit> ghosts;
  for (const AuditedPair& pair : audit.pairs) {
    const std::size_t a = maps[pair.a], b = maps[pair.b];
    if (pair.ghosts_m <= 0.0 || (a != with && b != with)) continue;
    PairAudit ghost = pair_audit(pair, maps_[a], maps_[b]);
    ghost.is_ghost = true;
    // As the place of a nearest to it has it: the team bends its maps.
    for (PairAudit::Conflict& conflict : ghost.conflicts) {
      const Eigen::Vector2d place(conflict.x_m, conflict.y_m);
      std::pair<double, std::size_t> nearest{1e300, 0};
      for (const std::size_t s : maps_[a].representatives)
        nearest = std::min(nearest, {(middle_of(maps_[a], s, pose_of(a, s)) - place).norm(), s});
      const Pose2 own = compose(compose(maps_[a].map_from_submap[nearest.second], inverse(pose_of(a, nearest.second))),
                                Pose2{place.x(), place.y(), 0.0});
      conflict.x_m = own.x;
      conflict.y_m = own.y;
    }
    ghosts.push_back(std::move(ghost));
  }
  return ghosts;
}

WeighedWalls weighed(const WallAgreement& walls) {
  const double beside = 1.0 - std::min(1.0, walls.overlap / kWholeOverlap);
  WeighedWalls result;
  result.by_chance_m = kByChance_m + beside * (kByChanceBeside_m + kByChanceShare * walls.coinciding_m);
  const double covered = std::clamp((walls.overlap - kPartlyOverlap) / (kWholeOverlap - kPartlyOverlap), 0.0, 1.0);
  result.unclear_m = walls.unclear_m - (1.0 - covered) * walls.in_part_m;
  const double against_m = kContradictionWeight * walls.contradicted_m + kUnclearWeight * result.unclear_m;
  // Walls that slide along themselves do not say where along them the maps lie.
  const double with_ends = 1.0 + std::max(0.0, 1.0 - walls.overlap / kEndsOverlap);
  const double along_both = std::pow(std::max(1.0, walls.observability / kCorridor), 2);
  const double most_m = with_ends * along_both * walls.observability * walls.coinciding_m;
  result.unique_m = walls.is_placed ? walls.distinctive_m : std::min(walls.unique_m, most_m);
  result.distinctive_m = counted_share(walls.wider_m) * result.unique_m;
  result.sum_m = result.distinctive_m - against_m - result.by_chance_m;
  result.log_odds = std::clamp(kPerMetre * result.sum_m, -kSurestLogOdds, kSurestLogOdds);
  return result;
}

bool fits_by_chance(const WallAgreement& here, const WallAgreement& elsewhere, double log_odds_elsewhere,
                    double enough) {
  const WeighedWalls walls = weighed(here);
  return log_odds_elsewhere >= enough || walls.sum_m + walls.by_chance_m - weighed(elsewhere).unique_m < enough;
}

double log_odds_of(const WallAgreement& walls) { return weighed(walls).log_odds; }

double fit_of(const WallAgreement& walls) { return fit_m(walls.coinciding_m, walls.unclear_m, walls.contradicted_m); }

SubmapMatch turned(SubmapMatch match) {
  std::swap(match.from, match.to);
  const Eigen::Matrix3d carry = adjoint(inverse(match.from_from_to));
  match.information = (carry.transpose() * match.information * carry).eval();
  match.from_from_to = inverse(match.from_from_to);
  return match;
}

PairResult LaserMerger::result_of(std::size_t a, std::size_t b) const {
  PairResult result;
  Verdict& verdict = result.verdict =
      unseen(maps_[a].map->id, maps_[b].map->id, input_.by, maps_[a].is_grid || maps_[b].is_grid ? "grid" : "laser");
  const LaserTeam* team = team_of(a);
  const GridAlignments::Pair* grids = grids_.pair(a, b);
  std::vector<SubmapMatch> matches;
  if (team != nullptr && team == team_of(b))
    for (const SubmapMatch& match : team->matches)
      if (std::minmax(graph_.map_of(match.from), graph_.map_of(match.to)) == std::minmax(a, b))
        matches.push_back(match);
  verdict.merge = merge_of(a, b);
  verdict.proposer = verdict.merge ? verdict.merge->proposer : last_proposer(a, b);
  if (grids != nullptr) {
    describe_grids(a, b, verdict);
    if (matches.empty())
      refuse_grids(verdict, grids->result.reason, grids->is_vetoed);
    else
      accept_grids(verdict, grids->result.reason);
  } else if (!matches.empty()) {
    const WallAgreement walls = agreement(team->solved, {a}, {b});
    verdict.conflict = walls.conflict();
    verdict.overlap = walls.overlap;
    verdict.hypotheses = hypotheses_of(a, b, &walls);
    accept_by_lasers(verdict, log_odds_of(walls) + priors_.log_odds(team->solved, {a}, {b}));
  } else if (vetoed_.count({a, b}) != 0) {
    veto(verdict);
  } else if (contradicted_.count({a, b}) != 0) {
    refuse_by_audit(verdict);
    for (const PairAudit& ghost : taken_apart_)
      if (ghost.a == verdict.a && ghost.b == verdict.b)
        verdict.conflict =
            ghost.contradicted_m / std::max(1e-9, ghost.coinciding_m + ghost.contradicted_m + ghost.unclear_m);
  } else if (taken_back_.count({a, b}) != 0) {
    refuse_as_inconsistent(verdict);  // they matched, but a third one showed that one of them lay wrongly
  } else {
    matches = doubted(a, b, verdict);
  }
  if (verdict.decision != Decision::accepted && grids == nullptr) verdict.hypotheses = hypotheses_of(a, b, nullptr);
  std::vector<Hash> judgements;
  for (const SubmapMatch& match : matches) judgements.push_back(match.judgement);
  set_witnesses(verdict, std::move(judgements));
  if (matches.empty()) return result;
  std::vector<MatchedPlaces> transforms;
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  for (SubmapMatch match : matches) {
    if (graph_.map_of(match.from) != a) match = turned(match);
    Witness witness;
    witness.judgement = memo_.at(match.judgement);
    witness.submap_a = graph_.submap_of(match.from);
    witness.submap_b = graph_.submap_of(match.to);
    witness.submap_a_from_submap_b = match.from_from_to;
    witness.submap_information = match.information;
    witness.a_from_b = compose(compose(maps_[a].map_from_submap[witness.submap_a], match.from_from_to),
                               inverse(maps_[b].map_from_submap[witness.submap_b]));
    transforms.push_back({witness.a_from_b, vector_of(maps_[a].centres[witness.submap_a]),
                          vector_of(maps_[b].centres[witness.submap_b])});
    const Eigen::Matrix3d carry = adjoint(inverse(maps_[b].map_from_submap[witness.submap_b]));
    information += carry.transpose() * match.information * carry;
    if (verdict.decision == Decision::accepted) result.witnesses.push_back(std::move(witness));
  }
  if (verdict.decision == Decision::accepted && grids == nullptr) {
    const auto beside = places_beside(maps_[a], graph_.number(a, 0), maps_[b], graph_.number(b, 0), team->solved);
    if (!beside.empty()) transforms = beside;
  }
  Alignment alignment;
  alignment.a_from_b.pose = spatial(mean_transform(transforms));
  // Matches share the errors of the maps: however many agree, they count no more than four do.
  information *= std::min(1.0, 4.0 / static_cast<double>(matches.size()));
  alignment.covariance = spatial(Eigen::Matrix3d(information.inverse() + alignment_covariance()));
  if (grids == nullptr) verdict.alignment = alignment;
  return result;
}

// Who proposed the last questions about two maps that stayed apart.
std::string LaserMerger::last_proposer(std::size_t a, std::size_t b) const {
  const auto state = pairs_.find({a, b});
  return to_text(state == pairs_.end() ? Proposer::ring_keys : state->second.last);
}

// What kept two maps apart, and the matches of the best hypothesis: what they were by themselves, unless that would
// have merged them or nothing was found then; else what their teams were.
std::vector<SubmapMatch> LaserMerger::doubted(std::size_t a, std::size_t b, Verdict& verdict) const {
  const auto doubt_by = [&](const Evaluation& evaluation) {
    const MergeHypothesis& best = evaluation.hypotheses.front();
    WallAgreement as_wide = best.walls;
    as_wide.wider_m = 0.0;
    const bool has_other_widths = best.log_odds <= 0.0 && weighed(as_wide).sum_m > 0.0;
    // Ambiguous as well where it would be merged if a prior said which of the places that look alike it is.
    const WeighedWalls weights = weighed(best.walls);
    WallAgreement as_placed = best.walls;
    as_placed.is_placed = true;
    const bool looks_alike = (best.walls.repeats && fit_of(best.walls) > 0.0) ||
                             (weights.unique_m <= weights.by_chance_m && weighed(as_placed).sum_m > 0.0);
    const bool repeats = evaluation.repeats || (best.log_odds <= 0.0 && !best.walls.is_placed && looks_alike);
    doubt_by_lasers(
        verdict, {best.log_odds, evaluation.probability, evaluation.rival, repeats, has_other_widths, weights.unique_m},
        best.walls, options_);
    std::vector<SubmapMatch> matches;
    for (const SubmapMatch& match : best.matches)
      if (std::minmax(graph_.map_of(match.from), graph_.map_of(match.to)) == std::minmax(a, b))
        matches.push_back(match);
    return matches;
  };
  const Evaluation* alone = last_evaluation({a}, {b});
  if (alone != nullptr && alone->probability < options_.merge_probability) return doubt_by(*alone);
  const LaserTeam *of_a = team_of(a), *of_b = team_of(b);
  const Evaluation* of_teams = of_a == nullptr || of_b == nullptr ? nullptr : last_evaluation(of_a->maps, of_b->maps);
  if (of_teams != nullptr)
    if (const auto matches = doubt_by(*of_teams); !matches.empty() || alone == nullptr) return matches;
  if (alone != nullptr) return doubt_by(*alone);
  const auto state = pairs_.find({a, b});
  if (state == pairs_.end()) return {};
  // Only answers that were themselves in doubt: say which doubt was the least bad.
  const SubmapAnswer* likeliest = nullptr;
  for (const SubmapAnswer& answer : state->second.answers)
    if (!answer.judgement.hypotheses.empty() &&
        (likeliest == nullptr || answer.judgement.probability > likeliest->judgement.probability))
      likeliest = &answer;
  if (likeliest != nullptr)
    doubt_as(verdict, likeliest->judgement, likeliest->judgement.evidence.overlap, Reason::little_evidence);
  return {};
}

}  // namespace mapweave::fusion
