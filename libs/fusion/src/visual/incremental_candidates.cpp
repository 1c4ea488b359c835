#include "incremental_candidates.h"

#include <algorithm>

namespace mapweave::fusion {
namespace {

constexpr std::size_t kLookedUp = 48;  // keyframes of all maps, most alike first
constexpr std::size_t kOfTeamEach =
    3;  // one new keyframe in so many is compared within its team: it only has to say where it lies

}  // namespace

IncrementalCandidates::IncrementalCandidates(const std::vector<PreviousMerge>& teams, const std::deque<VisualMap>& maps,
                                             const ClaimedSightings& claimed, const VisualFusionOptions& options,
                                             WorkerPool& pool)
    : maps_(maps), claimed_(claimed), options_(options), is_any_(!teams.empty()), team_of_(maps.size(), nullptr) {
  if (!is_any_) return;
  matching::PlaceIndex index(options.vocabulary.get().words());
  for (std::size_t m = 0; m < maps.size(); ++m) {
    const auto team = std::find_if(teams.begin(), teams.end(), [&](const PreviousMerge& one) {
      return std::binary_search(one.members.begin(), one.members.end(), maps[m].map().id);
    });
    if (team != teams.end()) team_of_[m] = &*team;
    if (!maps[m].is_metric()) continue;
    for (const MappedKeyframe& keyframe : maps[m].keyframes()) index.add(keyframe.id, keyframe.words->bag);
  }
  const std::vector<KeyframeOfMap> asked = new_keyframes();
  const auto found = pool.map(asked.size(), [&](std::size_t i) { return most_alike(asked[i], index); });
  for (std::size_t i = 0; i < asked.size(); ++i)
    for (const KeyframeOfMap& other : found[i]) {
      const bool is_first = asked[i].map < other.map;
      const KeyframeOfMap &a = is_first ? asked[i] : other, &b = is_first ? other : asked[i];
      questions_[{a.map, b.map}].push_back({a.keyframe, b.keyframe});
    }
}

std::vector<IncrementalCandidates::KeyframeOfMap> IncrementalCandidates::new_keyframes() const {
  std::vector<KeyframeOfMap> result;
  for (std::size_t m = 0; m < maps_.size(); ++m)
    for (std::size_t k = 0; maps_[m].is_metric() && k < maps_[m].keyframes().size(); ++k)
      if (team_of_[m] == nullptr || !team_of_[m]->map_from_node.contains(maps_[m].keyframes()[k].id))
        result.push_back({m, k});
  return result;
}

std::vector<IncrementalCandidates::KeyframeOfMap> IncrementalCandidates::most_alike(
    const KeyframeOfMap& one, const matching::PlaceIndex& index) const {
  const MappedKeyframe& keyframe = maps_[one.map].keyframes()[one.keyframe];
  const int least = std::max(1, static_cast<int>(options_.least_alike * keyframe.likeness));
  const bool asks_team = one.keyframe % kOfTeamEach == 0;
  std::vector<KeyframeOfMap> of_team, of_others;
  const auto add = [&](std::vector<KeyframeOfMap>& chosen, const KeyframeOfMap& other, std::size_t most) {
    if (chosen.size() < most && std::none_of(chosen.begin(), chosen.end(), [&](const KeyframeOfMap& known) {
          return known.map == other.map && beside(maps_[other.map], known.keyframe, other.keyframe);
        }))
      chosen.push_back(other);
  };
  const auto choose = [&](const KeyframeOfMap& other) {
    if (is_of_team(one.map, other.map))
      add(of_team, other, asks_team ? 1 : 0);
    else
      add(of_others, other, static_cast<std::size_t>(options_.candidates));
  };
  for (const bool of_own : {true, false})
    if (const auto claim = claimed_.most_claimed(one.map, one.keyframe,
                                                 [&](std::size_t map) { return is_of_team(one.map, map) == of_own; }))
      choose({claim->first, claim->second});
  const auto map_of = [&](const NodeId& id) {
    const auto map = std::find_if(maps_.begin(), maps_.end(),
                                  [&](const VisualMap& m) { return m.number_of(id) < m.keyframes().size(); });
    return static_cast<std::size_t>(map - maps_.begin());
  };
  for (const matching::SimilarPlace& place : index.query(
           keyframe.words->bag, kLookedUp, [&](const NodeId& id) { return map_of(id) == one.map; }, least)) {
    const std::size_t map = map_of(place.id);
    choose({map, maps_[map].number_of(place.id)});
  }
  of_others.insert(of_others.end(), of_team.begin(), of_team.end());
  return of_others;
}

std::optional<VisualQuestions> IncrementalCandidates::questions(std::size_t a, std::size_t b) const {
  const auto is_anew = [&](std::size_t map) { return team_of_[map] != nullptr && team_of_[map]->is_adjusted_again; };
  const bool is_team = is_of_team(a, b);
  if (!is_any_ || !maps_[a].is_metric() || !maps_[b].is_metric() || (!is_team && (is_anew(a) || is_anew(b))))
    return std::nullopt;
  VisualQuestions result;
  result.is_incremental = true;
  result.is_doubted = !is_team || is_anew(a);
  if (const auto found = questions_.find({a, b}); found != questions_.end()) result.first = found->second;
  return result;
}

}  // namespace mapweave::fusion
