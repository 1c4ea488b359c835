#include <mapweave/core/disjoint_sets.h>

#include <gtest/gtest.h>

namespace mapweave {
namespace {

TEST(DisjointSets, stand_under_their_lowest_number_whatever_was_joined_first) {
  DisjointSets sets(6);
  EXPECT_TRUE(sets.join(5, 3));
  EXPECT_TRUE(sets.join(4, 1));
  EXPECT_TRUE(sets.join(5, 4));
  EXPECT_FALSE(sets.join(1, 3));
  for (const std::size_t member : {1, 3, 4, 5}) EXPECT_EQ(sets.find(member), 1u) << member;
  EXPECT_EQ(sets.find(0), 0u);
  EXPECT_EQ(sets.find(2), 2u);
}

TEST(DisjointSets, find_the_ends_of_a_long_chain) {
  constexpr std::size_t kCount = 100000;
  DisjointSets sets(kCount);
  for (std::size_t i = kCount - 1; i > 0; --i) EXPECT_TRUE(sets.join(i - 1, i));
  EXPECT_EQ(sets.find(kCount - 1), 0u);
}

}  // namespace
}  // namespace mapweave
