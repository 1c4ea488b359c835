// Scans bent by motion, and how the engine `graph` undistorts them.
#include <gtest/gtest.h>
#include <support/simulated_maps.h>

#include "sweep_estimator.h"

namespace mapweave::laser {
namespace {

using test::error_m;
using test::mapped;
using test::scan_geometry;
using test::swept_geometry;

// A robot that turns fast, with a small laser that turns slowly.
simulation::TeamOptions bent_by(double sweep_s, bool clockwise = false, std::int64_t seed = 7) {
  simulation::TeamOptions options;
  options.robots = 1;
  options.length_m = 30.0;
  options.seed = seed;
  options.motion.turn_rate_deg_per_s = 100.0;
  options.laser.rays = 241;
  options.laser.field_of_view_deg = 240.0;
  options.laser.max_range_m = 8.0;
  options.laser.sweep_s = sweep_s;
  options.laser.clockwise = clockwise;
  options.laser.sweep_stamp = 0.5;
  return options;
}

SweepEstimator estimated(const simulation::SimulatedTeam& team, bool with_odometry) {
  const auto geometry = scan_geometry(team.laser);
  SweepEstimator estimator{SweepOptions{}};
  for (const auto& step : team.robots[0].steps) {
    if (with_odometry) estimator.add_odometry(step.stamp, step.odometry_from_robot);
    estimator.add(step.stamp, test::packed(step.ranges, geometry), step.world_from_robot, true);
  }
  estimator.finish();
  return estimator;
}

std::string described(const SweepEstimate& estimate) {
  const auto one = [](const Estimated& number) {
    return std::to_string(number.value) + " +- " + std::to_string(number.sigma);
  };
  const auto& known = estimate.by_odometry;
  return "sweep " + one(estimate.sweep_s) +
         (known ? ", delay " + one(known->delay_s) + ", scale " + one(known->turn_scale) : "") + ", of " +
         std::to_string(estimate.pairs);
}

TEST(SweepEstimator, finds_how_long_a_laser_takes_to_turn_and_in_which_order) {
  for (const bool with_odometry : {false, true})
    for (const bool clockwise : {false, true})
      for (const double sweep_s : {0.04, 0.067, 0.1}) {
        const auto estimator = estimated(simulation::make_apartment({}, bent_by(sweep_s, clockwise)), with_odometry);
        EXPECT_NEAR(estimator.sweep_s(), clockwise ? -sweep_s : sweep_s, 0.15 * sweep_s)
            << described(estimator.estimate());
        EXPECT_EQ(estimator.delay_s(), 0.0) << described(estimator.estimate());
      }
}

TEST(SweepEstimator, finds_nothing_where_there_is_nothing) {
  for (std::int64_t seed = 1; seed <= 8; ++seed) {
    const auto estimator = estimated(simulation::make_apartment({}, bent_by(0.0, false, seed)), seed % 2 == 0);
    EXPECT_EQ(estimator.sweep_s(), 0.0) << described(estimator.estimate()) << ", seed " << seed;
    EXPECT_EQ(estimator.delay_s(), 0.0) << described(estimator.estimate()) << ", seed " << seed;
    EXPECT_NEAR(estimator.estimate().sweep_s.value, 0.0, 0.01) << "seed " << seed;
  }
}

TEST(SweepEstimator, finds_how_late_scans_are_stamped) {
  for (const double sweep_s : {0.0, 0.1})
    for (const double delay_s : {-0.1, 0.15}) {
      auto team = simulation::make_apartment({}, bent_by(sweep_s));
      const auto geometry = scan_geometry(team.laser);
      const auto& steps = team.robots[0].steps;
      SweepEstimator estimator{SweepOptions{}};
      std::size_t next = 0;
      for (const auto& step : steps) {
        const Stamp stamp{step.stamp.ns + std::llround(delay_s * 1e9)};
        for (; next < steps.size() && steps[next].stamp <= stamp; ++next)
          estimator.add_odometry(steps[next].stamp, steps[next].odometry_from_robot);
        estimator.add(stamp, test::packed(step.ranges, geometry), step.world_from_robot, true);
      }
      estimator.finish();
      EXPECT_NEAR(estimator.delay_s(), delay_s, 0.015) << described(estimator.estimate());
      EXPECT_NEAR(estimator.sweep_s(), sweep_s, 0.015) << described(estimator.estimate());
    }
}

TEST(SweepEstimator, takes_no_wheels_that_turn_too_little_for_a_delay) {
  for (const double scale : {0.9, 1.1}) {
    const auto team = simulation::make_apartment({}, bent_by(0.06));
    const auto geometry = scan_geometry(team.laser);
    SweepEstimator estimator{SweepOptions{}};
    double turned_rad = 0.0, last_rad = team.robots[0].steps.front().odometry_from_robot.phi;
    for (const auto& step : team.robots[0].steps) {
      turned_rad += wrap_angle(step.odometry_from_robot.phi - last_rad);
      last_rad = step.odometry_from_robot.phi;
      estimator.add_odometry(step.stamp,
                             {step.odometry_from_robot.x, step.odometry_from_robot.y, wrap_angle(scale * turned_rad)});
      estimator.add(step.stamp, test::packed(step.ranges, geometry), step.world_from_robot, true);
    }
    estimator.finish();
    ASSERT_TRUE(estimator.estimate().by_odometry);
    EXPECT_NEAR(estimator.estimate().by_odometry->turn_scale.value, 1.0 / scale, 0.015)
        << described(estimator.estimate());
    EXPECT_EQ(estimator.delay_s(), 0.0) << described(estimator.estimate());
    EXPECT_NEAR(estimator.sweep_s(), 0.06, 0.01) << described(estimator.estimate());
  }
}

TEST(GraphMapper, undistorts_the_scans_of_a_laser_whose_sweep_is_known) {
  const auto team = simulation::make_apartment({}, bent_by(0.1));
  GraphMapperOptions never;
  never.sweep.estimate = false;
  const double bent = error_m(mapped(team.robots[0], scan_geometry(team.laser), true, never), team.robots[0]);
  const double straight = error_m(mapped(team.robots[0], swept_geometry(team.laser)), team.robots[0]);
  EXPECT_LT(straight, 0.02);
  EXPECT_LT(straight, 0.7 * bent);
}

TEST(GraphMapper, learns_the_sweep_of_a_laser_from_its_scans) {
  const auto team = simulation::make_apartment({}, bent_by(0.1, true));
  const Map map = mapped(team.robots[0], scan_geometry(team.laser));
  ASSERT_EQ(map.nodes.size(), team.robots[0].steps.size());
  EXPECT_LT(error_m(map, team.robots[0]), 0.02);
  std::size_t scans = 0;
  for (const auto& [id, node] : map.nodes) {
    if (!node.payload) continue;
    const auto& geometry = *std::get<PackedScan>(*node.payload).geometry;
    EXPECT_NEAR(geometry.ray_step_s * (geometry.ray_count - 1), -0.1, 0.015) << "from the first scan on";
    ++scans;
  }
  EXPECT_GT(scans, 0U);
}

TEST(GraphMapper, undistorts_scans_without_odometry) {
  const auto team = simulation::make_apartment({}, bent_by(0.1));
  GraphMapperOptions never;
  never.sweep.estimate = false;
  const double bent = error_m(mapped(team.robots[0], scan_geometry(team.laser), false, never), team.robots[0]);
  const double straight = error_m(mapped(team.robots[0], swept_geometry(team.laser), false), team.robots[0]);
  EXPECT_LT(straight, bent);
  EXPECT_LT(straight, 0.1);
}

// Of all nodes against the truth, in degrees, the first node laid on it.
double worst_heading_deg(const Map& map, const simulation::SimulatedRobot& robot) {
  double worst = 0.0;
  std::size_t i = 0;
  for (const auto& [id, node] : map.nodes) {
    const Pose2 truth = between(robot.steps.front().world_from_robot, robot.steps.at(i++).world_from_robot);
    worst = std::max(worst, std::abs(wrap_angle(planar(node.map_from_node).phi - truth.phi)));
  }
  return worst * 180.0 / M_PI;
}

TEST(GraphMapper, believes_no_wheels_that_slip_while_the_laser_turns) {
  auto options = bent_by(0.1);
  options.laser.sweep_stamp = 0.0;
  options.laser.scans_per_second = 10.0;
  options.motion.turn_rate_deg_per_s = 20.0;
  options.odometry.slips_per_100_m = 40.0;
  options.odometry.slip_min_deg = 8.0;
  for (const std::int64_t seed : {7, 8, 9, 10}) {
    options.seed = seed;
    const auto team = simulation::make_apartment({}, options);
    const Map map = mapped(team.robots[0], swept_geometry(team.laser));
    EXPECT_LT(worst_heading_deg(map, team.robots[0]), 1.5) << seed;
    EXPECT_LT(error_m(map, team.robots[0]), 0.02) << seed;
  }
}

TEST(GraphMapper, makes_the_same_map_whether_or_not_it_looks_for_a_sweep_that_is_not_there) {
  const auto team = simulation::make_apartment({}, bent_by(0.0));
  GraphMapperOptions never;
  never.sweep.estimate = false;
  const Map map = mapped(team.robots[0], team.laser), as_before = mapped(team.robots[0], team.laser, true, never);
  EXPECT_EQ(content_hash(map), content_hash(as_before));
  for (const auto& [id, node] : as_before.nodes) EXPECT_EQ(map.nodes.find(id)->map_from_node.t, node.map_from_node.t);
}

}  // namespace
}  // namespace mapweave::laser
