#include <mapweave/core/median.h>

#include <gtest/gtest.h>

namespace mapweave {
namespace {

TEST(Median, is_the_value_in_the_middle_whatever_the_order) {
  EXPECT_EQ(median(std::vector<double>{7.0}), 7.0);
  EXPECT_EQ(median(std::vector<double>{9.0, -1.0, 4.0}), 4.0);
  EXPECT_EQ(median(std::vector<int>{5, 5, 1, 5, 2}), 5);
}

TEST(Median, of_an_even_count_is_the_upper_of_the_two_in_the_middle) {
  EXPECT_EQ(median(std::vector<double>{2.0, 1.0}), 2.0);
  EXPECT_EQ(median(std::vector<double>{4.0, 1.0, 3.0, 2.0}), 3.0);
}

TEST(Median, of_nothing_is_a_broken_contract) { EXPECT_THROW(median(std::vector<double>()), ContractViolation); }

}  // namespace
}  // namespace mapweave
