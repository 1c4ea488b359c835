#include <mapweave/scheduling/overlap_graph.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::scheduling {

OverlapGraph::OverlapGraph(std::size_t vertices, const std::vector<OverlapLink>& links) : begin_(vertices + 1, 0) {
  for (const OverlapLink& link : links) {
    MAPWEAVE_EXPECT(link.a < vertices && link.b < vertices && link.a != link.b,
                    "a link joins two vertices of the graph");
    MAPWEAVE_EXPECT(std::isfinite(link.weight) && link.weight >= 0.0, "weights are finite and not negative");
    if (link.weight == 0.0) continue;
    ++begin_[link.a + 1];
    ++begin_[link.b + 1];
    total_weight_ += link.weight;
  }
  for (std::size_t i = 1; i < begin_.size(); ++i) begin_[i] += begin_[i - 1];
  neighbours_.resize(begin_.back());
  std::vector<std::size_t> next(begin_.begin(), begin_.end() - 1);
  for (const OverlapLink& link : links) {
    if (link.weight == 0.0) continue;
    neighbours_[next[link.a]++] = {link.b, link.weight};
    neighbours_[next[link.b]++] = {link.a, link.weight};
  }
  for (std::size_t v = 0; v < vertices; ++v) {
    const auto first = neighbours_.begin() + static_cast<std::ptrdiff_t>(begin_[v]),
               last = neighbours_.begin() + static_cast<std::ptrdiff_t>(begin_[v + 1]);
    std::sort(first, last, [](const Neighbour& a, const Neighbour& b) { return a.vertex < b.vertex; });
    const auto twice =
        std::adjacent_find(first, last, [](const Neighbour& a, const Neighbour& b) { return a.vertex == b.vertex; });
    MAPWEAVE_EXPECT(twice == last, "a pair of vertices is linked once");
  }
}

double OverlapGraph::weight(std::uint32_t a, std::uint32_t b) const {
  const Neighbours of_a = neighbours(a);
  const Neighbour* found =
      std::lower_bound(of_a.begin(), of_a.end(), b,
                       [](const Neighbour& neighbour, std::uint32_t vertex) { return neighbour.vertex < vertex; });
  return found != of_a.end() && found->vertex == b ? found->weight : 0.0;
}

}  // namespace mapweave::scheduling
