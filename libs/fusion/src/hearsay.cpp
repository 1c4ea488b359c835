#include "hearsay.h"

#include <algorithm>
#include <map>
#include <set>
#include <tuple>

namespace mapweave::fusion {
namespace {

constexpr std::size_t kLeastTold = 10;  // landmarks of one keyframe's, for a pair to be judged
constexpr std::size_t kMostPairs = 16;  // of two maps

auto order_of(const ToldSighting& told) { return std::tie(told.map, told.keyframe, told.map_of_landmark, told.landmark); }

}  // namespace

Hearsay::Hearsay(const std::vector<LandmarkChange>& borrowed, const std::deque<VisualMap>& maps) : maps_(maps) {
  for (const LandmarkChange& change : borrowed)
    for (std::size_t m = 0; m < maps.size(); ++m) {
      const auto landmark = maps[m].landmark_number(change.id);
      if (!landmark) continue;
      for (const LandmarkSighting& seen : change.seen)
        for (std::size_t other = 0; other < maps.size(); ++other) {
          const std::size_t keyframe = maps[other].number_of(seen.node);
          if (other != m && keyframe < maps[other].keyframes().size()) sightings_.push_back({other, keyframe, m, *landmark, seen});
        }
    }
  std::stable_sort(sightings_.begin(), sightings_.end(), [](const auto& a, const auto& b) { return order_of(a) < order_of(b); });
  sightings_.erase(
      std::unique(sightings_.begin(), sightings_.end(), [](const auto& a, const auto& b) { return order_of(a) == order_of(b); }),
      sightings_.end());
}

std::vector<VisualQuestion> Hearsay::pairs(std::size_t a, std::size_t b) const {
  std::map<std::pair<std::size_t, std::size_t>, std::size_t> shared;  // of each pair of keyframes, how many
  for (const ToldSighting& told : sightings_) {
    const bool of_b = told.map == b && told.map_of_landmark == a, of_a = told.map == a && told.map_of_landmark == b;
    if (!of_a && !of_b) continue;
    const VisualMap& owner = maps_[told.map_of_landmark];
    for (const LandmarkSighting& own : owner.map().landmarks.find(owner.landmarks()[told.landmark].id)->seen)
      if (const std::size_t keyframe = owner.number_of(own.node); keyframe < owner.keyframes().size())
        ++shared[of_b ? std::make_pair(keyframe, told.keyframe) : std::make_pair(told.keyframe, keyframe)];
  }
  std::vector<std::tuple<std::size_t, std::size_t, std::size_t>> ranked;
  for (const auto& [pair, count] : shared)
    if (count >= kLeastTold) ranked.emplace_back(count, pair.first, pair.second);
  std::sort(ranked.begin(), ranked.end(), [](const auto& one, const auto& other) {
    return std::get<0>(one) != std::get<0>(other) ? std::get<0>(one) > std::get<0>(other) : one < other;
  });
  std::vector<VisualQuestion> questions;
  std::set<std::size_t> of_a, of_b;  // each keyframe once: others say the same
  for (const auto& [count, i, j] : ranked)
    if (questions.size() < kMostPairs && of_a.count(i) == 0 && of_b.count(j) == 0) {
      questions.push_back({i, j});
      of_a.insert(i), of_b.insert(j);
    }
  return questions;
}

}  // namespace mapweave::fusion
