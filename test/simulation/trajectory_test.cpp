#include "every_plan.h"

#include <mapweave/simulation/random.h>
#include <mapweave/simulation/trajectory.h>

#include <support/pose_matchers.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace mapweave::simulation {
namespace {

TEST(FreeSpace, never_claims_more_room_than_there_is) {
  const FloorPlan plan = make_apartment_plan({}, 8);
  const FreeSpace space(plan, 0.25);
  RandomNumbers numbers = RandomStream(1, "points").at(0);
  int inside = 0;
  for (int i = 0; i < 3000; ++i) {
    const Point2 p{numbers.uniform(-1.0, 19.0), numbers.uniform(-1.0, 14.0)};
    const double distance_m = space.distance_to_walls(p);
    EXPECT_LE(distance_m, test::distance_to_nearest_wall(plan, p)) << p.x << " " << p.y;
    inside += distance_m >= 0.25;
  }
  EXPECT_GT(inside, 800);
}

TEST(FreeSpace, knows_no_path_out_of_the_building_or_through_narrow_doors) {
  ApartmentOptions options;
  options.connecting_doors = 0.0;
  options.door_width_m = 0.7;
  const FloorPlan plan = make_apartment_plan(options, 8);
  EXPECT_FALSE(FreeSpace(plan, 0.2).nearest_free({-5.0, -5.0}));
  EXPECT_EQ(FreeSpace(plan, 0.2).distance_to_walls({-0.5, 5.0}), 0.0);
  const FreeSpace wide(plan, 0.4), narrow(plan, 0.2);
  const Point2 from = plan.rooms.front().inside.centre(), to = plan.rooms.back().inside.centre();
  EXPECT_TRUE(narrow.path(from, to));
  EXPECT_FALSE(wide.path(from, to));
}

TEST(FreeSpace, goes_straight_in_the_open) {
  HallOptions options;
  options.pillars = options.clutter = 0;
  const auto path = FreeSpace(make_hall_plan(options, 1), 0.3).path({5.0, 5.0}, {25.0, 12.0});
  ASSERT_TRUE(path);
  EXPECT_EQ(path->size(), 2u);
}

// A tour of all rooms, its legs planned one after the other.
SimulatedTrajectory tour(const FloorPlan& plan, const FreeSpace& space, const MotionOptions& motion,
                         double length_m = 0.0) {
  std::vector<Leg> legs;
  for (std::size_t i = 1; i < plan.rooms.size(); ++i) {
    auto path = space.path(*space.nearest_free(plan.rooms[i - 1].inside.centre()),
                           *space.nearest_free(plan.rooms[i].inside.centre()));
    EXPECT_TRUE(path);
    legs.push_back({*path, 0.3 + 0.05 * static_cast<double>(i % 8)});
  }
  if (legs.empty()) legs.push_back({{plan.rooms[0].inside.centre(), plan.rooms[0].inside.centre()}, 0.5});
  return drive(legs, space, motion, length_m);
}

TEST(Drive, keeps_its_clearance_from_every_wall) {
  const MotionOptions motion;
  for (const std::uint64_t seed : {1u, 2u}) {
    for (const auto& [name, plan] : test::every_plan(seed)) {
      const SimulatedTrajectory trajectory = tour(plan, FreeSpace(plan, motion.clearance_m), motion);
      for (double t = 0.0; t <= trajectory.duration_s(); t += 0.2) {
        const Pose2 pose = trajectory.at(t);
        ASSERT_GE(test::distance_to_nearest_wall(plan, {pose.x, pose.y}), motion.clearance_m)
            << name << " seed " << seed << " at " << t;
      }
    }
  }
}

TEST(Drive, obeys_its_limits_and_looks_where_it_goes) {
  MotionOptions motion;
  motion.turn_rate_deg_per_s = 40.0;
  const FloorPlan plan = make_apartment_plan({}, 4);
  const SimulatedTrajectory trajectory = tour(plan, FreeSpace(plan, motion.clearance_m), motion);
  constexpr double kStep = 0.05;
  double fastest = 0.0, sharpest = 0.0, hardest = 0.0, last_speed = 0.0;
  for (double t = kStep; t < trajectory.duration_s(); t += kStep) {
    const Pose2 step = between(trajectory.at(t - kStep), trajectory.at(t));
    const double speed = std::hypot(step.x, step.y) / kStep;
    fastest = std::max(fastest, speed);
    sharpest = std::max(sharpest, std::abs(step.phi) / kStep);
    hardest = std::max(hardest, std::abs(speed - last_speed) / kStep);
    last_speed = speed;
    EXPECT_NEAR(step.y, 0.0, 0.004) << "sideways at " << t;
    EXPECT_GE(step.x, -1e-9) << "backwards at " << t;
  }
  EXPECT_LE(fastest, 0.65 + 1e-6);
  EXPECT_GT(fastest, 0.5);
  EXPECT_LE(sharpest * 180.0 / M_PI, 40.0 + 0.5);
  EXPECT_GT(sharpest * 180.0 / M_PI, 20.0);
  EXPECT_LE(hardest, 1.2 * motion.acceleration_m_per_s2);
}

TEST(Drive, visits_every_room) {
  const FloorPlan plan = make_apartment_plan({}, 6);
  const SimulatedTrajectory trajectory = tour(plan, FreeSpace(plan, 0.3), {});
  for (const Room& room : plan.rooms) {
    EXPECT_TRUE(std::any_of(trajectory.knots().begin(), trajectory.knots().end(),
                            [&](const SimulatedTrajectory::Knot& knot) {
                              return room.inside.contains({knot.world_from_robot.x, knot.world_from_robot.y});
                            }))
        << room.name;
  }
}

TEST(Drive, stops_at_the_wanted_length) {
  const FloorPlan plan = make_ring_plan({}, 6);
  const FreeSpace space(plan, 0.3);
  const SimulatedTrajectory whole = tour(plan, space, {}), part = tour(plan, space, {}, 17.5);
  EXPECT_GT(whole.length_m(), 40.0);
  EXPECT_NEAR(part.length_m(), 17.5, 1e-6);
  EXPECT_THAT(part.at(0.0), test::IsNear(whole.at(0.0), 0.0, 0.0));
}

TEST(SimulatedTrajectory, stands_still_before_and_after) {
  const SimulatedTrajectory trajectory({{0.0, {1.0, 2.0, 3.1}, 1.0}, {2.0, {3.0, 2.0, -3.1}, 1.0}});
  EXPECT_THAT(trajectory.at(-1.0), test::IsNear(Pose2{1.0, 2.0, 3.1}, 0.0, 0.0));
  EXPECT_THAT(trajectory.at(1.0), test::IsNear(Pose2{2.0, 2.0, -M_PI}, 1e-12, 1e-12)) << "turns the short way";
  EXPECT_THAT(trajectory.at(9.0), test::IsNear(Pose2{3.0, 2.0, -3.1}, 0.0, 0.0));
}

TEST(SimulatedTrajectory, speeds_up_evenly_between_knots) {
  const SimulatedTrajectory trajectory({{0.0, {0.0, 0.0, 0.0}, 0.0}, {2.0, {1.0, 0.0, 0.0}, 1.0}});
  EXPECT_DOUBLE_EQ(trajectory.at(1.0).x, 0.25);
}

}  // namespace
}  // namespace mapweave::simulation
