#include "pair_data.h"

#include <mapweave/maps/reasons.h>

#include <algorithm>

namespace mapweave::report {
namespace {

// Up to the first number, pairs (of 20 robots) have all their hypotheses on the page; up to the second one (of 55) the
// first hypothesis; beyond, the decision alone: what keeps the page small.
constexpr std::size_t kFewPairs = 200, kManyPairs = 1500;
constexpr std::size_t kMostContradictions = 5;  // of a hypothesis, the longest first

void copy(const Json& from, Json& to, std::initializer_list<const char*> keys) {
  for (const char* key : keys)
    if (const auto found = from.find(key); found != from.end() && !found->is_null()) to[key] = *found;
}

Json hypothesis_json(const Json& reported) {
  Json hypothesis = Json::object();
  copy(reported, hypothesis,
       {"sense", "b_from_a", "probability", "matches", "coinciding_m", "distinctive_m", "wider_m", "contradicted_m",
        "unclear_m", "by_chance_m", "support_m", "overlap", "elsewhere"});
  if (reported.value("taken_apart", false)) hypothesis["taken_apart"] = true;
  Json places = reported.value("contradictions", Json::array());
  if (places.size() > kMostContradictions) places.erase(places.begin() + kMostContradictions, places.end());
  if (!places.empty()) hypothesis["contradictions"] = rounded(places, 2);
  return rounded(hypothesis, 4);
}

std::string what_helps_of(const std::string& reason) {
  for (int i = 0; i <= static_cast<int>(kLastReason); ++i)
    if (to_text(static_cast<Reason>(i)) == reason) return std::string(what_helps(static_cast<Reason>(i)));
  return {};
}

Json pair_json(const Json& verdict, std::size_t pairs) {
  Json pair = Json::object();
  copy(verdict, pair, {"tier", "a", "b", "decision", "reason", "because", "in_one_map"});
  if (pairs > kManyPairs) return pair;
  copy(verdict, pair, {"words", "detail", "connected_through", "team_b_from_a", "b_from_a"});
  for (const char* transform : {"team_b_from_a", "b_from_a"})
    if (pair.contains(transform)) pair[transform] = rounded(pair[transform], 4);
  if (const auto prior = verdict.find("prior"); prior != verdict.end() && prior->is_object())
    pair["prior"] = prior->value("because", "");
  if (!verdict.value("accepted", false) && !verdict.value("in_one_map", false))
    pair["helps"] = what_helps_of(verdict.value("reason", ""));
  Json hypotheses = Json::array();
  const Json reported = verdict.value("hypotheses", Json::array());
  for (std::size_t i = 0; i < std::min(reported.size(), pairs > kFewPairs ? std::size_t{1} : reported.size()); ++i)
    hypotheses.push_back(hypothesis_json(reported[i]));
  if (!hypotheses.empty()) {
    pair["hypotheses"] = hypotheses;
    pair.erase("b_from_a");
  }
  return pair;
}

}  // namespace

Json pairs_json(const Json& merges) {
  Json pairs = Json::array();
  for (const Json& verdict : merges) pairs.push_back(pair_json(verdict, merges.size()));
  return pairs;
}

}  // namespace mapweave::report
