#pragma once
// Union-find over the numbers 0 to count - 1. The lowest number of a set stands for it, whatever was joined first.

#include <algorithm>
#include <cstddef>
#include <numeric>
#include <vector>

namespace mapweave {

class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }

  std::size_t find(std::size_t i) const {
    while (parent_[i] != i) i = parent_[i];
    return i;
  }

  // False where both were in one set before.
  bool join(std::size_t i, std::size_t j) {
    const std::size_t one = root(i), other = root(j);
    parent_[std::max(one, other)] = std::min(one, other);
    return one != other;
  }

 private:
  // As find(); halves the path for those that come after.
  std::size_t root(std::size_t i) {
    while (parent_[i] != i) {
      parent_[i] = parent_[parent_[i]];
      i = parent_[i];
    }
    return i;
  }

  std::vector<std::size_t> parent_;
};

}  // namespace mapweave
