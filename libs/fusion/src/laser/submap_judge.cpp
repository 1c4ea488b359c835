#include "submap_judge.h"

#include "early_end.h"

#include <mapweave/maps/alignment.h>

#include <Eigen/LU>
#include <algorithm>
#include <numeric>
#include <tuple>

namespace mapweave::fusion {
namespace {

// Of the best: a rival that is less good is no second hypothesis, although the last search of a team looks at rivals
// down to half as good (DECISIONS.md, 64).
constexpr double kAsGood = 0.8;

// Where the graph says where a submap lies, less of it need be found for a match to be weighed: robots that pass in
// opposite directions see little of the same.
constexpr double kNarrow_m = 2.5, kPartScore = 0.5, kLeastPartScore = 0.2;
// Where both maps lie on each other as a whole, a match need not convince by itself: it only says how exactly they lie
// there.
constexpr double kKnownPartScore = 0.7, kKnownPartConflict = 0.15, kKnownPartContradiction_m = 2.0;

matching::JudgeOptions options_for(const SubmapQuestion& question, matching::JudgeOptions options) {
  const matching::WideWindow& window = question.from_from_to;
  if (window.known_part) {
    options.min_score *= kKnownPartScore;
    options.max_conflict = std::max(options.max_conflict, kKnownPartConflict);
    options.max_contradiction_m = std::max(options.max_contradiction_m, kKnownPartContradiction_m);
    options.second_verifier = false;
  } else if (question.wanted == Thoroughness::least_part) {
    options.min_score *= kLeastPartScore;
  } else if (question.wanted == Thoroughness::part || window.radius_m <= kNarrow_m) {
    options.min_score *= kPartScore;
  }
  // In a wide window a corridor that is laid along itself scores more than what little is shared at its end.
  if (question.wanted == Thoroughness::part) options.rival_ratio *= kPartScore;
  return options;
}

const Submap& submap_of(const PreparedMap& map, std::size_t submap) { return *map.submaps[submap]; }

// In which order questions are answered, so that few submaps are needed at a time: a block of submaps on the one side
// stays, those on the other come one after the other.
std::vector<std::size_t> by_blocks(const std::vector<SubmapQuestion>& questions) {
  constexpr std::size_t kBlock = 64;  // submaps that stay ready while others pass: speed, never content
  const auto key = [&](std::size_t i) {
    const SubmapQuestion& q = questions[i];
    return std::make_tuple(q.from / kBlock, q.to, q.from, i);
  };
  std::vector<std::size_t> order(questions.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t l, std::size_t r) { return key(l) < key(r); });
  return order;
}

}  // namespace

std::string to_text(Proposer proposer) {
  static constexpr const char* kNames[] = {"prior", "ring keys", "corners", "whole maps"};
  return kNames[static_cast<std::size_t>(proposer)];
}

std::shared_ptr<const WallSight> SubmapJudge::made(std::size_t submap) const {
  const PreparedMap& map = maps_[graph_.map_of(submap)];
  const Submap& known = submap_of(map, graph_.submap_of(submap));
  if (input_.sights)
    if (auto kept = input_.sights->find(known.content)) return kept;
  auto sight = std::make_shared<const WallSight>(*cache_.get(known, map.map->nodes));
  if (input_.sights) input_.sights->add(known.content, sight);
  return sight;
}

std::shared_ptr<const WallSight> SubmapJudge::sight(std::size_t submap) {
  auto sight = sights_.find(submap);
  if (sight == nullptr) {
    sight = made(submap);
    sights_.add(submap, sight);
  }
  return sight;
}

void SubmapJudge::prepare_sights(const std::vector<std::size_t>& submaps) {
  std::vector<std::size_t> missing;
  for (const std::size_t submap : submaps)
    if (sights_.find(submap) == nullptr) missing.push_back(submap);
  constexpr std::size_t kAtOnce = 32;  // between looks at whether the cache is full, or an interruption came
  for (std::size_t first = 0; first < missing.size() && !sights_.is_full(); first += kAtOnce) {
    is_over(input_);  // what was found still has to be decided with them
    const auto sights =
        pool_.map(std::min(kAtOnce, missing.size() - first), [&](std::size_t i) { return made(missing[first + i]); });
    for (std::size_t i = 0; i < sights.size(); ++i) sights_.add(missing[first + i], sights[i]);
  }
}

SubmapAnswer SubmapJudge::answer_of(const SubmapQuestion& question, const Judgement& judgement) const {
  SubmapAnswer answer{question.from, question.to, judgement, {}, false, question.proposer};
  if (vetoed_.count(judgement.id) != 0) return answer;
  const bool is_sure = judgement.doubt == Reason::none;
  if (!is_sure && judgement.doubt != Reason::ambiguous && judgement.doubt != Reason::unobservable) return answer;
  const PreparedMap &from = maps_[graph_.map_of(question.from)], &to = maps_[graph_.map_of(question.to)];
  const bool swapped =
      submap_of(to, graph_.submap_of(question.to)).id < submap_of(from, graph_.submap_of(question.from)).id;
  const double probability = is_sure ? judgement.probability : judgement.probability / kProbabilityOfDoubt;
  for (std::size_t k = 0; k < judgement.hypotheses.size(); ++k) {
    const Alignment alignment = swapped ? inverse(judgement.hypotheses[k]) : judgement.hypotheses[k];
    SubmapMatch match;
    match.from = question.from;
    match.to = question.to;
    match.from_from_to = planar(alignment.a_from_b.pose);
    // The judge's covariance is of a small motion of b in its own axes, as the graph's.
    match.information = planar(alignment.covariance).inverse();
    match.probability = k == 0 && judgement.doubt != Reason::ambiguous ? probability : 0.5 * probability;
    match.judgement = judgement.id;
    match.is_observable = judgement.doubt != Reason::unobservable;
    answer.hypotheses.push_back(match);
    if (judgement.doubt != Reason::ambiguous && judgement.evidence.second_best_ratio < kAsGood) break;
  }
  answer.holds =
      !answer.hypotheses.empty() && judgement.doubt != Reason::ambiguous && probability >= options_.min_probability;
  return answer;
}

std::vector<SubmapAnswer> SubmapJudge::ask(const std::vector<SubmapQuestion>& questions) {
  const std::vector<std::size_t> order = by_blocks(questions);
  std::vector<Judgement> judgements(questions.size());
  const auto judged = [&](const SubmapQuestion& question) {
    const std::size_t map_a = graph_.map_of(question.from), map_b = graph_.map_of(question.to);
    const std::size_t sa = graph_.submap_of(question.from), sb = graph_.submap_of(question.to);
    const Submap &a = submap_of(maps_[map_a], sa), &b = submap_of(maps_[map_b], sb);
    matching::WideWindow window = question.from_from_to;
    const bool swapped = b.id < a.id;
    if (swapped) window.a_from_b = inverse(window.a_from_b);
    const Submap &first = swapped ? b : a, &second = swapped ? a : b;
    const Hash &print_a = maps_[map_a].fingerprints[sa], &print_b = maps_[map_b].fingerprints[sb];
    const bool is_first_lower = swapped ? print_b < print_a : print_a < print_b;
    const auto field = is_first_lower ? matching::Field::a : matching::Field::b;
    const matching::JudgeOptions judge_options = options_for(question, options_.judge);
    const Hash id = matching::judgement_id(first.content, second.content, window, judge_options, field);
    const auto known = memo_.find(id);
    if (known != memo_.end()) return known->second;
    const auto& of_first = maps_[swapped ? map_b : map_a].map->nodes;
    const auto& of_second = maps_[swapped ? map_a : map_b].map->nodes;
    return matching::judge({first.id, first.content, cache_.get(first, of_first)},
                           {second.id, second.content, cache_.get(second, of_second)}, window, judge_options, field);
  };
  pool_.for_each(questions.size(), [&](std::size_t i) {
    if (!is_over(input_)) judgements[order[i]] = judged(questions[order[i]]);
  });
  if (is_over(input_)) return {};
  std::vector<SubmapAnswer> answers;
  answers.reserve(questions.size());
  for (std::size_t i = 0; i < questions.size(); ++i) {
    const Judgement& judgement = memo_.emplace(judgements[i].id, judgements[i]).first->second;
    asked_.push_back(judgement.id);
    answers.push_back(answer_of(questions[i], judgement));
  }
  return answers;
}

}  // namespace mapweave::fusion
