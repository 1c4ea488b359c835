#include <mapweave/rig/covisibility.h>

#include <algorithm>

namespace mapweave::rig {

Covisibility covisibility(const Map& map) {
  Covisibility result;
  for (const auto& [id, node] : map.nodes)
    if (keyframe_of(node) != nullptr) {
      result.keyframes.push_back(&node);
      result.numbers.add(id);
    }
  const std::size_t count = result.keyframes.size();
  std::vector<std::vector<std::size_t>> seen_by,
      landmarks_of(count);  // keyframes of each landmark, and the other way round
  for (const auto& [id, landmark] : map.landmarks) {
    auto& seen = seen_by.emplace_back();
    for (const LandmarkSighting& sighting : landmark.seen)
      if (const std::size_t number = result.number_of(sighting.node); number < count) seen.push_back(number);
    for (const std::size_t number : seen) landmarks_of[number].push_back(seen_by.size() - 1);
  }
  std::vector<std::size_t> shared(count, 0);
  for (std::size_t number = 0; number < count; ++number) {
    std::fill(shared.begin(), shared.end(), 0);
    for (const std::size_t landmark : landmarks_of[number])
      for (const std::size_t other : seen_by[landmark]) ++shared[other];
    auto& sorted = result.shared.emplace_back();
    for (std::size_t other = 0; other < count; ++other)
      if (other != number && shared[other] > 0) sorted.emplace_back(shared[other], other);
    std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) {
      return a.first > b.first || (a.first == b.first && a.second < b.second);
    });
  }
  return result;
}

std::vector<CovisibilityEdge> covisibility_edges(const Covisibility& seen, int least_shared) {
  constexpr std::size_t kMostNeighbours = 5;  // those that share most; more make the graph dense, not stiffer
  std::vector<CovisibilityEdge> result;
  for (std::size_t i = 1; i < seen.keyframes.size(); ++i) {
    std::size_t count = 0, with_the_last = 0;
    bool to_the_last = seen.keyframes[i - 1]->id.session != seen.keyframes[i]->id.session;
    for (const auto& [landmarks, other] : seen.shared[i]) {
      if (other + 1 == i) with_the_last = landmarks;
      if (other > i || count == kMostNeighbours || landmarks < static_cast<std::size_t>(least_shared)) continue;
      result.push_back({seen.keyframes[other], seen.keyframes[i], landmarks});
      ++count;
      to_the_last = to_the_last || other + 1 == i;
    }
    if (!to_the_last) result.push_back({seen.keyframes[i - 1], seen.keyframes[i], with_the_last});
  }
  return result;
}

}  // namespace mapweave::rig
