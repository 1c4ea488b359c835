#include "constraint_search.h"

#include <mapweave/maps/alignment.h>
#include <mapweave/maps/map_noise.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

namespace mapweave::fusion {
namespace {

constexpr double kNear_m = 6.0;       // between the middles of submaps that should show the same, at least
constexpr double kFarthest_m = 14.0;  // the same, where both see far
constexpr double kKnown_m = 0.07, kKnown_rad = 0.01;  // a match of what is known as well says nothing new
constexpr double kSure_m = 0.7;                       // standard deviation up to which a window is narrow
constexpr double kWidest_m = 6.0,
                 kWidestFinal_m = 1e3;     // standard deviation up to which a wide window is worth a search
constexpr double kFarthestReach_m = 50.0;  // of a window, however unsure: bounds time
constexpr double kThorough_m = 15.0;       // radius of windows that are searched for what little two submaps share
constexpr double kWindowSigmas = 3.0;      // 99 % of what is searched for
constexpr std::size_t kNearest = 2, kNearestWide = 1, kAlikeWide = 2;  // that a submap chooses; others choose it, too
constexpr std::size_t kBeside = 6;      // submaps from a match along both trajectories where another may confirm it
constexpr std::size_t kLookBeside = 2;  // submaps from a match along both trajectories that are looked up by it
constexpr double kBesideRadius_m = 1.0, kBesideYaw_rad = 0.1;  // around what a match beside says
constexpr std::size_t kFewestLooks = 6;                        // before what contradicts may end the search
constexpr int kFruitless = 4;                                  // rounds without a new match that end the last search

double position_sigma(const Eigen::Matrix3d& covariance) {
  const double half = 0.5 * (covariance(0, 0) + covariance(1, 1)),
               difference = 0.5 * (covariance(0, 0) - covariance(1, 1));
  return std::sqrt(std::max(0.0, half + std::sqrt(difference * difference + covariance(0, 1) * covariance(0, 1))));
}

// Of motions of a frame, as motions of a place of the team's frame that moves along with it.
Eigen::Matrix3d at_place(const Eigen::Matrix3d& covariance, const Pose2& team_from_frame,
                         const Eigen::Vector2d& place) {
  const Eigen::Matrix3d carry = adjoint(between(Pose2{place.x(), place.y(), 0.0}, team_from_frame));
  return carry * covariance * carry.transpose();
}

bool fixes_position(const SubmapMatch& match) {
  return match.is_observable && position_sigma(match.information.inverse()) <= kSure_m;
}

std::size_t apart(std::size_t one, std::size_t other) { return one > other ? one - other : other - one; }

}  // namespace

double inconsistency(const SubmapMatch& one, const SubmapMatch& other, const SolvedSubmaps& from_side,
                     graph::RelativeCovariance& from_covariance, const SolvedSubmaps& to_side,
                     graph::RelativeCovariance& to_covariance) {
  // Around the cycle: from -> other.from -> other.to -> to.
  const auto from = static_cast<std::uint32_t>(from_side.place_of(one.from)),
             other_from = static_cast<std::uint32_t>(from_side.place_of(other.from));
  const auto to = static_cast<std::uint32_t>(to_side.place_of(one.to)),
             other_to = static_cast<std::uint32_t>(to_side.place_of(other.to));
  const Pose2 there = between(from_side.team_from_submap[from], from_side.team_from_submap[other_from]);
  const Pose2 back = between(to_side.team_from_submap[other_to], to_side.team_from_submap[to]);
  const Pose2 rest = compose(other.from_from_to, back);
  const Pose2 error = between(one.from_from_to, compose(there, rest));
  const Eigen::Matrix3d carry_there = adjoint(inverse(rest)), carry_other = adjoint(inverse(back));
  const Eigen::Matrix3d floor = submap_bend_covariance();
  const Eigen::Matrix3d covariance = one.information.inverse() + floor +
                                     carry_other * (other.information.inverse() + floor) * carry_other.transpose() +
                                     carry_there * from_covariance.between(from, other_from) * carry_there.transpose() +
                                     to_covariance.between(other_to, to);
  const Eigen::Vector3d e(error.x, error.y, error.phi);
  return e.dot(covariance.ldlt().solve(e));
}

std::vector<ConstraintSearch::Candidate> ConstraintSearch::candidates(
    const SolvedSubmaps& solved, graph::RelativeCovariance& covariance,
    const std::function<bool(std::size_t, std::size_t)>& in_scope, double widest_m,
    const ExaminedPairs& examined) const {
  const bool is_wide = widest_m > 0.0;
  std::vector<Eigen::Vector2d> middles;
  for (std::size_t k = 0; k < solved.submaps.size(); ++k) {
    const std::size_t s = solved.submaps[k];
    middles.push_back(middle_of(maps_[graph_.map_of(s)], graph_.submap_of(s), solved.team_from_submap[k]));
  }
  const double reach = is_wide ? kFarthest_m + kFarthestReach_m : kFarthest_m;
  // Blocks, so that only what may be near is compared.
  std::map<std::pair<int, int>, std::vector<std::size_t>> blocks;
  const auto block_of = [&](const Eigen::Vector2d& p) {
    return std::make_pair(matching::cell_of(p.x(), 1.0 / reach), matching::cell_of(p.y(), 1.0 / reach));
  };
  for (std::size_t k = 0; k < middles.size(); ++k) blocks[block_of(middles[k])].push_back(k);
  struct Near {
    double distance, unlikeness;
    std::size_t place;
    double sigma_m, sigma_rad;
    bool operator<(const Near& other) const {
      return std::tie(distance, unlikeness, place) < std::tie(other.distance, other.unlikeness, other.place);
    }
  };
  std::vector<std::vector<Near>> near(middles.size());  // of each place: others, whichever robot comes first
  for (std::size_t kj = 0; kj < middles.size(); ++kj) {
    const std::size_t j = solved.submaps[kj];
    const PreparedMap& map_j = maps_[graph_.map_of(j)];
    const auto block = block_of(middles[kj]);
    for (int y = -1; y <= 1; ++y)
      for (int x = -1; x <= 1; ++x) {
        const auto found = blocks.find({block.first + x, block.second + y});
        if (found == blocks.end()) continue;
        for (const std::size_t ki : found->second) {
          if (ki >= kj) continue;
          const std::size_t i = solved.submaps[ki];
          const double distance = (middles[ki] - middles[kj]).norm();
          const PreparedMap& map_i = maps_[graph_.map_of(i)];
          const double extent = 0.6 * (std::min(12.0, static_cast<double>(map_i.radii_m[graph_.submap_of(i)])) +
                                       std::min(12.0, static_cast<double>(map_j.radii_m[graph_.submap_of(j)])));
          const double near_m = std::clamp(extent, kNear_m, kFarthest_m);
          if (distance > (is_wide ? reach : near_m) || !in_scope(i, j) || graph_.is_constrained(i, j)) continue;
          const Eigen::Matrix3d apart_by =
              covariance.between(static_cast<std::uint32_t>(ki), static_cast<std::uint32_t>(kj));
          // At the walls of either, not where a submap happens to begin.
          const Pose2& there = solved.team_from_submap[kj];
          const double sigma_m = std::max(position_sigma(at_place(apart_by, there, middles[ki])),
                                          position_sigma(at_place(apart_by, there, middles[kj])));
          const double sigma_rad = std::sqrt(apart_by(2, 2));
          if (is_wide ? (sigma_m <= kSure_m || sigma_m > widest_m ||
                         distance > near_m + std::min(kFarthestReach_m, 2.5 * sigma_m))
                      : (sigma_m > kSure_m || (sigma_m < kKnown_m && sigma_rad < kKnown_rad)))
            continue;
          const auto before = examined.find({i, j});
          if (before != examined.end()) {
            const Pose2 moved =
                between(before->second.expected, between(solved.team_from_submap[ki], solved.team_from_submap[kj]));
            if (std::hypot(moved.x, moved.y) < 0.5 * before->second.radius_m && std::abs(moved.phi) < 0.1) continue;
          }
          const double unlikeness =
              is_wide ? matching::ring_distance(map_i.keys[graph_.submap_of(i)], map_j.keys[graph_.submap_of(j)]) +
                            matching::ring_distance(map_i.far_keys[graph_.submap_of(i)],
                                                    map_j.far_keys[graph_.submap_of(j)])
                      : 0.0;
          near[kj].push_back({distance, unlikeness, ki, sigma_m, sigma_rad});
          near[ki].push_back({distance, unlikeness, kj, sigma_m, sigma_rad});
        }
      }
  }
  std::map<std::pair<std::size_t, std::size_t>, const Near*> chosen;  // by place, the lower first
  const auto choose = [&](std::size_t place, const Near& other) {
    chosen.emplace(std::minmax(place, other.place), &other);
  };
  // Where hardly anything is known, the nearest are no better than others.
  const std::size_t nearest = is_wide ? (widest_m > kWidest_m ? 0 : kNearestWide) : kNearest;
  for (std::size_t place = 0; place < near.size(); ++place) {
    std::sort(near[place].begin(), near[place].end());
    const std::size_t some = std::min(nearest, near[place].size());
    for (std::size_t k = 0; k < some; ++k) choose(place, near[place][k]);
    if (!is_wide) continue;
    std::vector<std::pair<double, std::size_t>> alike;
    for (std::size_t k = some; k < near[place].size(); ++k) alike.emplace_back(near[place][k].unlikeness, k);
    std::sort(alike.begin(), alike.end());
    for (std::size_t k = 0; k < std::min(kAlikeWide, alike.size()); ++k) choose(place, near[place][alike[k].second]);
  }
  std::vector<Candidate> result;
  for (const auto& [pair, between_them] : chosen) {
    matching::WideWindow window;
    window.a_from_b = between(solved.team_from_submap[pair.first], solved.team_from_submap[pair.second]);
    window.radius_m = std::clamp(kWindowSigmas * between_them->sigma_m, 0.5, kFarthestReach_m);
    window.yaw_rad = std::min(M_PI, 0.04 + kWindowSigmas * between_them->sigma_rad);
    result.push_back({{solved.submaps[pair.first], solved.submaps[pair.second], window}, !is_wide});
  }
  return result;
}

// What a match of a wide window says of the submaps around its own, looked up there: too little of these may be shared
// for the wide window.
void ConstraintSearch::look_beside(std::vector<SubmapMatch>& waiting, std::size_t first,
                                   const std::function<bool(std::size_t, std::size_t)>& in_scope) const {
  std::set<std::pair<std::size_t, std::size_t>> known;
  for (const SubmapMatch& match : waiting) known.insert({match.from, match.to});
  const auto own_pose = [&](std::size_t s) { return maps_[graph_.map_of(s)].map_from_submap[graph_.submap_of(s)]; };
  const auto around = [&](std::size_t s) {
    const std::size_t begin = graph_.first_of(graph_.map_of(s)), end = begin + maps_[graph_.map_of(s)].submaps.size();
    return std::make_pair(std::max(begin + kLookBeside, s) - kLookBeside, std::min(end, s + kLookBeside + 1));
  };
  std::vector<SubmapQuestion> questions;
  for (std::size_t k = first; k < waiting.size(); ++k) {
    const SubmapMatch& match = waiting[k];
    const auto from = around(match.from), to = around(match.to);
    for (std::size_t i = from.first; i < from.second; ++i)
      for (std::size_t j = to.first; j < to.second; ++j) {
        if (i >= j || !in_scope(i, j) || graph_.is_constrained(i, j) || !known.insert({i, j}).second) continue;
        SubmapQuestion question{i, j, {}, Thoroughness::least_part};
        question.from_from_to.a_from_b =
            compose(compose(between(own_pose(i), own_pose(match.from)), match.from_from_to),
                    between(own_pose(match.to), own_pose(j)));
        question.from_from_to.radius_m = kBesideRadius_m;
        question.from_from_to.yaw_rad = kBesideYaw_rad;
        questions.push_back(question);
      }
  }
  for (SubmapAnswer& answer : judge_.ask(questions))
    if (answer.holds) waiting.push_back(answer.hypotheses.front());
}

ConstraintSearchResult ConstraintSearch::run(const std::vector<std::size_t>& members, std::vector<SubmapMatch> matches,
                                             const std::function<bool(std::size_t, std::size_t)>& in_scope,
                                             int most_rounds, bool is_final) {
  ConstraintSearchResult result;
  ExaminedPairs examined;
  std::vector<SubmapMatch> waiting;  // of wide windows, that nothing confirmed yet
  const auto settle = [&] {
    result.solved = graph_.solve(members, matches);
    std::vector<SubmapMatch> kept;
    std::vector<double> weights;
    for (std::size_t k = 0; k < matches.size(); ++k)
      if (result.solved.match_weight[k] > 0.5) kept.push_back(matches[k]);
    matches = std::move(kept);
    result.solved.match_weight.assign(matches.size(), 1.0);
  };
  settle();
  const std::size_t given = matches.size();
  // In the last search narrow and wide windows take turns once they find nothing new: narrow ones are many, and rounds
  // are few.
  bool widen = false;
  int fruitless = 0;  // rounds, since the last match
  for (int round = 0; round < most_rounds; ++round) {
    graph::RelativeCovariance covariance = result.solved.covariance();
    bool is_wide = widen;
    const auto widened = [&] {
      std::vector<Candidate> wide = candidates(result.solved, covariance, in_scope, kWidest_m, examined);
      return wide.empty() && is_final ? candidates(result.solved, covariance, in_scope, kWidestFinal_m, examined)
                                      : wide;
    };
    std::vector<Candidate> found = is_wide ? widened() : candidates(result.solved, covariance, in_scope, 0.0, examined);
    if (found.empty()) {
      is_wide = !is_wide;
      found = is_wide ? widened() : candidates(result.solved, covariance, in_scope, 0.0, examined);
    }
    if (found.empty()) break;
    std::vector<SubmapQuestion> questions;
    for (const Candidate& candidate : found) {
      questions.push_back(candidate.question);
      if (is_final && is_wide && candidate.question.from_from_to.radius_m <= kThorough_m)
        questions.back().wanted = Thoroughness::part;
      examined[{candidate.question.from, candidate.question.to}] = {candidate.question.from_from_to.a_from_b,
                                                                    candidate.question.from_from_to.radius_m};
    }
    bool any = false;
    const std::size_t already_waiting = waiting.size();
    for (SubmapAnswer& answer : judge_.ask(questions)) {
      if (!is_wide) {
        if (answer.holds)
          ++result.supporting;
        else if (answer.judgement.doubt == Reason::contradiction || answer.judgement.doubt == Reason::inconsistent)
          ++result.contradicting;
      }
      if (!answer.holds) continue;
      if (is_wide)
        waiting.push_back(answer.hypotheses.front());
      else
        matches.push_back(answer.hypotheses.front()), any = true;
    }
    if (is_final) look_beside(waiting, already_waiting, in_scope);
    // A match of a wide window is believed once another one beside it says the same, and says it well.
    std::vector<SubmapMatch> still_waiting;
    std::vector<char> confirmed(waiting.size(), false);
    for (std::size_t a = 0; a < waiting.size(); ++a) {
      const auto agrees = [&](const SubmapMatch& other) {
        return (other.from != waiting[a].from || other.to != waiting[a].to) && fixes_position(other) &&
               apart(other.from, waiting[a].from) <= kBeside && apart(other.to, waiting[a].to) <= kBeside &&
               graph_.map_of(other.from) == graph_.map_of(waiting[a].from) &&
               graph_.map_of(other.to) == graph_.map_of(waiting[a].to) &&
               inconsistency(waiting[a], other, result.solved, covariance, result.solved, covariance) < kConsistent;
      };
      confirmed[a] =
          std::any_of(waiting.begin(), waiting.end(), agrees) || std::any_of(matches.begin(), matches.end(), agrees);
    }
    for (std::size_t a = 0; a < waiting.size(); ++a) {
      if (confirmed[a])
        matches.push_back(waiting[a]), any = true;
      else
        still_waiting.push_back(waiting[a]);
    }
    waiting = std::move(still_waiting);
    if (any) settle();
    fruitless = any ? 0 : fruitless + 1;
    if (is_final && fruitless == kFruitless) break;
    widen = is_final && !any && !is_wide;
    if (!is_wide && result.supporting + result.contradicting >= kFewestLooks &&
        result.contradicting > 2 * (result.supporting + given) + 2) {
      result.is_hopeless = true;
      break;
    }
  }
  result.matches = std::move(matches);
  return result;
}

}  // namespace mapweave::fusion
