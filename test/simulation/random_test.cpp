#include <mapweave/simulation/random.h>

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace mapweave::simulation {
namespace {

TEST(RandomStream, looks_a_number_up_by_its_index_whatever_was_asked_before) {
  const RandomStream stream(7, "laser", "alpha");
  const std::uint64_t fifth = stream.at(5).bits();
  RandomNumbers others = stream.at(4);
  for (int i = 0; i < 100; ++i) others.bits();
  EXPECT_EQ(stream.at(5).bits(), fifth);
  EXPECT_EQ(RandomStream(7, "laser", "alpha").at(5).bits(), fifth);
}

TEST(RandomStream, differs_by_seed_purpose_owner_and_index) {
  std::set<std::uint64_t> seen;
  int count = 0;
  for (const std::uint64_t seed : {0u, 1u, 2u}) {
    for (const char* purpose : {"laser", "odometry", ""}) {
      for (const char* owner : {"alpha", "beta", ""}) {
        for (std::uint64_t index = 0; index < 50; ++index, ++count)
          seen.insert(RandomStream(seed, purpose, owner).at(index).bits());
      }
    }
  }
  EXPECT_EQ(seen.size(), static_cast<std::size_t>(count));
}

TEST(RandomNumbers, are_uniform_and_normal_within_what_their_number_allows) {
  const RandomStream stream(11, "moments");
  constexpr int kCount = 200000;
  double mean = 0.0, square = 0.0, normal_mean = 0.0, normal_square = 0.0, normal_fourth = 0.0;
  for (int i = 0; i < kCount; ++i) {
    RandomNumbers numbers = stream.at(static_cast<std::uint64_t>(i));
    const double u = numbers.uniform(), n = numbers.normal();
    ASSERT_GE(u, 0.0);
    ASSERT_LT(u, 1.0);
    mean += u / kCount;
    square += u * u / kCount;
    normal_mean += n / kCount;
    normal_square += n * n / kCount;
    normal_fourth += n * n * n * n / kCount;
  }
  EXPECT_NEAR(mean, 0.5, 0.003);
  EXPECT_NEAR(square, 1.0 / 3.0, 0.003);
  EXPECT_NEAR(normal_mean, 0.0, 0.01);
  EXPECT_NEAR(normal_square, 1.0, 0.015);
  EXPECT_NEAR(normal_fourth, 3.0, 0.15);
}

TEST(RandomNumbers, give_both_ends_of_an_integer_range) {
  std::set<int> seen;
  RandomNumbers numbers = RandomStream(3, "dice").at(0);
  for (int i = 0; i < 200; ++i) seen.insert(numbers.integer(1, 6));
  EXPECT_EQ(seen, (std::set<int>{1, 2, 3, 4, 5, 6}));
}

}  // namespace
}  // namespace mapweave::simulation
