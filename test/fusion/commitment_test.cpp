#include "decision/commitment.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <utility>

namespace mapweave::fusion {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

// Statements of which these pairs agree.
std::vector<char> agreement(std::size_t count, const std::vector<std::pair<std::size_t, std::size_t>>& pairs) {
  std::vector<char> agree(count * count, false);
  for (const auto& [i, j] : pairs) agree[i * count + j] = agree[j * count + i] = true;
  return agree;
}

TEST(Commitment, believes_the_heaviest_set_and_takes_what_contradicts_it_for_its_rival) {
  // 0, 1, 2 agree; 3, 4 agree; 5 agrees with 2 alone: it is in neither set, and no rival.
  const auto sets = commit(agreement(6, {{0, 1}, {0, 2}, {1, 2}, {3, 4}, {2, 5}}), {1.0, 1.0, 1.0, 1.0, 1.5, 0.5});
  ASSERT_EQ(sets.size(), 2U);
  EXPECT_THAT(sets[0].agreeing, ElementsAre(0, 1, 2));
  EXPECT_DOUBLE_EQ(sets[0].weight, 3.0);
  EXPECT_THAT(sets[0].contradicting, ElementsAre(3, 4));
  EXPECT_THAT(sets[1].agreeing, ElementsAre(3, 4));
  EXPECT_DOUBLE_EQ(sets[1].weight, 2.5);
  EXPECT_THAT(sets[1].contradicting, IsEmpty());
}

TEST(Commitment, weighs_sets_and_does_not_count_them) {
  const auto sets = commit(agreement(3, {{0, 1}}), {1.0, 1.0, 5.0});
  ASSERT_EQ(sets.size(), 2U);
  EXPECT_THAT(sets[0].agreeing, ElementsAre(2));
  EXPECT_THAT(sets[1].agreeing, ElementsAre(0, 1));
}

TEST(Commitment, leaves_out_sets_that_are_too_many_or_too_light) {
  const std::vector<double> weights = {4.0, 3.0, 2.0, 1.0};  // none agrees with any other
  EXPECT_EQ(commit(agreement(4, {}), weights, {3, 0.0}).size(), 3U);
  EXPECT_EQ(commit(agreement(4, {}), weights, {4, 2.5}).size(), 2U);
}

TEST(Commitment, believes_nothing_where_nothing_is_said) { EXPECT_THAT(commit({}, {}), IsEmpty()); }

TEST(Commitment, counts_no_judgement_as_less_than_nothing_or_as_certain) {
  EXPECT_GT(log_odds(0.0), 0.0);
  EXPECT_LT(log_odds(0.3), 1e-3);
  EXPECT_NEAR(log_odds(0.9), std::log(9.0), 1e-12);
  EXPECT_EQ(log_odds(1.0), log_odds(0.9999));
}

}  // namespace
}  // namespace mapweave::fusion
