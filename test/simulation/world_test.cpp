#include "every_plan.h"

#include <mapweave/core/error.h>
#include <mapweave/core/hash.h>
#include <mapweave/simulation/world.h>

#include <support/pose_matchers.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

namespace mapweave::simulation {
namespace {

WorldOptions small_world() {
  WorldOptions options;
  options.robots.resize(2);
  options.robots[0].id = "alpha";
  options.robots[1].id = "beta";
  for (RobotOptions& robot : options.robots) robot.length_m = 15.0;
  return options;
}

World built(const WorldOptions& options) {
  WorkerPool here(1);
  return World(options, here);
}

// The hash of everything that a robot recorded, truth included.
std::map<std::string, std::string> recordings(const WorldOptions& options, int threads) {
  WorkerPool pool(threads);
  const World world(options, pool);
  const auto hashes = pool.map(world.robot_count(), [&](std::size_t robot) {
    Recording recording(world, robot);
    Hasher hasher;
    while (const auto step = recording.next()) {
      hasher.add(step->stamp.ns);
      for (const Pose2& pose : {step->world_from_robot, step->odometry_from_robot})
        hasher.add(pose.x).add(pose.y).add(pose.phi);
      for (const float range : step->ranges) hasher.add(static_cast<double>(range));
    }
    return to_hex(hasher.finish());
  });
  std::map<std::string, std::string> by_name;
  for (std::size_t i = 0; i < hashes.size(); ++i) by_name[world.robot_id(i).str()] = hashes[i];
  return by_name;
}

TEST(World, records_the_same_whatever_the_threads_and_the_order_of_robots) {
  WorldOptions options = small_world();
  options.people.count = 2;
  const auto once = recordings(options, 1);
  EXPECT_EQ(recordings(options, 3), once);
  std::reverse(options.robots.begin(), options.robots.end());
  EXPECT_EQ(recordings(options, 2), once);
}

TEST(World, records_something_else_for_another_seed) {
  WorldOptions options = small_world();
  const auto once = recordings(options, 1);
  options.seed = 2;
  const auto other = recordings(options, 1);
  for (const auto& [robot, hash] : once) EXPECT_NE(other.at(robot), hash);
}

TEST(World, keeps_a_building_of_its_own_seed_while_the_world_changes) {
  WorldOptions options = small_world();
  options.buildings.resize(1);
  options.buildings[0].seed = 5;
  const FloorPlan once = built(options).buildings()[0];
  options.seed = 99;
  const FloorPlan again = built(options).buildings()[0];
  ASSERT_EQ(once.walls.size(), again.walls.size());
  for (std::size_t i = 0; i < once.walls.size(); ++i) EXPECT_EQ(once.walls[i].from.x, again.walls[i].from.x);
}

TEST(Recording, shows_walls_where_they_are_from_where_the_truth_says_the_robot_is) {
  WorldOptions options = small_world();
  options.robot_radius_m = 0.0;
  options.laser.x_m = 0.15;
  options.laser.yaw_deg = 7.0;
  options.laser.outliers = 0.0;
  const World world = built(options);
  Recording recording(world, 0);
  double worst = 0.0, square = 0.0;
  int points = 0, scans = 0;
  while (const auto step = recording.next()) {
    if (step->ranges.empty()) continue;
    if (scans++ % 10 != 0) continue;
    const Pose2 world_from_laser = compose(step->world_from_robot, options.laser.robot_from_laser());
    for (std::size_t ray = 0; ray < step->ranges.size(); ray += 5) {
      if (step->ranges[ray] == 0.0f) continue;
      const double angle = world_from_laser.phi + options.laser.first_angle_rad() +
                           static_cast<double>(ray) * options.laser.angle_step_rad();
      const double away = test::distance_to_nearest_wall(world.buildings()[0],
                                                         {world_from_laser.x + step->ranges[ray] * std::cos(angle),
                                                          world_from_laser.y + step->ranges[ray] * std::sin(angle)});
      worst = std::max(worst, away);
      square += away * away;
      ++points;
    }
  }
  ASSERT_GT(points, 400);
  EXPECT_LT(worst, 6.0 * (0.01 + 0.001 * 20.0));
  EXPECT_LT(std::sqrt(square / points), 0.02);
  EXPECT_GT(std::sqrt(square / points), 0.005);
}

TEST(Recording, keeps_one_clock_for_all_robots) {
  WorldOptions options = small_world();
  options.robots[1].start_s = 3.0;
  const World world = built(options);
  Recording alpha(world, 0), beta(world, 1);
  const auto first_of_alpha = alpha.next(), first_of_beta = beta.next();
  EXPECT_DOUBLE_EQ(seconds_between(first_of_alpha->stamp, first_of_beta->stamp), 3.0);
  Stamp last = first_of_alpha->stamp;
  int index = 0;
  while (const auto step = alpha.next()) {
    ++index;
    EXPECT_EQ(step->stamp.ns - last.ns, 100'000'000) << "10 readings a second, 5 of them with a scan";
    EXPECT_EQ(step->ranges.empty(), index % 2 == 1);
    last = step->stamp;
  }
  EXPECT_EQ(static_cast<std::size_t>(index) + 1, world.step_count(0));
  EXPECT_EQ(static_cast<std::size_t>(index) / 2 + 1, world.scan_count(0));
}

TEST(Recording, without_wheel_errors_has_the_truth_as_odometry) {
  WorldOptions options = small_world();
  options.odometry = perfect_odometry();
  const World world = built(options);
  Recording recording(world, 0);
  const Pose2 world_from_start = world.trajectory(0).at(0.0);
  while (const auto step = recording.next()) {
    ASSERT_THAT(step->odometry_from_robot, test::IsNear(between(world_from_start, step->world_from_robot), 1e-9, 1e-9));
  }
}

TEST(Recording, sees_another_robot_only_where_robots_have_a_size) {
  WorldOptions options = small_world();
  options.buildings.resize(1);
  options.buildings[0].kind = PlanKind::hall;
  options.buildings[0].hall.pillars = options.buildings[0].hall.clutter = 0;
  options.laser.noise_m = options.laser.noise_per_m = options.laser.outliers = options.laser.dropouts = 0.0;
  options.robots[0].waypoints = {{5.0, 10.0}, {10.0, 10.0}};
  options.robots[1].waypoints = {{8.0, 10.0}, {8.0, 15.0}};
  const auto ahead = [&] { return Recording(built(options), 0).next()->ranges[90]; };
  EXPECT_NEAR(ahead(), 2.8, 1e-5);
  options.robot_radius_m = 0.0;
  EXPECT_EQ(ahead(), 0.0f);  // the hall's wall is 25 m ahead, out of reach
  options.laser.max_range_m = 40.0;
  EXPECT_NEAR(ahead(), 25.0, 1e-4);
}

TEST(Recording, sees_people_walk_by) {
  WorldOptions options = small_world();
  options.laser.noise_m = options.laser.noise_per_m = options.laser.outliers = options.laser.dropouts = 0.0;
  options.robot_radius_m = 0.0;
  const auto alone = recordings(options, 1);
  options.people.count = 5;
  EXPECT_NE(recordings(options, 1).at("alpha"), alone.at("alpha"));
}

TEST(World, drives_the_wanted_length_in_as_many_laps_as_it_takes) {
  WorldOptions options = small_world();
  options.robots[0].length_m = 150.0;
  options.robots[0].last_room = 1;
  EXPECT_NEAR(built(options).trajectory(0).length_m(), 150.0, 1e-6);
}

TEST(World, returns_to_the_start_and_drives_laps) {
  WorldOptions options = small_world();
  RobotOptions& robot = options.robots[0];
  robot.length_m = 0.0;
  const World once = built(options);
  const SimulatedTrajectory& lap = once.trajectory(0);
  EXPECT_LT(std::hypot(lap.at(0.0).x - lap.at(1e9).x, lap.at(0.0).y - lap.at(1e9).y), 1e-6);
  robot.laps = 2;
  EXPECT_NEAR(built(options).trajectory(0).length_m(), 2.0 * lap.length_m(), 0.2 * lap.length_m());
}

TEST(World, keeps_robots_to_their_rooms) {
  WorldOptions options = small_world();
  options.buildings.resize(1);
  options.buildings[0].kind = PlanKind::repeated_rooms;
  options.robots[0].last_room = 2;
  options.robots[1].first_room = 3;
  for (RobotOptions& robot : options.robots) robot.length_m = 0.0;
  const World world = built(options);
  const auto enters = [&](std::size_t robot, const Room& room) {
    const auto& knots = world.trajectory(robot).knots();
    return std::any_of(knots.begin(), knots.end(), [&](const auto& knot) {
      return room.inside.contains({knot.world_from_robot.x, knot.world_from_robot.y});
    });
  };
  const auto& rooms = world.buildings()[0].rooms;
  for (std::size_t i = 0; i < rooms.size(); ++i) {
    EXPECT_EQ(enters(0, rooms[i]), i <= 2) << rooms[i].name;
    EXPECT_EQ(enters(1, rooms[i]), i >= 3) << rooms[i].name;
  }
}

TEST(World, puts_buildings_where_no_laser_of_one_sees_the_other) {
  WorldOptions options = small_world();
  options.buildings.resize(2);
  options.buildings[1].kind = PlanKind::ring;
  options.robots[1].building = 1;
  const World world = built(options);
  EXPECT_FALSE(bounds(world.buildings()[0]).overlaps(bounds(world.buildings()[1])));
  const Pose2 beta = world.trajectory(1).at(0.0);
  EXPECT_TRUE(bounds(world.buildings()[1]).contains({beta.x, beta.y}));
}

void expect_error(const WorldOptions& options, const std::string& message) {
  try {
    built(options);
    ADD_FAILURE() << "no error; expected: " << message;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), testing::HasSubstr(message));
  }
}

TEST(World, says_why_it_cannot_be) {
  WorldOptions none = small_world();
  none.robots.clear();
  expect_error(none, "no robots");

  WorldOptions twins = small_world();
  twins.robots[1].id = "alpha";
  expect_error(twins, "two robots have this id");

  WorldOptions slashed = small_world();
  slashed.robots[0].id = "../alpha";
  expect_error(slashed, "cannot be a robot's id");

  WorldOptions elsewhere = small_world();
  elsewhere.robots[0].building = 1;
  expect_error(elsewhere, "there is no building 1");

  WorldOptions missing = small_world();
  missing.robots[0].first_room = 400;
  expect_error(missing, "the building has 0 to");

  WorldOptions outside = small_world();
  outside.robots[0].waypoints = {{-30.0, 4.0}};
  expect_error(outside, "no free point near");

  WorldOptions wide = small_world();
  wide.motion.clearance_m = 0.6;
  expect_error(wide, "robot 'alpha'");

  WorldOptions nowhere = small_world();
  nowhere.robots[0].waypoints = {{9.0, 6.5}};
  expect_error(nowhere, "leads nowhere");

  WorldOptions slow = small_world();
  slow.motion.speed_max_m_per_s = 0.1;
  expect_error(slow, "speed");
}

}  // namespace
}  // namespace mapweave::simulation
