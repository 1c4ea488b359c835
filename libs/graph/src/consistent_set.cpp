#include <mapweave/core/error.h>
#include <mapweave/graph/consistent_set.h>

#include <algorithm>
#include <numeric>

namespace mapweave::graph {
namespace {

// Branch and bound over candidates in a fixed order; the bound is a greedy colouring: of each class of mutually
// inconsistent ones a clique holds at most one.
class Search {
 public:
  Search(const std::vector<bool>& consistent, const std::vector<double>& weights, std::size_t budget)
      : consistent_(consistent), weights_(weights), count_(weights.size()), budget_(budget) {}

  std::vector<std::size_t> run() {
    std::vector<std::size_t> all(count_);
    std::iota(all.begin(), all.end(), std::size_t{0});
    // Heavily supported ones first: the first dive then is the greedy answer.
    std::vector<double> support(count_, 0.0);
    for (std::size_t i = 0; i < count_; ++i)
      for (std::size_t j = 0; j < count_; ++j)
        if (i != j && agree(i, j)) support[i] += weights_[j];
    for (std::size_t i = 0; i < count_; ++i) support[i] += weights_[i];
    std::stable_sort(all.begin(), all.end(), [&](std::size_t a, std::size_t b) { return support[a] > support[b]; });
    extend(all, 0.0);
    std::sort(best_.begin(), best_.end());
    return best_;
  }

 private:
  bool agree(std::size_t i, std::size_t j) const { return consistent_[i * count_ + j]; }

  double bound(const std::vector<std::size_t>& candidates) const {
    std::vector<std::vector<std::size_t>> classes;
    double sum = 0.0;
    for (std::size_t v : candidates) {
      bool placed = false;
      for (auto& members : classes) {
        if (std::none_of(members.begin(), members.end(), [&](std::size_t m) { return agree(v, m); })) {
          members.push_back(v);
          placed = true;
          break;
        }
      }
      if (!placed) classes.push_back({v});
    }
    for (const auto& members : classes) {
      double heaviest = 0.0;
      for (std::size_t m : members) heaviest = std::max(heaviest, weights_[m]);
      sum += heaviest;
    }
    return sum;
  }

  void extend(std::vector<std::size_t> candidates, double weight) {
    if (weight > best_weight_) {
      best_weight_ = weight;
      best_ = current_;
    }
    while (!candidates.empty()) {
      if (steps_++ >= budget_ && !best_.empty()) return;
      if (weight + bound(candidates) <= best_weight_ + 1e-12) return;
      const std::size_t v = candidates.front();
      candidates.erase(candidates.begin());
      std::vector<std::size_t> next;
      for (std::size_t u : candidates)
        if (agree(v, u)) next.push_back(u);
      current_.push_back(v);
      extend(std::move(next), weight + weights_[v]);
      current_.pop_back();
    }
  }

  const std::vector<bool>& consistent_;
  const std::vector<double>& weights_;
  std::size_t count_, budget_, steps_ = 0;
  std::vector<std::size_t> current_, best_;
  double best_weight_ = 0.0;
};

}  // namespace

std::vector<std::size_t> consistent_set(const std::vector<bool>& consistent, const std::vector<double>& weights,
                                        std::size_t budget) {
  MAPWEAVE_EXPECT(consistent.size() == weights.size() * weights.size(), "one row and column per weight");
  return Search(consistent, weights, budget).run();
}

}  // namespace mapweave::graph
