#include "claimed_sightings.h"

#include <algorithm>
#include <set>
#include <tuple>

namespace mapweave::fusion {
namespace {

constexpr std::size_t kLeastClaimed = 10;  // landmarks of one keyframe's, for a pair to be judged
constexpr std::size_t kMostPairs = 16;     // of two maps

auto order_of(const ClaimedSighting& claim) {
  return std::tie(claim.map, claim.keyframe, claim.map_of_landmark, claim.landmark);
}

}  // namespace

ClaimedSightings::ClaimedSightings(const std::vector<LandmarkChange>& borrowed, const std::deque<VisualMap>& maps)
    : maps_(maps) {
  if (borrowed.empty()) return;
  std::map<SessionId, std::set<std::size_t>> maps_of;
  for (std::size_t m = 0; m < maps.size(); ++m) {
    for (const MappedKeyframe& keyframe : maps[m].keyframes()) maps_of[keyframe.id.session].insert(m);
    for (const VisualMapLandmark& landmark : maps[m].landmarks()) maps_of[landmark.id.session].insert(m);
  }
  for (const LandmarkChange& change : borrowed)
    for (const std::size_t m : maps_of[change.id.session]) {
      const auto landmark = maps[m].landmark_number(change.id);
      if (!landmark) continue;
      for (const LandmarkSighting& seen : change.seen)
        for (const std::size_t other : maps_of[seen.node.session]) {
          const std::size_t keyframe = maps[other].number_of(seen.node);
          if (other != m && keyframe < maps[other].keyframes().size())
            sightings_.push_back({other, keyframe, m, *landmark, seen});
        }
    }
  std::stable_sort(sightings_.begin(), sightings_.end(),
                   [](const auto& a, const auto& b) { return order_of(a) < order_of(b); });
  sightings_.erase(std::unique(sightings_.begin(), sightings_.end(),
                               [](const auto& a, const auto& b) { return order_of(a) == order_of(b); }),
                   sightings_.end());
  for (const ClaimedSighting& claim : sightings_)
    of_pair_[std::minmax(claim.map, claim.map_of_landmark)].push_back(&claim);
}

std::optional<std::pair<std::size_t, std::size_t>> ClaimedSightings::most_claimed(
    std::size_t map, std::size_t keyframe, const std::function<bool(std::size_t)>& counts) const {
  const auto of = [](const ClaimedSighting& claim) { return std::make_pair(claim.map, claim.keyframe); };
  auto claim = std::lower_bound(sightings_.begin(), sightings_.end(), std::make_pair(map, keyframe),
                                [&](const ClaimedSighting& one, const auto& key) { return of(one) < key; });
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> shared;
  for (; claim != sightings_.end() && of(*claim) == std::make_pair(map, keyframe); ++claim)
    if (counts(claim->map_of_landmark))
      for (const std::size_t owner : keyframes_of(*claim)) ++shared[{claim->map_of_landmark, owner}];
  const auto most = std::max_element(shared.begin(), shared.end(),
                                     [](const auto& one, const auto& other) { return one.second < other.second; });
  return most == shared.end() || most->second < kLeastClaimed ? std::nullopt : std::optional(most->first);
}

std::vector<std::size_t> ClaimedSightings::keyframes_of(const ClaimedSighting& claim) const {
  const VisualMap& owner = maps_[claim.map_of_landmark];
  std::vector<std::size_t> result;
  for (const LandmarkSighting& own : owner.map().landmarks.find(owner.landmarks()[claim.landmark].id)->seen)
    if (const std::size_t keyframe = owner.number_of(own.node); keyframe < owner.keyframes().size())
      result.push_back(keyframe);
  return result;
}

std::vector<VisualQuestion> ClaimedSightings::pairs(std::size_t a, std::size_t b) const {
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> shared;  // of each pair of keyframes, how many
  const auto known = of_pair_.find(std::minmax(a, b));
  if (known == of_pair_.end()) return {};
  for (const ClaimedSighting* claim : known->second)
    for (const std::size_t keyframe : keyframes_of(*claim))
      ++shared[claim->map == b ? std::make_pair(keyframe, claim->keyframe) : std::make_pair(claim->keyframe, keyframe)];
  std::vector<std::tuple<std::size_t, std::size_t, std::size_t>> ranked;
  for (const auto& [pair, count] : shared)
    if (count >= kLeastClaimed) ranked.emplace_back(count, pair.first, pair.second);
  std::sort(ranked.begin(), ranked.end(), [](const auto& one, const auto& other) {
    return std::get<0>(one) != std::get<0>(other) ? std::get<0>(one) > std::get<0>(other) : one < other;
  });
  std::vector<VisualQuestion> questions;
  std::set<std::size_t> of_a, of_b;  // each keyframe once: others say the same
  for (const auto& [count, i, j] : ranked)
    if (questions.size() < kMostPairs && of_a.count(i) == 0 && of_b.count(j) == 0) {
      questions.push_back({i, j});
      of_a.insert(i);
      of_b.insert(j);
    }
  return questions;
}

}  // namespace mapweave::fusion
