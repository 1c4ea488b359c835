// What is asked about pairs of maps, and of which pairs first.

#include "laser_team.h"

#include "early_end.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::fusion {
namespace {

// Of one map with others, those most alike: looked at together, before the next ones; in the first round; in each later
// one.
constexpr std::size_t kAtOnce = 3, kMostAtFirst = 12, kMostLater = 6;
constexpr std::size_t kBesidePrior = 16;  // questions of a pair that a prior is compared with, at first

}  // namespace

// All around, with the middles of the walls on each other.
matching::WideWindow LaserMerger::window_for(std::size_t map_a, std::size_t a, std::size_t map_b, std::size_t b) const {
  const auto in_submap = [](const PreparedMap& map, std::size_t s) {
    return compose(inverse(map.map_from_submap[s]), Pose2{map.centres[s].x, map.centres[s].y, 0.0});
  };
  const Pose2 centre_a = in_submap(maps_[map_a], a), centre_b = in_submap(maps_[map_b], b);
  matching::WideWindow window;
  window.a_from_b = {centre_a.x - centre_b.x, centre_a.y - centre_b.y, 0.0};
  window.radius_m = wide_radius_m(static_cast<double>(maps_[map_a].radii_m[a] + maps_[map_b].radii_m[b]));
  window.yaw_rad = M_PI;
  return window;
}

std::vector<SubmapQuestion> LaserMerger::first_questions(std::size_t a, std::size_t b) const {
  if (grids_.pair(a, b) != nullptr) return {};
  const PreparedMap &one = maps_[a], &other = maps_[b];
  std::vector<std::tuple<double, Hash, Hash, std::size_t, std::size_t>> ranked;
  const auto best_of = [&](const PreparedMap& from, const PreparedMap& to, bool swapped) {
    for (const auto i : from.representatives) {
      std::vector<std::tuple<double, Hash, std::size_t>> alike;
      for (const auto j : to.representatives)
        alike.emplace_back(matching::ring_distance(from.keys[i], to.keys[j]) +
                               matching::ring_distance(from.far_keys[i], to.far_keys[j]),
                           to.fingerprints[j], j);
      std::sort(alike.begin(), alike.end());
      if (alike.size() > static_cast<std::size_t>(options_.candidates_per_submap))
        alike.resize(static_cast<std::size_t>(options_.candidates_per_submap));
      for (const auto& [value, print, j] : alike) {
        const auto prints = std::minmax(from.fingerprints[i], print);
        ranked.emplace_back(value, prints.first, prints.second, swapped ? j : i, swapped ? i : j);
      }
    }
  };
  best_of(one, other, false);
  best_of(other, one, true);
  std::sort(ranked.begin(), ranked.end());
  ranked.erase(std::unique(ranked.begin(), ranked.end()), ranked.end());
  if (ranked.size() > static_cast<std::size_t>(options_.most_pairs))
    ranked.resize(static_cast<std::size_t>(options_.most_pairs));
  std::vector<SubmapQuestion> questions;
  for (const auto& entry : ranked) {
    const std::size_t i = std::get<3>(entry), j = std::get<4>(entry);
    questions.push_back({graph_.number(a, i), graph_.number(b, j), window_for(a, i, b, j)});
  }
  return questions;
}

double LaserMerger::unlikeness(const std::vector<SubmapQuestion>& questions) const {
  double sum = 0.0;
  const std::size_t count = std::min(kFirstRound, questions.size());
  for (std::size_t k = 0; k < count; ++k) {
    const PreparedMap &one = maps_[graph_.map_of(questions[k].from)], &other = maps_[graph_.map_of(questions[k].to)];
    const std::size_t i = graph_.submap_of(questions[k].from), j = graph_.submap_of(questions[k].to);
    sum += matching::ring_distance(one.keys[i], other.keys[j]) +
           matching::ring_distance(one.far_keys[i], other.far_keys[j]);
  }
  return count == 0 ? 1e300 : sum / static_cast<double>(count);
}

// Of the pairs of maps that are not in one team and were not asked in this round: with each map those that are most
// like it. In a large team a map need not be compared with all others: who knows the neighbours of its neighbours finds
// them by the graph.
std::vector<LaserMerger::MapPair> LaserMerger::next_pairs(bool is_first, std::set<MapPair>& asked) const {
  std::vector<std::size_t> times(maps_.size(), 0), now(maps_.size(), 0);
  std::vector<std::pair<double, MapPair>> open;
  for (const auto& [pair, state] : pairs_) {
    if (asked.count(pair) != 0) {
      ++times[pair.first];
      ++times[pair.second];
      continue;
    }
    if (state.open.empty() || refused_.count(pair) != 0) continue;
    if (team_of(pair.first) != nullptr && team_of(pair.first) == team_of(pair.second)) continue;
    if (merged_.are_together(pair.first, pair.second)) continue;
    open.emplace_back(state.unlikeness, pair);
  }
  std::sort(open.begin(), open.end());
  const std::size_t most = is_first ? kMostAtFirst : kMostLater;
  const auto may_ask = [&](std::size_t map) { return now[map] < kAtOnce && times[map] < most; };
  std::vector<MapPair> next;
  for (const auto& [unlikeness, pair] : open) {
    if ((!may_ask(pair.first) && !may_ask(pair.second)) || is_known_to_repeat(pair)) continue;
    for (const std::size_t map : {pair.first, pair.second}) {
      ++now[map];
      ++times[map];
    }
    next.push_back(pair);
  }
  asked.insert(next.begin(), next.end());
  return next;
}

// They are no longer open then.
std::vector<SubmapQuestion> LaserMerger::next_questions(PairState& state, std::size_t count) const {
  const std::size_t wanted = state.of_prior > 0 ? std::max(count, kBesidePrior) + state.of_prior : count;
  const auto end = state.open.begin() + static_cast<std::ptrdiff_t>(std::min(wanted, state.open.size()));
  state.of_prior = 0;
  std::vector<SubmapQuestion> next(state.open.begin(), end);
  state.open.erase(state.open.begin(), end);
  return next;
}

// The next questions of some pairs of maps; false when none is left.
bool LaserMerger::ask_more(std::size_t count, std::set<MapPair>& asked) {
  if (is_over(input_)) return false;
  std::vector<SubmapQuestion> questions;
  std::vector<PairState*> whose;
  for (const MapPair& pair : next_pairs(count == kFirstRound, asked)) {
    PairState& state = pairs_.at(pair);
    for (const SubmapQuestion& question : next_questions(state, count)) {
      questions.push_back(question);
      whose.push_back(&state);
    }
  }
  if (questions.empty()) return false;
  std::vector<SubmapAnswer> answers = judge_.ask(questions);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    // Who forbids a judgement of two maps forbids that they are matched: what it found, others would find again.
    if (input_.vetoed.count(answers[i].judgement.id) != 0) {
      const MapPair pair = std::minmax(graph_.map_of(answers[i].from), graph_.map_of(answers[i].to));
      refused_.insert(pair);
      vetoed_.insert(pair);
    }
    answered_.insert(std::minmax(graph_.map_of(answers[i].from), graph_.map_of(answers[i].to)));
    whose[i]->answers.push_back(std::move(answers[i]));
  }
  for (const MapPair& pair : vetoed_) pairs_[pair].answers.clear();
  return true;
}

// Questions of the next proposer about maps that stayed apart, of each with those most like it. False where all were
// asked.
bool LaserMerger::propose_next() {
  std::vector<std::tuple<Proposer, double, MapPair>> apart;
  for (const auto& [pair, state] : pairs_)
    if (state.last < options_.last_proposer && refused_.count(pair) == 0 && !grids_.is_grid(pair.first) &&
        !grids_.is_grid(pair.second) && team_of(pair.first) != team_of(pair.second) && !is_known_to_repeat(pair))
      apart.emplace_back(state.last, state.unlikeness, pair);
  if (apart.empty()) return false;
  std::sort(apart.begin(), apart.end());
  std::vector<std::size_t> times(maps_.size(), 0);
  bool any = false;
  const PoseOfSubmap as_mapped = [&](std::size_t map, std::size_t s) { return maps_[map].map_from_submap[s]; };
  for (const auto& entry : apart) {
    const auto& [a, b] = std::get<2>(entry);
    PairState& state = pairs_.at(std::get<2>(entry));
    state.last = state.last == Proposer::ring_keys ? Proposer::corners : Proposer::whole_maps;
    if (std::min(times[a], times[b]) >= kMostLater) continue;
    if (is_over(input_)) return false;
    ++times[a];
    ++times[b];
    const auto in_a = placed({a}, as_mapped), in_b = placed({b}, as_mapped);
    state.open = proposals_.questions(a, b, state.last, in_a, in_b, sight_of({&in_a, &in_b}));
    any = any || !state.open.empty();
  }
  return any || propose_next();
}

void LaserMerger::open_pairs() {
  for (std::size_t a = 0; a < maps_.size(); ++a)
    for (std::size_t b = a + 1; b < maps_.size(); ++b)
      if (!maps_[a].submaps.empty() && !maps_[b].submaps.empty() && refused_.count({a, b}) == 0) {
        PairState& state = pairs_[{a, b}];
        state.open = priors_.questions(a, b);
        state.of_prior = state.open.size();
        const auto others = first_questions(a, b);
        state.unlikeness = state.of_prior > 0 ? -1.0 : unlikeness(others);
        state.open.insert(state.open.end(), others.begin(), others.end());
      }
}

std::vector<SubmapQuestion> LaserMerger::first_questions_of_all() {
  open_pairs();
  std::set<MapPair> asked;
  std::vector<SubmapQuestion> all;
  for (const MapPair& pair : next_pairs(true, asked)) {
    const std::vector<SubmapQuestion> questions = next_questions(pairs_.at(pair), kFirstRound);
    all.insert(all.end(), questions.begin(), questions.end());
  }
  return all;
}

}  // namespace mapweave::fusion
