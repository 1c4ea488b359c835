#include <gtest/gtest.h>
#include <mapweave/evaluation/statistics.h>

#include <cmath>

namespace mapweave::evaluation {
namespace {

TEST(Statistics, of_four_errors_worked_out_by_hand) {
  const Statistics result = statistics_of({4.0, 1.0, 2.0, 5.0});
  EXPECT_EQ(result.count, 4u);
  EXPECT_DOUBLE_EQ(result.mean, 3.0);
  EXPECT_DOUBLE_EQ(result.std, std::sqrt(2.5));
  EXPECT_DOUBLE_EQ(result.median, 3.0);
  EXPECT_DOUBLE_EQ(result.sse, 46.0);
  EXPECT_DOUBLE_EQ(result.rmse, std::sqrt(11.5));
  EXPECT_DOUBLE_EQ(result.min, 1.0);
  EXPECT_DOUBLE_EQ(result.max, 5.0);
}

TEST(Statistics, median_of_an_odd_count_is_the_middle_one) {
  EXPECT_DOUBLE_EQ(statistics_of({9.0, 1.0, 2.0}).median, 2.0);
}

TEST(Statistics, of_nothing_count_nothing) {
  EXPECT_EQ(statistics_of({}).count, 0u);
  EXPECT_DOUBLE_EQ(statistics_of({}).rmse, 0.0);
}

}  // namespace
}  // namespace mapweave::evaluation
