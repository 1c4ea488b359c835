#pragma once
// Places of nodes in a sorted list of them: many are looked up, and names are slow to compare.

#include <mapweave/core/ids.h>

#include <algorithm>
#include <cstdint>
#include <vector>

namespace mapweave {

class NodeNumbers {
 public:
  // By id, the next.
  void add(const NodeId& id) {
    if (runs_.empty() || !(runs_.back().session == id.session)) runs_.push_back({id.session, size_, {}});
    runs_.back().indices.push_back(id.index);
    ++size_;
  }
  std::size_t size() const { return size_; }
  // size() for one that is not among them.
  std::size_t of(const NodeId& id) const {
    const auto run =
        std::find_if(runs_.begin(), runs_.end(), [&](const Run& one) { return one.session == id.session; });
    if (run == runs_.end()) return size_;
    const auto place = std::lower_bound(run->indices.begin(), run->indices.end(), id.index);
    return place != run->indices.end() && *place == id.index
               ? run->first + static_cast<std::size_t>(place - run->indices.begin())
               : size_;
  }

 private:
  struct Run {
    SessionId session;
    std::size_t first;
    std::vector<std::uint32_t> indices;
  };
  std::vector<Run> runs_;
  std::size_t size_ = 0;
};

}  // namespace mapweave
