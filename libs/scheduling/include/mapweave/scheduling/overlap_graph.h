#pragma once
// Who shares how much with whom (RecSLAM IV-B, "Graph abstraction"): vertices are robots' maps, the weight of a link is
// their overlap degree |A and B| / (|A| + |B|), 0 to 0.5. Links of weight 0 are left out. Sparse: memory grows with
// links, not with pairs.

#include <cstddef>
#include <cstdint>
#include <vector>

namespace mapweave::scheduling {

struct OverlapLink {
  std::uint32_t a, b;
  double weight;
};

struct Neighbour {
  std::uint32_t vertex;
  double weight;
};

// Immutable; thread-safe.
class OverlapGraph {
 public:
  OverlapGraph() = default;
  // Links name vertices below `vertices`, each pair once in either order, never one vertex twice, with finite weights
  // of 0 or more; else ContractViolation. Any non-negative weight will do for grouping; the latency model reads weights
  // as overlap degrees.
  OverlapGraph(std::size_t vertices, const std::vector<OverlapLink>& links);

  std::size_t size() const { return begin_.size() - 1; }
  std::size_t links() const { return neighbours_.size() / 2; }
  double total_weight() const { return total_weight_; }   // each link once
  double weight(std::uint32_t a, std::uint32_t b) const;  // 0 where they share nothing

  struct Neighbours {  // ascending by vertex
    const Neighbour *first, *last;
    const Neighbour* begin() const { return first; }
    const Neighbour* end() const { return last; }
    std::size_t size() const { return static_cast<std::size_t>(last - first); }
  };
  Neighbours neighbours(std::uint32_t vertex) const {
    return {neighbours_.data() + begin_[vertex], neighbours_.data() + begin_[vertex + 1]};
  }

 private:
  std::vector<std::size_t> begin_{0};
  std::vector<Neighbour> neighbours_;
  double total_weight_ = 0.0;
};

}  // namespace mapweave::scheduling
