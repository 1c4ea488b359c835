#include "grow_groups.h"

#include <algorithm>
#include <limits>

namespace mapweave::scheduling {
namespace {

constexpr std::uint32_t kNobody = ~std::uint32_t{0};

// Each seed is among those with the most links between them and the seeds before; who cannot be reached comes first.
std::vector<std::uint32_t> spread_seeds(const ContractedGraph& graph, std::size_t count, RandomBits& random) {
  const std::uint32_t size = graph.size(), turn = random.below(size);
  std::vector<std::uint32_t> distance(size, kNobody), seeds, queue;
  while (seeds.size() < count) {
    std::uint32_t farthest = kNobody;
    for (std::uint32_t i = 0; i < size; ++i) {
      const std::uint32_t v = i + turn < size ? i + turn : i + turn - size;
      if (farthest == kNobody || distance[v] > distance[farthest]) farthest = v;
    }
    seeds.push_back(farthest);
    distance[farthest] = 0;
    queue.assign(1, farthest);
    for (std::size_t i = 0; i < queue.size(); ++i)
      for (std::size_t k = graph.begin[queue[i]]; k < graph.begin[queue[i] + 1]; ++k)
        if (const std::uint32_t u = graph.links[k].to; distance[u] > distance[queue[i]] + 1) {
          distance[u] = distance[queue[i]] + 1;
          queue.push_back(u);
        }
  }
  return seeds;
}

}  // namespace

std::vector<std::uint32_t> grow_groups(const ContractedGraph& graph, const std::vector<SizeBounds>& bounds,
                                       RandomBits& random) {
  const auto groups = static_cast<std::uint32_t>(bounds.size());
  const std::uint32_t size = graph.size();
  std::vector<std::uint32_t> group_of(size, kNobody), waiting(size);
  std::vector<std::int64_t> linked(std::size_t{size} * groups, 0), robots(groups, 0), all(size, 0);
  for (std::uint32_t v = 0; v < size; ++v) {
    waiting[v] = v;
    for (std::size_t i = graph.begin[v]; i < graph.begin[v + 1]; ++i) all[v] += graph.links[i].weight;
  }
  random.shuffle(waiting);
  const auto put = [&](std::uint32_t v, std::uint32_t g) {
    group_of[v] = g;
    robots[g] += graph.robots[v];
    for (std::size_t i = graph.begin[v]; i < graph.begin[v + 1]; ++i) {
      linked[std::size_t{graph.links[i].to} * groups + g] += graph.links[i].weight;
      all[graph.links[i].to] -= graph.links[i].weight;  // what it is linked to among those who wait
    }
  };
  const auto seeds = spread_seeds(graph, std::min(groups, size), random);
  for (std::uint32_t g = 0; g < seeds.size(); ++g)
    if (group_of[seeds[g]] == kNobody) put(seeds[g], g);
  for (;;) {
    waiting.erase(
        std::remove_if(waiting.begin(), waiting.end(), [&](std::uint32_t v) { return group_of[v] != kNobody; }),
        waiting.end());
    if (waiting.empty()) break;
    const std::size_t before = waiting.size();
    // The emptiest group chooses; it takes who is linked to it and to few who wait.
    const std::size_t turns = std::max<std::size_t>(1, std::min<std::size_t>(groups, before));
    for (std::size_t turn = 0; turn < turns; ++turn) {
      std::uint32_t emptiest = 0;
      for (std::uint32_t g = 1; g < groups; ++g)
        if (robots[g] * bounds[emptiest].high < robots[emptiest] * bounds[g].high) emptiest = g;
      std::uint32_t chosen = kNobody;
      std::int64_t most = std::numeric_limits<std::int64_t>::min();
      for (const std::uint32_t v : waiting) {
        if (group_of[v] != kNobody) continue;
        const std::int64_t gain = 2 * linked[std::size_t{v} * groups + emptiest] - all[v];
        if (linked[std::size_t{v} * groups + emptiest] == 0 && most > std::numeric_limits<std::int64_t>::min() / 2)
          continue;
        const std::int64_t rank = linked[std::size_t{v} * groups + emptiest] > 0
                                      ? gain
                                      : std::numeric_limits<std::int64_t>::min() / 2 - all[v];
        if (chosen == kNobody || rank > most) {
          most = rank;
          chosen = v;
        }
      }
      if (chosen == kNobody) break;
      put(chosen, emptiest);
    }
  }
  return group_of;
}

}  // namespace mapweave::scheduling
