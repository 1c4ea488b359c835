#include "every_plan.h"

#include <mapweave/simulation/tiny_worlds.h>

#include <support/simulated_inputs.h>

#include <gtest/gtest.h>

#include <cmath>

namespace mapweave::simulation {
namespace {

int scans_from(const SimulatedRobot& robot, const Room& room) {
  int scans = 0;
  for (const SimulatedStep& step : robot.steps)
    scans += room.inside.contains({step.world_from_robot.x, step.world_from_robot.y});
  return scans;
}

TEST(TinyWorlds, have_a_scan_at_every_step_and_robots_by_number) {
  TeamOptions options;
  options.robots = 3;
  options.length_m = 8.0;
  for (const SimulatedTeam& team :
       {make_corridor({}, options), make_apartment({}, options), make_repeated_rooms({}, options),
        make_mirrored_rooms({}, options), make_ring({}, options), make_two_strangers({}, options)}) {
    ASSERT_EQ(team.robots.size(), 3u);
    for (std::size_t i = 0; i < 3; ++i) {
      EXPECT_EQ(team.robots[i].id.str(), "robot" + std::to_string(i));
      EXPECT_GT(team.robots[i].steps.size(), 40u);
      for (const SimulatedStep& step : team.robots[i].steps) ASSERT_EQ(step.ranges.size(), 181u);
    }
  }
}

TEST(TinyWorlds, share_out_the_rooms_of_a_building) {
  TeamOptions options;
  options.shared = 0.0;
  const SimulatedTeam disjoint = make_repeated_rooms({}, options);
  options.shared = 0.5;
  const SimulatedTeam half = make_repeated_rooms({}, options);
  options.shared = 1.0;
  const SimulatedTeam all = make_repeated_rooms({}, options);
  const auto& rooms = disjoint.buildings[0].rooms;
  int visited_by_both_of_half = 0;
  for (const Room& room : rooms) {
    EXPECT_NE(scans_from(disjoint.robots[0], room) > 0, scans_from(disjoint.robots[1], room) > 0) << room.name;
    EXPECT_GT(scans_from(all.robots[0], room), 0) << room.name;
    EXPECT_GT(scans_from(all.robots[1], room), 0) << room.name;
    visited_by_both_of_half += scans_from(half.robots[0], room) > 0 && scans_from(half.robots[1], room) > 0;
  }
  EXPECT_EQ(visited_by_both_of_half, 2);  // of 4 that each visits
}

TEST(TinyWorlds, keep_strangers_in_different_buildings) {
  TeamOptions options;
  options.length_m = 5.0;
  const SimulatedTeam team = make_two_strangers({}, options);
  ASSERT_EQ(team.buildings.size(), 2u);
  EXPECT_EQ(team.robots[0].building, 0u);
  EXPECT_EQ(team.robots[1].building, 1u);
  EXPECT_NE(team.buildings[0].walls.size(), team.buildings[1].walls.size()) << "each building has a seed of its own";
}

TEST(TinyWorlds, become_scans_whose_points_lie_on_walls) {
  TeamOptions options;
  options.robots = 1;
  options.length_m = 6.0;
  options.laser.outliers = 0.0;
  options.laser.x_m = 0.2;
  const SimulatedTeam team = make_apartment({}, options);
  const auto geometry = test::scan_geometry(team.laser);
  for (std::size_t i = 0; i < team.robots[0].steps.size(); i += 7) {
    const SimulatedStep& step = team.robots[0].steps[i];
    const auto points = points_in_robot(test::packed(step.ranges, geometry));
    EXPECT_GT(points.size(), 100u);
    for (const ScanPoint& point : points) {
      const Pose2 in_world = compose(step.world_from_robot, {point.x, point.y, 0.0});
      ASSERT_LT(test::distance_to_nearest_wall(team.buildings[0], {in_world.x, in_world.y}), 0.15);
    }
  }
}

}  // namespace
}  // namespace mapweave::simulation
