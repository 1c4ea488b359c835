#include <mapweave/scheduling/overlap_estimate.h>

#include <gtest/gtest.h>
#include <mapweave/maps/coordination.h>
#include <support/simulated_maps.h>

#include <cmath>
#include <random>
#include <set>

namespace mapweave::scheduling {
namespace {

simulation::SimulatedTeam apartment(std::int64_t seed, int robots = 2, double shared = 0.5) {
  simulation::TeamOptions options;
  options.robots = robots;
  options.shared = shared;
  options.seed = seed;
  return simulation::make_apartment({}, options);
}

MapSummary summary_of(const simulation::SimulatedTeam& team, std::size_t robot) {
  return scheduling::summary_of(test::truth_map(team.robots[robot], team.laser));
}

Pose2 a_from_b(const simulation::SimulatedTeam& team, std::size_t a, std::size_t b) {
  return between(team.robots[a].steps.front().world_from_robot, team.robots[b].steps.front().world_from_robot);
}

TEST(MapSummary, draws_what_the_robot_saw_in_a_few_hundred_bytes) {
  const auto team = apartment(1);
  const MapSummary summary = summary_of(team, 0);
  std::size_t walls = 0;
  for (const auto cell : summary.cells) walls += cell == MapSummary::Cell::wall;
  EXPECT_GT(summary.known(), 100u);
  EXPECT_GT(walls, 40u);
  EXPECT_LT(walls, summary.known() * 7 / 10);
  // Where the robot drove, nothing stands.
  const Pose2 start = team.robots[0].steps.front().world_from_robot;
  for (const auto& step : team.robots[0].steps) {
    const Pose2 pose = between(start, step.world_from_robot);
    EXPECT_EQ(summary.at(static_cast<std::int64_t>(std::floor(pose.x / MapSummary::kCell_m)),
                         static_cast<std::int64_t>(std::floor(pose.y / MapSummary::kCell_m))),
              MapSummary::Cell::free);
  }
  EXPECT_LT(encode(MapReport{RobotId("a"), 100, summary}).size(), 3000u);
}

TEST(MapSummary, is_empty_for_a_map_without_content) {
  EXPECT_EQ(scheduling::summary_of(Map()).known(), 0u);
  EXPECT_EQ(overlap_degree({}, {}, {}), 0.0);
  EXPECT_FALSE(estimate_overlap({}, {}));
}

TEST(OverlapDegree, is_that_of_sets) {
  const MapSummary a = summary_of_route({{0, 0}, {10, 0}}, 2.0), b = summary_of_route({{5, 0}, {15, 0}}, 2.0);
  EXPECT_DOUBLE_EQ(overlap_degree(a, a, {}), 0.5);
  EXPECT_DOUBLE_EQ(overlap_degree(a, b, {100.0, 0.0, 0.0}), 0.0);
  // Sausages of 52.6 square metres each; what both saw: one of five metres.
  EXPECT_NEAR(overlap_degree(a, b, {}), 32.6 / 105.1, 0.02);
  EXPECT_DOUBLE_EQ(overlap_degree(a, b, {}), overlap_degree(b, a, {}));
}

TEST(EstimatedOverlap, finds_how_two_robots_maps_lie) {
  int found = 0, right = 0;
  double error = 0.0;
  constexpr int kWorlds = 12;
  for (int seed = 1; seed <= kWorlds; ++seed) {
    const auto team = apartment(seed);
    const MapSummary a = summary_of(team, 0), b = summary_of(team, 1);
    const Pose2 truth = a_from_b(team, 0, 1);
    const double degree = overlap_degree(a, b, truth);
    const auto estimate = estimate_overlap(a, b), swapped = estimate_overlap(b, a);
    ASSERT_EQ(estimate.has_value(), swapped.has_value()) << seed;
    if (!estimate) continue;
    const Pose2 product = compose(estimate->a_from_b, swapped->a_from_b);
    EXPECT_LT(std::hypot(product.x, product.y) + std::abs(product.phi), 0.3) << seed;
    ++found;
    const Pose2 off = between(truth, estimate->a_from_b);
    const bool is_right = std::hypot(off.x, off.y) < 1.5 && std::abs(off.phi) < 0.15;
    right += is_right;
    error += std::abs(estimate->degree - degree);
  }
  EXPECT_GE(found, kWorlds * 3 / 4);
  EXPECT_GE(right, found - 1);
  EXPECT_LT(error / std::max(1, found), 0.03);
}

TEST(EstimatedOverlap, finds_little_between_strangers) {
  constexpr int kWorlds = 8;
  for (int seed = 1; seed <= kWorlds; ++seed) {
    simulation::TeamOptions options;
    options.seed = seed;
    const auto team = simulation::make_two_strangers({}, options);
    EXPECT_FALSE(estimate_overlap(summary_of(team, 0), summary_of(team, 1))) << seed;
  }
}

TEST(OverlapEstimator, knows_who_shares_something_as_maps_grow) {
  const auto team = apartment(4, 3, 0.4);
  OverlapEstimator estimator;
  EXPECT_TRUE(estimator.overlaps().empty());
  for (std::size_t robot = 0; robot < 3; ++robot) estimator.put(team.robots[robot].id, summary_of(team, robot));
  const auto shared = estimator.overlaps();
  ASSERT_FALSE(shared.empty());
  for (const auto& [a, b, degree] : shared) {
    EXPECT_LT(a, b);
    EXPECT_GT(degree, 0.0);
    EXPECT_LE(degree, 0.5);
  }
  const auto again = estimator.overlaps();
  ASSERT_EQ(again.size(), shared.size());
  EXPECT_EQ(again.front().degree, shared.front().degree);
  estimator.put(team.robots[0].id, {});  // it began anew
  for (const auto& [a, b, degree] : estimator.overlaps()) EXPECT_NE(a, team.robots[0].id);
}

TEST(OverlapEstimator, compares_ten_thousand_routes_without_all_pairs) {
  std::mt19937 random(3);
  OverlapEstimator estimator;
  constexpr int kRobots = 10000;
  const auto place = [&] { return static_cast<double>(random() % 1000); };
  std::vector<Waypoint> starts;
  for (int i = 0; i < kRobots; ++i) {
    starts.push_back({place(), place()});
    estimator.put(RobotId("r" + std::to_string(i)),
                  summary_of_route({starts.back(), {starts.back().x_m + 10.0, starts.back().y_m}}, 4.0));
  }
  const auto shared = estimator.overlaps();
  EXPECT_LT(shared.size(), std::size_t{kRobots} * 8);
  // Who drives where others do is known to: of those whose routes begin within two metres, nearly all.
  std::set<std::pair<RobotId, RobotId>> known;
  for (const auto& [a, b, degree] : shared) known.emplace(a, b);
  int near = 0, found = 0;
  for (int i = 0; i < kRobots; ++i)
    for (int j = i + 1; j < kRobots; ++j) {
      if (std::hypot(starts[i].x_m - starts[j].x_m, starts[i].y_m - starts[j].y_m) > 2.0) continue;
      const RobotId a("r" + std::to_string(i)), b("r" + std::to_string(j));
      ++near;
      found += known.count({std::min(a, b), std::max(a, b)}) != 0;
    }
  EXPECT_GT(near, 200);
  EXPECT_GT(found, near * 95 / 100);
}

}  // namespace
}  // namespace mapweave::scheduling
