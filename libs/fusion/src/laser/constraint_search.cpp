#include "constraint_search.h"

#include <mapweave/maps/alignment.h>
#include <mapweave/maps/map_noise.h>

#include <Eigen/LU>
#include <algorithm>
#include <set>

namespace mapweave::fusion {
namespace {

constexpr double kThorough_m = 15.0;    // radius of windows that are searched for what little two submaps share
constexpr std::size_t kBeside = 6;      // submaps from a match along both trajectories where another may confirm it
constexpr std::size_t kLookBeside = 2;  // submaps from a match along both trajectories that are looked up by it
constexpr double kBesideRadius_m = 1.0, kBesideYaw_rad = 0.1;  // around what a match beside says
constexpr std::size_t kFewestLooks = 6;                        // before what contradicts may end the search
constexpr int kFruitless = 4;                                  // rounds without a new match that end the last search

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

namespace {

// One search, with what it has found so far.
class Search {
 public:
  // All outlive it.
  Search(const std::vector<PreparedMap>& maps, const SubmapGraph& graph, SubmapJudge& judge,
         const std::vector<std::size_t>& members, const SubmapsInScope& in_scope, SearchExtent extent)
      : maps_(maps),
        graph_(graph),
        judge_(judge),
        members_(members),
        in_scope_(in_scope),
        extent_(extent),
        is_final_(extent == SearchExtent::final) {}

  ConstraintSearchResult run(std::vector<SubmapMatch> matches, int most_rounds) {
    result_.matches = std::move(matches);
    settle();
    const auto given = static_cast<std::size_t>(
        std::count_if(result_.matches.begin(), result_.matches.end(),
                      [&](const SubmapMatch& m) { return in_scope_(std::min(m.from, m.to), std::max(m.from, m.to)); }));
    if (extent_ == SearchExtent::alike && !look_at_alike()) return std::move(result_);
    const bool may_give_up = extent_ == SearchExtent::quick || is_final_;
    // In the last search narrow and wide windows take turns once they find nothing new: narrow ones are many, and
    // rounds are few.
    bool widen = false;
    int fruitless = 0;  // rounds, since the last match
    for (int round = 0; round < most_rounds; ++round) {
      graph::RelativeCovariance covariance = result_.solved.covariance();
      SearchCandidates candidates(maps_, graph_, in_scope_, result_.solved, covariance, examined_);
      bool is_wide = widen;
      std::vector<SubmapQuestion> questions = is_wide ? widened(candidates) : candidates.narrow();
      if (questions.empty()) {
        is_wide = !is_wide;
        questions = is_wide ? widened(candidates) : candidates.narrow();
      }
      if (questions.empty()) break;
      const std::size_t already_waiting = waiting_.size();
      bool any = ask(questions, is_wide);
      if (is_final_) look_beside(already_waiting);
      any = confirm(covariance) || any;
      if (any) settle();
      fruitless = any ? 0 : fruitless + 1;
      if (is_final_ && fruitless == kFruitless) break;
      widen = is_final_ && !any && !is_wide;
      if (may_give_up && !is_wide && result_.supporting + result_.contradicting >= kFewestLooks &&
          result_.contradicting > 2 * (result_.supporting + given) + 2) {
        result_.is_hopeless = true;
        break;
      }
    }
    return std::move(result_);
  }

 private:
  // Keeps the matches that hold.
  void settle() {
    result_.solved = graph_.solve(members_, result_.matches);
    std::vector<SubmapMatch> kept;
    for (std::size_t k = 0; k < result_.matches.size(); ++k)
      if (result_.solved.match_weight[k] > 0.5) kept.push_back(result_.matches[k]);
    result_.matches = std::move(kept);
    result_.solved.match_weight.assign(result_.matches.size(), 1.0);
  }

  std::vector<SubmapQuestion> widened(SearchCandidates& candidates) const {
    std::vector<SubmapQuestion> wide = candidates.wide(kWidest_m);
    return wide.empty() && is_final_ ? candidates.wide(kWidestFinal_m) : wide;
  }

  // Matches of narrow windows are believed, those of wide ones wait. True: some are believed.
  bool ask(std::vector<SubmapQuestion>& questions, bool is_wide) {
    for (SubmapQuestion& question : questions) {
      if (is_final_ && is_wide && question.from_from_to.radius_m <= kThorough_m) question.wanted = Thoroughness::part;
      examined_[{question.from, question.to}] = {question.from_from_to.a_from_b, question.from_from_to.radius_m};
    }
    bool any = false;
    for (SubmapAnswer& answer : judge_.ask(questions)) {
      if (!is_wide) {
        if (answer.holds)
          ++result_.supporting;
        else if (answer.judgement.doubt == Reason::contradiction || answer.judgement.doubt == Reason::inconsistent)
          ++result_.contradicting;
      }
      if (!answer.holds) continue;
      any = any || !is_wide;
      (is_wide ? waiting_ : result_.matches).push_back(answer.hypotheses.front());
    }
    return any;
  }

  // True: some places that look alike were found to be the same.
  bool look_at_alike() {
    graph::RelativeCovariance covariance = result_.solved.covariance();
    SearchCandidates candidates(maps_, graph_, in_scope_, result_.solved, covariance, examined_);
    std::vector<SubmapQuestion> questions = candidates.alike();
    ask(questions, true);
    waiting_.erase(std::remove_if(waiting_.begin(), waiting_.end(),
                                  [&](const SubmapMatch& match) { return !candidates.may_be(match); }),
                   waiting_.end());
    look_beside(0);
    if (!confirm(covariance)) return false;
    settle();
    return true;
  }

  // What a match of a wide window says of the submaps around its own, looked up there: too little of these may be
  // shared for the wide window.
  void look_beside(std::size_t first) {
    std::set<std::pair<std::size_t, std::size_t>> known;
    for (const SubmapMatch& match : waiting_) known.insert({match.from, match.to});
    const auto own_pose = [&](std::size_t s) { return maps_[graph_.map_of(s)].map_from_submap[graph_.submap_of(s)]; };
    const auto around = [&](std::size_t s) {
      const std::size_t begin = graph_.first_of(graph_.map_of(s)), end = begin + maps_[graph_.map_of(s)].submaps.size();
      return std::make_pair(std::max(begin + kLookBeside, s) - kLookBeside, std::min(end, s + kLookBeside + 1));
    };
    std::vector<SubmapQuestion> questions;
    for (std::size_t k = first; k < waiting_.size(); ++k) {
      const SubmapMatch& match = waiting_[k];
      const auto from = around(match.from), to = around(match.to);
      for (std::size_t i = from.first; i < from.second; ++i)
        for (std::size_t j = to.first; j < to.second; ++j) {
          if (i >= j || !in_scope_(i, j) || graph_.is_constrained(i, j) || !known.insert({i, j}).second) continue;
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
      if (answer.holds) waiting_.push_back(answer.hypotheses.front());
  }

  // A match of a wide window is believed once another one beside it says the same, and says it well. True: some are.
  bool confirm(graph::RelativeCovariance& covariance) {
    std::vector<char> confirmed(waiting_.size(), false);
    for (std::size_t a = 0; a < waiting_.size(); ++a) {
      const auto agrees = [&](const SubmapMatch& other) { return agree(waiting_[a], other, covariance); };
      confirmed[a] = std::any_of(waiting_.begin(), waiting_.end(), agrees) ||
                     std::any_of(result_.matches.begin(), result_.matches.end(), agrees);
    }
    std::vector<SubmapMatch> still_waiting;
    for (std::size_t a = 0; a < waiting_.size(); ++a)
      (confirmed[a] ? result_.matches : still_waiting).push_back(waiting_[a]);
    const bool any = still_waiting.size() < waiting_.size();
    waiting_ = std::move(still_waiting);
    return any;
  }

  // Whether the other one, which lies beside it, says the same.
  bool agree(const SubmapMatch& match, const SubmapMatch& other, graph::RelativeCovariance& covariance) const {
    return (other.from != match.from || other.to != match.to) && fixes_position(other) &&
           apart(other.from, match.from) <= kBeside && apart(other.to, match.to) <= kBeside &&
           graph_.map_of(other.from) == graph_.map_of(match.from) &&
           graph_.map_of(other.to) == graph_.map_of(match.to) &&
           inconsistency(match, other, result_.solved, covariance, result_.solved, covariance) < kConsistent;
  }

  const std::vector<PreparedMap>& maps_;
  const SubmapGraph& graph_;
  SubmapJudge& judge_;
  const std::vector<std::size_t>& members_;
  const SubmapsInScope& in_scope_;
  SearchExtent extent_;
  bool is_final_;
  ConstraintSearchResult result_;
  ExaminedPairs examined_;
  std::vector<SubmapMatch> waiting_;  // of wide windows, that nothing confirmed yet
};

}  // namespace

ConstraintSearchResult ConstraintSearch::run(const std::vector<std::size_t>& members, std::vector<SubmapMatch> matches,
                                             const SubmapsInScope& in_scope, int most_rounds, SearchExtent extent) {
  return Search(maps_, graph_, judge_, members, in_scope, extent).run(std::move(matches), most_rounds);
}

}  // namespace mapweave::fusion
