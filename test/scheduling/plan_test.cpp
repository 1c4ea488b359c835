#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/scheduling/plan.h>

#include "random_overlaps.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <string>

namespace mapweave::scheduling {
namespace {

using testing::ElementsAre;

double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * testing_graphs::uniform(random);
}

// Edges and links of all kinds.
Problem random_problem(std::uint32_t robots, std::uint32_t edges, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Problem problem;
  problem.overlaps = testing_graphs::of_kind(testing_graphs::kKinds[seed % 4], robots, seed);
  for (std::uint32_t i = 0; i < robots; ++i) {
    problem.robots.emplace_back("r" + std::to_string(i));
    problem.scans.push_back(seed % 3 == 0 ? std::optional(std::floor(uniform(random, 10, 3000))) : std::nullopt);
  }
  for (std::uint32_t i = 0; i < edges; ++i)
    problem.edges.push_back({TierId("e" + std::to_string(i)), uniform(random, 1e5, 1e7),
                             seed % 2 == 0 ? uniform(random, 0.3, 3.0) : 1.0, std::nullopt});
  if (seed % 3 == 1) problem.edges.front().delay_s = uniform(random, 0.0, 3.0);
  problem.cloud = {seed % 4 < 2 ? uniform(random, 0.3, 3.0) : 1.0, seed % 5 != 3};
  if (seed % 5 < 2)
    for (std::uint32_t r = 0; r < robots; ++r)
      problem.links[{r, r % edges}] = {uniform(random, 1e5, 1e7), uniform(random, 0.0, 0.5)};
  return problem;
}

// Every way to send robots to edges that capacities allow, whatever the sizes.
double least_of_all(const Latency& latency) {
  const auto robots = static_cast<std::uint32_t>(latency.problem().robots.size()),
             edges = static_cast<std::uint32_t>(latency.problem().edges.size());
  double least = INFINITY;
  for (std::uint32_t code = 0; code < std::pow(edges, robots); ++code) {
    Groups robots_at(edges);
    for (std::uint32_t robot = 0, rest = code; robot < robots; ++robot, rest /= edges)
      robots_at[rest % edges].push_back(robot);
    const auto too_many = [&](std::uint32_t edge) {
      return robots_at[edge].size() > latency.problem().edges[edge].capacity.value_or(robots);
    };
    bool fits = true;
    for (std::uint32_t edge = 0; edge < edges; ++edge) fits = fits && !too_many(edge);
    if (fits) least = std::min(least, latency.total_seconds(robots_at));
  }
  return least;
}

LatencyModel model_of_kind(std::uint64_t kind) {
  LatencyModel model;
  if (kind % 4 == 1) model.edge_fusion = {0.5, 1e-4, 5e-8};
  if (kind % 4 == 2) {
    model.map_bytes_per_scan = 20e3;
    model.edge_bytes_per_map_byte = 1.5;
  }
  if (kind % 4 == 3) {  // the cloud decides
    model.edge_fusion = {0.1, 1e-3, 1e-6, 1e-3};
    model.cloud_fusion = {0.3, 2e-3, 1e-5, 2e-3};
  }
  if (kind % 3 == 1) model.edges["e1"] = {2e-3, 0.1, FusionTime{0.01, 2e-4, 1e-7, 0.0}};  // an edge of its own kind
  return model;
}

TEST(LowerBound, is_undercut_by_no_plan_at_all) {
  double tightness = 0.0;
  constexpr int kProblems = 36;
  for (int seed = 0; seed < kProblems; ++seed) {
    const Problem problem = random_problem(3 + seed % 4, 2 + seed % 2, seed);
    const LatencyModel model = model_of_kind(seed);
    const Latency latency(problem, model);
    const double bound = lower_bound_seconds(latency), least = least_of_all(latency);
    EXPECT_LE(bound, least) << seed;
    EXPECT_GT(bound, 0.0);
    tightness += bound / least / kProblems;
  }
  EXPECT_GT(tightness, 0.6);  // it says something
}

TEST(LowerBound, is_undercut_by_no_plan_of_robots_of_very_different_scans) {
  double tightness = 0.0;
  constexpr int kProblems = 48;
  for (int seed = 0; seed < kProblems; ++seed) {
    std::mt19937_64 random(seed);
    Problem problem = random_problem(3 + seed % 4, 2 + seed % 3 / 2, seed);
    for (auto& scans : problem.scans) scans = std::floor(std::exp(uniform(random, 0.0, 8.0)));
    if (seed % 7 == 0) problem.scans.front() = 0.0;
    if (seed % 5 == 0) problem.edges.front().capacity = static_cast<std::uint32_t>(problem.robots.size() / 2);
    const LatencyModel model = model_of_kind(seed / 3);
    const Latency latency(problem, model);
    const double bound = lower_bound_seconds(latency), least = least_of_all(latency);
    EXPECT_LE(bound, least) << seed;
    tightness += bound / least / kProblems;
  }
  EXPECT_GT(tightness, 0.6);
}

TEST(LowerBound, counts_what_capacities_leave_to_the_cloud) {
  Problem problem = random_problem(6, 3, 1);
  problem.cloud = {};
  LatencyModel model;
  model.cloud_fusion = {0.0, 0.0, 1e-3};
  const double anywhere = lower_bound_seconds(Latency(problem, model));
  for (EdgeResources& edge : problem.edges) edge.capacity = 2;
  const Latency latency(problem, model);
  const double bound = lower_bound_seconds(latency);
  EXPECT_GT(bound,
            1e-3 * (1000.0 * 5000.0 + 1000.0 * 4000.0) /
                3.0);  // two edges but for two robots hold one, and the rest is on the third
  EXPECT_GT(bound, 2.0 * anywhere);
  EXPECT_LE(bound, least_of_all(latency));
}

TEST(LowerBound, holds_for_more_kinds_of_robots_than_it_distinguishes) {
  Problem problem =
      random_problem(100, 25, 6);  // scans of their own: 100 kinds of robots, of which 80 are distinguished
  const Plan plan = make_plan(problem, {});
  EXPECT_LE(plan.lower_bound_seconds, plan.predicted_seconds);
  EXPECT_GT(plan.lower_bound_seconds, 0.2 * plan.predicted_seconds);
}

TEST(LowerBound, is_met_where_one_robot_has_one_edge) {
  Problem problem = random_problem(1, 1, 1);
  const LatencyModel model;
  const Plan plan = make_plan(problem, {PlanMethod::standard, 1, model});
  EXPECT_NEAR(plan.lower_bound_seconds, plan.predicted_seconds, 1e-4 * plan.predicted_seconds);
}

TEST(Plan, is_never_below_its_bound_and_keeps_sizes) {
  for (std::uint64_t seed = 0; seed < 12; ++seed) {
    const Problem problem = random_problem(12 + seed % 4, 3 + seed % 3, seed);
    for (const PlanMethod method : {PlanMethod::standard, PlanMethod::recslam, PlanMethod::greedy, PlanMethod::random,
                                    PlanMethod::metis, PlanMethod::exact}) {
      if (method == PlanMethod::metis && !group_with_metis(problem.overlaps, group_sizes(problem))) continue;
      const Plan plan = make_plan(problem, {method, seed, {}});
      EXPECT_LE(plan.lower_bound_seconds, plan.predicted_seconds);
      std::size_t robots = 0, most = 0, least = 1000;
      for (const auto& group : plan.groups) {
        robots += group.size();
        most = std::max(most, group.size());
        least = std::min(least, group.size());
        for (const std::uint32_t robot : group) EXPECT_EQ(plan.edge_of[robot], plan.edge_of[group.front()]);
      }
      EXPECT_EQ(robots, problem.robots.size());
      const bool may_differ = problem.edges.front().speed != problem.edges.back().speed &&
                              (method == PlanMethod::standard || method == PlanMethod::exact);
      EXPECT_LE(most, may_differ ? robots : least + 1);
      EXPECT_NEAR(plan.cut_weight + plan.in_group_weight, problem.overlaps.total_weight(), 1e-9);
    }
  }
}

TEST(Placement, takes_the_least_of_all_permutations) {
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Problem problem = random_problem(9, 4, seed);
    const LatencyModel model;
    const Latency latency(problem, model);
    const Groups groups{{0, 3, 4}, {1, 2, 8}, {5, 6, 7}};
    const auto total = [&](const std::vector<std::uint32_t>& edge_of) {
      Groups robots_at(4);
      for (std::size_t i = 0; i < groups.size(); ++i) robots_at[edge_of[i]] = groups[i];
      return latency.total_seconds(robots_at);
    };
    std::vector<std::uint32_t> order{0, 1, 2, 3};
    double least = INFINITY;
    do least = std::min(least, total(order));
    while (std::next_permutation(order.begin(), order.end()));
    EXPECT_DOUBLE_EQ(total(place_optimally(latency, groups)), least);
    EXPECT_GE(total(place_as_recslam(latency, groups)), least);
  }
}

Problem six_on_two_edges(double speed_of_second) {
  Problem problem = random_problem(6, 2, 1);
  problem.links.clear();
  problem.edges.front().delay_s.reset();
  for (EdgeResources& edge : problem.edges) edge.bandwidth_bytes_per_s = 1e7;
  problem.edges[1].speed = speed_of_second;
  return problem;
}

std::size_t robots_on_second(const Problem& problem) {
  PlanOptions options;
  options.model.cloud_fusion = {};  // of which a slow edge would be slow with its part
  const Plan plan = make_plan(problem, options);
  return static_cast<std::size_t>(std::count(plan.edge_of.begin(), plan.edge_of.end(), 1u));
}

TEST(Plan, gives_a_slow_edge_fewer_robots_and_a_very_slow_one_none) {
  EXPECT_EQ(robots_on_second(six_on_two_edges(1.0)), 3u);
  EXPECT_EQ(robots_on_second(six_on_two_edges(0.97)), 3u) << "it would save next to nothing";
  const std::size_t of_slow = robots_on_second(six_on_two_edges(0.4));
  EXPECT_GT(of_slow, 0u);
  EXPECT_LT(of_slow, 3u);
  EXPECT_EQ(robots_on_second(six_on_two_edges(0.01)), 0u);
  Problem full = six_on_two_edges(0.01);
  full.edges[0].capacity = 4;
  EXPECT_EQ(robots_on_second(full), 2u) << "the fast one has no more room";
  full.edges[0].capacity = 6;
  full.scans.assign(6, 0.0);
  EXPECT_NO_THROW(make_plan(full, {})) << "nobody has sensed anything";
}

TEST(Placement, keeps_capacities) {
  Problem problem = random_problem(5, 2, 1);
  problem.edges[0].capacity = 2;
  const Plan plan = make_plan(problem, {});
  EXPECT_EQ(std::count(plan.edge_of.begin(), plan.edge_of.end(), 0u), 2);
  problem.edges[1].capacity = 2;
  EXPECT_THROW(make_plan(problem, {}), Error);
}

TEST(Plan, gives_each_robot_an_edge_of_its_own_where_there_are_more_edges) {
  Problem problem = random_problem(2, 5, 1);
  for (const PlanMethod method :
       {PlanMethod::standard, PlanMethod::recslam, PlanMethod::greedy, PlanMethod::random, PlanMethod::exact}) {
    const Plan plan = make_plan(problem, {method, 1, {}});
    EXPECT_EQ(plan.groups.size(), 2u);
    EXPECT_NE(plan.edge_of[0], plan.edge_of[1]);
  }
}

TEST(Plan, is_made_for_graphs_without_links_and_in_pieces) {
  Problem problem = random_problem(7, 3, 1);
  problem.overlaps = OverlapGraph(7, {});
  for (const PlanMethod method :
       {PlanMethod::standard, PlanMethod::recslam, PlanMethod::greedy, PlanMethod::random, PlanMethod::exact})
    EXPECT_EQ(make_plan(problem, {method, 1, {}}).groups.size(), 3u);
  problem.overlaps = OverlapGraph(7, {{0, 6, 0.4}, {1, 5, 0.4}, {2, 4, 0.4}});
  EXPECT_EQ(make_plan(problem, {}).cut_weight, 0.0);
}

TEST(Plan, groups_as_recslam_is_asked_to) {
  double cut[3];
  for (const RecslamSearch search : {RecslamSearch::none, RecslamSearch::printed, RecslamSearch::tabu}) {
    double& sum = cut[static_cast<int>(search)] = 0.0;
    for (std::uint64_t seed = 1; seed <= 10; ++seed)
      sum += make_plan(random_problem(30, 3, seed), {PlanMethod::recslam, 1, {}, {search}}).cut_weight;
  }
  EXPECT_LT(cut[1], cut[0]);
  EXPECT_LE(cut[2], cut[1]);
}

TEST(Plan, sends_robots_to_further_edges_where_it_is_asked_to) {
  const Problem problem = random_problem(6, 3, 4);
  PlanOptions options;
  const double once = make_plan(problem, options).predicted_seconds;
  options.edges_per_robot = 2;
  const Plan plan = make_plan(problem, options);
  ASSERT_EQ(plan.further_edges_of.size(), 6u);
  for (std::uint32_t robot = 0; robot < 6; ++robot) {
    ASSERT_EQ(plan.further_edges_of[robot].size(), 1u);
    EXPECT_NE(plan.further_edges_of[robot].front(), plan.edge_of[robot]);
  }
  EXPECT_GT(plan.predicted_seconds, once);
  EXPECT_LE(plan.lower_bound_seconds, plan.predicted_seconds);
  options.edges_per_robot = 4;
  EXPECT_THROW(make_plan(problem, options), Error);
}

TEST(Plan, refuses_too_many_robots_for_the_exact_method) {
  EXPECT_THROW(make_plan(random_problem(17, 3, 1), {PlanMethod::exact, 1, {}}), Error);
}

}  // namespace
}  // namespace mapweave::scheduling
