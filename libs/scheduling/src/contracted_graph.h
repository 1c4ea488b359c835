#pragma once
// The overlap graph as the grouping search works on it: whole numbers for weights, so that sums are exact in any order,
// and vertices that may stand for several robots.

#include <mapweave/core/mixed_bits.h>
#include <mapweave/scheduling/overlap_graph.h>

#include <cstdint>
#include <vector>

namespace mapweave::scheduling {

class RandomBits {
 public:
  explicit RandomBits(std::uint64_t seed) : state_(mixed(seed + 0x9e3779b97f4a7c15u)) {}
  std::uint64_t bits() { return mixed(state_ += 0x9e3779b97f4a7c15u); }
  std::uint32_t below(std::uint32_t end) { return static_cast<std::uint32_t>(((bits() >> 32) * end) >> 32); }
  template <class Value>
  void shuffle(std::vector<Value>& values) {
    for (std::size_t i = values.size(); i > 1; --i)
      std::swap(values[i - 1], values[below(static_cast<std::uint32_t>(i))]);
  }

 private:
  std::uint64_t state_;
};

struct ContractedGraph {
  struct Link {
    std::uint32_t to;
    std::int32_t weight;
  };
  std::vector<std::size_t> begin{0};
  std::vector<Link> links;
  std::vector<std::uint32_t> robots;  // by vertex: how many it stands for
  std::uint32_t most_robots = 1;      // of one vertex

  std::uint32_t size() const { return static_cast<std::uint32_t>(robots.size()); }
};

// All weights together come to less than 2^30, so that no sum of them overflows.
ContractedGraph contracted(const OverlapGraph&);

struct Contraction {
  ContractedGraph graph;
  std::vector<std::uint32_t> vertex_of;  // by vertex of the finer graph
};
// Joins pairs along heavy links (weight per product of robots), visited in random order; only pairs of one label, never
// more than `most_robots` robots in a vertex. Vertices without any link pair up too.
Contraction contract(const ContractedGraph&, const std::vector<std::uint32_t>& labels, std::uint32_t most_robots,
                     RandomBits&);

}  // namespace mapweave::scheduling
