#include "contracted_graph.h"

#include <algorithm>
#include <cmath>

namespace mapweave::scheduling {

ContractedGraph contracted(const OverlapGraph& overlaps) {
  const auto size = static_cast<std::uint32_t>(overlaps.size());
  const double all = 2.0 * overlaps.total_weight(), scale = all > 0.0 ? 0x1p29 / all : 0.0;
  ContractedGraph graph;
  graph.robots.assign(size, 1);
  graph.begin.reserve(size + 1);
  graph.links.reserve(2 * overlaps.links());
  for (std::uint32_t v = 0; v < size; ++v) {
    for (const Neighbour& neighbour : overlaps.neighbours(v))
      if (const auto weight = static_cast<std::int32_t>(std::lround(neighbour.weight * scale)); weight > 0)
        graph.links.push_back({neighbour.vertex, weight});
    graph.begin.push_back(graph.links.size());
  }
  return graph;
}

Contraction contract(const ContractedGraph& fine, const std::vector<std::uint32_t>& labels, std::uint32_t most_robots,
                     RandomBits& random) {
  constexpr std::uint32_t kAlone = ~std::uint32_t{0};
  const std::uint32_t size = fine.size();
  std::vector<std::uint32_t> order(size), partner(size, kAlone);
  for (std::uint32_t v = 0; v < size; ++v) order[v] = v;
  random.shuffle(order);
  std::uint32_t lonely = kAlone;  // a vertex without links that waits for another
  for (const std::uint32_t v : order) {
    if (partner[v] != kAlone) continue;
    if (fine.begin[v] == fine.begin[v + 1]) {
      if (lonely != kAlone && labels[lonely] == labels[v] && fine.robots[lonely] + fine.robots[v] <= most_robots) {
        partner[v] = lonely;
        partner[lonely] = v;
        lonely = kAlone;
      } else {
        lonely = v;
      }
      continue;
    }
    double heaviest = 0.0;
    std::uint32_t chosen = kAlone;
    for (std::size_t i = fine.begin[v]; i < fine.begin[v + 1]; ++i) {
      const auto [u, weight] = fine.links[i];
      if (partner[u] != kAlone || labels[u] != labels[v] || fine.robots[u] + fine.robots[v] > most_robots) continue;
      const double rate = weight / static_cast<double>(fine.robots[u]);
      if (rate > heaviest) {
        heaviest = rate;
        chosen = u;
      }
    }
    if (chosen == kAlone) continue;
    partner[v] = chosen;
    partner[chosen] = v;
  }

  Contraction result;
  result.vertex_of.assign(size, kAlone);
  ContractedGraph& coarse = result.graph;
  std::vector<std::uint32_t> first;  // of each coarse vertex
  for (std::uint32_t v = 0; v < size; ++v) {
    if (result.vertex_of[v] != kAlone) continue;
    const auto index = static_cast<std::uint32_t>(first.size());
    first.push_back(v);
    result.vertex_of[v] = index;
    coarse.robots.push_back(fine.robots[v]);
    if (partner[v] != kAlone) {
      result.vertex_of[partner[v]] = index;
      coarse.robots.back() += fine.robots[partner[v]];
    }
    coarse.most_robots = std::max(coarse.most_robots, coarse.robots.back());
  }
  coarse.links.reserve(fine.links.size());
  std::vector<std::size_t> place(
      first.size(), 0);  // of the link to a coarse vertex, plus one; old ones lie before this vertex's first
  for (std::uint32_t index = 0; index < first.size(); ++index) {
    const std::size_t start = coarse.links.size();
    for (const std::uint32_t v : {first[index], partner[first[index]]}) {
      if (v == kAlone) continue;
      for (std::size_t i = fine.begin[v]; i < fine.begin[v + 1]; ++i) {
        const std::uint32_t to = result.vertex_of[fine.links[i].to];
        if (to == index) continue;
        if (place[to] > start) {
          coarse.links[place[to] - 1].weight += fine.links[i].weight;
        } else {
          coarse.links.push_back({to, fine.links[i].weight});
          place[to] = coarse.links.size();
        }
      }
    }
    coarse.begin.push_back(coarse.links.size());
  }
  return result;
}

}  // namespace mapweave::scheduling
