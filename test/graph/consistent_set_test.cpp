#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/graph/consistent_set.h>

#include <random>

namespace mapweave::graph {
namespace {

double weight_of(const std::vector<std::size_t>& set, const std::vector<double>& weights) {
  double sum = 0;
  for (const auto i : set) sum += weights[i];
  return sum;
}

bool is_clique(const std::vector<std::size_t>& set, const std::vector<bool>& consistent, std::size_t n) {
  for (const auto i : set)
    for (const auto j : set)
      if (i != j && !consistent[i * n + j]) return false;
  return true;
}

TEST(ConsistentSet, agrees_with_brute_force) {
  std::mt19937_64 random(42);
  for (int trial = 0; trial < 200; ++trial) {
    const std::size_t n = 1 + random() % 12;
    std::vector<bool> consistent(n * n, false);
    std::vector<double> weights;
    for (std::size_t i = 0; i < n; ++i) {
      weights.push_back(1.0 + static_cast<double>(random() % 100) / 10.0);
      for (std::size_t j = 0; j < i; ++j) consistent[i * n + j] = consistent[j * n + i] = random() % 10 < 6;
    }
    double best = 0;
    for (unsigned mask = 1; mask < (1U << n); ++mask) {
      std::vector<std::size_t> set;
      for (std::size_t i = 0; i < n; ++i)
        if ((mask >> i & 1U) != 0) set.push_back(i);
      if (is_clique(set, consistent, n)) best = std::max(best, weight_of(set, weights));
    }
    const auto found = consistent_set(consistent, weights);
    EXPECT_TRUE(is_clique(found, consistent, n));
    EXPECT_NEAR(weight_of(found, weights), best, 1e-9) << "trial " << trial;
  }
}

TEST(ConsistentSet, is_empty_for_nothing) { EXPECT_THAT(consistent_set({}, {}), testing::IsEmpty()); }

TEST(ConsistentSet, answers_something_good_when_its_budget_ends) {
  // Two groups that contradict each other: the larger wins even with a budget of a few steps.
  const std::size_t n = 60;
  std::vector<bool> consistent(n * n, false);
  for (std::size_t i = 0; i < n; ++i)
    for (std::size_t j = 0; j < n; ++j) consistent[i * n + j] = i != j && (i < 40) == (j < 40);
  EXPECT_EQ(consistent_set(consistent, std::vector<double>(n, 1.0), 50).size(), 40U);
}

}  // namespace
}  // namespace mapweave::graph
