#include "commitment.h"

#include <mapweave/graph/consistent_set.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace mapweave::fusion {

std::vector<Commitment> commit(const std::vector<char>& agree, const std::vector<double>& weights,
                               const CommitmentLimits& limits) {
  const std::size_t count = weights.size();
  std::vector<std::size_t> left(count);
  std::iota(left.begin(), left.end(), std::size_t{0});
  std::vector<Commitment> result;
  while (!left.empty() && result.size() < limits.most) {
    std::vector<bool> consistent(left.size() * left.size());
    std::vector<double> weights_left;
    for (std::size_t i = 0; i < left.size(); ++i) {
      weights_left.push_back(weights[left[i]]);
      for (std::size_t j = 0; j < left.size(); ++j)
        consistent[i * left.size() + j] = i != j && agree[left[i] * count + left[j]] != 0;
    }
    Commitment set;
    const std::vector<std::size_t> members = graph::consistent_set(consistent, weights_left, limits.budget);
    for (const std::size_t member : members) {
      set.agreeing.push_back(left[member]);
      set.weight += weights_left[member];
    }
    if (set.weight < limits.least_weight) break;
    for (std::size_t i = 0; i < left.size(); ++i)
      if (std::none_of(members.begin(), members.end(),
                       [&](std::size_t m) { return m == i || consistent[m * left.size() + i]; }))
        set.contradicting.push_back(left[i]);
    left = set.contradicting;
    result.push_back(std::move(set));
  }
  return result;
}

double log_odds(double probability) {
  const double p = std::clamp(probability, 0.5001, 0.9999);
  return std::log(p / (1.0 - p));
}

}  // namespace mapweave::fusion
