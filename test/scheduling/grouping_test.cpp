#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/scheduling/grouping.h>

#include "random_overlaps.h"

#include <algorithm>
#include <cmath>

namespace mapweave::scheduling {
namespace {

using testing_graphs::even_sizes;
using testing_graphs::kKinds;
using testing_graphs::of_kind;

std::vector<std::uint32_t> sizes_of(const GroupOf& group_of, std::size_t groups) {
  std::vector<std::uint32_t> sizes(groups, 0);
  for (const std::uint32_t group : group_of) ++sizes.at(group);
  std::sort(sizes.rbegin(), sizes.rend());
  return sizes;
}

// Two triangles and a weak link.
OverlapGraph two_rooms() {
  return OverlapGraph(6, {{0, 2, 0.3}, {2, 4, 0.3}, {0, 4, 0.3}, {1, 3, 0.3}, {3, 5, 0.3}, {1, 5, 0.3}, {4, 5, 0.1}});
}

// Every assignment, for an oracle that shares no code with the search over subsets.
double least_cut(const OverlapGraph& graph, std::vector<std::uint32_t> sizes) {
  GroupOf group_of;
  for (std::uint32_t group = 0; group < sizes.size(); ++group) group_of.insert(group_of.end(), sizes[group], group);
  double least = INFINITY;
  do least = std::min(least, cut_weight(graph, group_of));
  while (std::next_permutation(group_of.begin(), group_of.end()));
  return least;
}

TEST(Grouping, keeps_rooms_together) {
  const OverlapGraph graph = two_rooms();
  for (const GroupOf& group_of :
       {group_balanced(graph, {3, 3}), group_exactly(graph, {3, 3}), group_recslam(graph, 2)}) {
    EXPECT_DOUBLE_EQ(cut_weight(graph, group_of), 0.1);
    EXPECT_NEAR(in_group_weight(graph, group_of), 1.8, 1e-12);
  }
}

TEST(Grouping, exactly_is_what_all_permutations_say) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const std::uint32_t robots = 5 + seed % 4;
    const OverlapGraph graph = of_kind(kKinds[seed % 4], robots, seed);
    for (const auto& sizes : {even_sizes(robots, 2), even_sizes(robots, 3), {robots - 2, 1, 1}})
      EXPECT_NEAR(cut_weight(graph, group_exactly(graph, sizes)), least_cut(graph, sizes), 1e-12) << seed;
  }
}

TEST(Grouping, is_within_one_percent_of_the_least_cut_on_average) {
  double excess = 0.0;
  constexpr std::uint32_t kGraphs = 60;
  for (std::uint32_t i = 0; i < kGraphs; ++i) {
    const std::uint32_t robots = 6 + i % 11;
    const OverlapGraph graph = of_kind(kKinds[i % 4], robots, 1000 + i);
    const auto sizes = even_sizes(robots, 2 + i % 3);
    const double least = cut_weight(graph, group_exactly(graph, sizes)),
                 ours = cut_weight(graph, group_balanced(graph, sizes));
    EXPECT_GE(ours, least - 1e-12);
    excess += least > 0.0 ? ours / least - 1.0 : 0.0;
  }
  EXPECT_LT(excess / kGraphs, 0.01);
}

TEST(Grouping, is_not_worse_than_the_others) {
  double against_metis = 0.0, count = 0.0;
  for (const char* kind : kKinds)
    for (const std::uint32_t robots : {40u, 300u}) {
      const OverlapGraph graph = of_kind(kind, robots, 5);
      const auto sizes = even_sizes(robots, 6);
      const double ours = cut_weight(graph, group_balanced(graph, sizes));
      EXPECT_LE(ours, 1.01 * cut_weight(graph, group_greedy(graph, sizes))) << kind;
      EXPECT_LE(ours, 1.01 * cut_weight(graph, group_recslam(graph, 6))) << kind;
      EXPECT_LE(ours, cut_weight(graph, group_randomly(robots, sizes))) << kind;
      if (const auto metis = group_with_metis(graph, sizes)) {
        EXPECT_LE(ours, 1.01 * cut_weight(graph, *metis)) << kind;
        against_metis += ours / cut_weight(graph, *metis);
        ++count;
      }
    }
  EXPECT_LE(against_metis, count);
}

TEST(Grouping, keeps_the_sizes_by_every_method) {
  for (std::uint64_t seed = 0; seed < 8; ++seed) {
    const std::uint32_t robots = 12 + 13 * static_cast<std::uint32_t>(seed);
    const OverlapGraph graph = of_kind(kKinds[seed % 4], robots, seed);
    for (const auto& sizes : {even_sizes(robots, 2),
                              even_sizes(robots, 4),
                              {robots - 6, 4, 1, 1},
                              {robots},
                              std::vector<std::uint32_t>(robots, 1)}) {
      EXPECT_EQ(sizes_of(group_balanced(graph, sizes), sizes.size()), sizes);
      EXPECT_EQ(sizes_of(group_greedy(graph, sizes), sizes.size()), sizes);
      EXPECT_EQ(sizes_of(group_randomly(robots, sizes), sizes.size()), sizes);
      EXPECT_EQ(sizes_of(group_with_metis(graph, sizes).value_or(group_balanced(graph, sizes)), sizes.size()), sizes);
    }
  }
}

TEST(Grouping, by_recslam_is_within_one_for_any_number_of_groups) {
  for (std::uint32_t robots = 1; robots < 30; ++robots)
    for (std::uint32_t groups = 1; groups <= 9; ++groups) {
      const auto sizes = sizes_of(group_recslam(of_kind("sparse", robots, robots), groups), groups);
      EXPECT_LE(sizes.front(), sizes.back() + 1) << robots << " robots, " << groups << " groups";
    }
}

TEST(Grouping, by_recslam_follows_algorithm_1_by_hand) {
  // Degrees: 1 for 0, 3 and 4; 2 for 1; 3 for 2. Groups of 5 in 2: |C| <= 2.5 ends it. Seed: 0, the first of least
  // degree; then eq. 5 over C, from P = {0}: gain(1) = 0.5 - 0.2, gain(2) = 0 - 0.2 - 0.1 - 0.3, gain(3) = -0.1,
  // gain(4) = -0.3: 1. Then 2 candidates remain after 3 picks: gain(2) = 0.2 - 0.4, gain(3) = -0.1, gain(4) = -0.3: 3.
  const OverlapGraph graph(5, {{0, 1, 0.5}, {1, 2, 0.2}, {2, 3, 0.1}, {2, 4, 0.3}});
  RecslamOptions options;
  options.search = RecslamSearch::none;
  EXPECT_THAT(group_recslam(graph, 2, options), testing::ElementsAre(0, 0, 1, 0, 1));
}

TEST(Grouping, by_recslam_with_a_list_that_filters_is_no_worse_than_its_start) {
  for (std::uint64_t seed = 0; seed < 10; ++seed) {
    const OverlapGraph graph = of_kind(kKinds[seed % 4], 24, seed);
    RecslamOptions start, filters;
    start.search = RecslamSearch::none;
    filters.search = RecslamSearch::tabu;
    const double first = cut_weight(graph, group_recslam(graph, 4, start));
    EXPECT_LE(cut_weight(graph, group_recslam(graph, 4)), first + 1e-12);
    EXPECT_LE(cut_weight(graph, group_recslam(graph, 4, filters)), cut_weight(graph, group_recslam(graph, 4)) + 1e-12);
  }
}

TEST(Grouping, by_recslam_finds_more_with_more_iterations_and_a_longer_list) {
  double few = 0.0, many = 0.0, without_list = 0.0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const OverlapGraph graph = of_kind("dense", 40, seed);
    RecslamOptions options;
    options.search = RecslamSearch::tabu;
    many += cut_weight(graph, group_recslam(graph, 3, options));
    options.tabu_length = 0;
    without_list += cut_weight(graph, group_recslam(graph, 3, options));
    options.iterations = 2;
    few += cut_weight(graph, group_recslam(graph, 3, options));
  }
  EXPECT_LT(many, without_list);
  EXPECT_LT(without_list, few);
}

TEST(Grouping, is_the_same_for_the_same_seed) {
  const OverlapGraph graph = of_kind("clustered", 150, 3);
  const auto sizes = even_sizes(150, 7);
  EXPECT_EQ(group_balanced(graph, sizes, {5}), group_balanced(graph, sizes, {5}));
  EXPECT_EQ(group_greedy(graph, sizes, 5), group_greedy(graph, sizes, 5));
  EXPECT_NE(group_randomly(150, sizes, 5), group_randomly(150, sizes, 6));
}

TEST(Grouping, survives_graphs_without_links_stars_and_equal_weights) {
  const OverlapGraph none(40, {});
  EXPECT_EQ(sizes_of(group_balanced(none, even_sizes(40, 3)), 3), even_sizes(40, 3));
  std::vector<OverlapLink> star, all;
  for (std::uint32_t i = 1; i < 200; ++i) star.push_back({0, i, 0.25});
  for (std::uint32_t a = 0; a < 40; ++a)
    for (std::uint32_t b = a + 1; b < 40; ++b) all.push_back({a, b, 0.5});
  const OverlapGraph of_star(200, star), of_all(40, all);
  EXPECT_NEAR(cut_weight(of_star, group_balanced(of_star, even_sizes(200, 4))), 0.25 * 150, 1e-9);
  EXPECT_NEAR(cut_weight(of_all, group_balanced(of_all, even_sizes(40, 4))), 0.5 * 600, 1e-9);
  const OverlapGraph wide(3, {{0, 1, 1e-9}, {1, 2, 1e9}});  // weights of very different size
  EXPECT_NEAR(cut_weight(wide, group_balanced(wide, {2, 1})), 1e-9, 1e-15);
}

TEST(Grouping, finds_pieces_that_fit) {
  // Forty pieces of five robots into eight groups of 25: nothing need be cut.
  std::vector<OverlapLink> links;
  for (std::uint32_t piece = 0; piece < 40; ++piece)
    for (std::uint32_t a = 0; a < 5; ++a)
      for (std::uint32_t b = a + 1; b < 5; ++b) links.push_back({piece + 40 * a, piece + 40 * b, 0.2});
  const OverlapGraph graph(200, links);
  EXPECT_EQ(cut_weight(graph, group_balanced(graph, even_sizes(200, 8))), 0.0);
}

class ManyGroups : public testing::TestWithParam<std::pair<std::uint32_t, std::uint32_t>> {};
INSTANTIATE_TEST_SUITE_P(Grouping, ManyGroups, testing::Values(std::pair(600, 200), std::pair(1500, 700)));

TEST_P(ManyGroups, are_filled_evenly) {
  const auto [robots, groups] = GetParam();
  const OverlapGraph graph = of_kind("building", robots, 2);
  const auto sizes = even_sizes(robots, groups);
  const GroupOf group_of = group_balanced(graph, sizes);
  EXPECT_EQ(sizes_of(group_of, groups), sizes);
  EXPECT_LT(cut_weight(graph, group_of), cut_weight(graph, group_greedy(graph, sizes)));
}

TEST(Grouping, refuses_sizes_that_do_not_sum_up) {
  EXPECT_THROW(group_balanced(two_rooms(), {3, 2}), ContractViolation);
  EXPECT_THROW(group_exactly(two_rooms(), {4, 3}), ContractViolation);
}

}  // namespace
}  // namespace mapweave::scheduling
