#include "every_plan.h"

#include <mapweave/simulation/random.h>
#include <mapweave/simulation/ray_caster.h>

#include <gtest/gtest.h>

#include <cmath>

namespace mapweave::simulation {
namespace {

double brute_force(const FloorPlan& plan, Point2 origin, double dx, double dy, double max_range_m) {
  double nearest = kNoHit;
  for (const Wall& wall : plan.walls) nearest = std::min(nearest, distance_along_ray(origin, dx, dy, wall));
  return nearest <= max_range_m ? nearest : kNoHit;
}

TEST(RayCaster, agrees_with_looking_at_every_wall) {
  for (const auto& [name, plan] : test::every_plan(2)) {
    const RayCaster caster(plan.walls);
    const Box box = bounds(plan);
    RandomNumbers numbers = RandomStream(1, name).at(0);
    for (int i = 0; i < 3000; ++i) {  // from within and from outside
      const Point2 origin{numbers.uniform(box.low_x - 5.0, box.high_x + 5.0),
                          numbers.uniform(box.low_y - 5.0, box.high_y + 5.0)};
      const double angle = numbers.uniform(-M_PI, M_PI), max_range = numbers.uniform(0.5, 60.0);
      const double dx = std::cos(angle), dy = std::sin(angle);
      ASSERT_EQ(caster.distance(origin, dx, dy, max_range), brute_force(plan, origin, dx, dy, max_range))
          << name << " from (" << origin.x << ", " << origin.y << ") at " << angle << " within " << max_range;
    }
  }
}

TEST(RayCaster, agrees_along_axes_diagonals_and_the_lines_of_its_own_grid) {
  const FloorPlan plan = make_apartment_plan({}, 9);
  const RayCaster caster(plan.walls);
  for (double x = 0.5; x < 18.0; x += 0.5) {
    for (double y = 0.5; y < 13.0; y += 0.5) {
      for (const auto& [dx, dy] : {std::pair{1.0, 0.0},
                                   {-1.0, 0.0},
                                   {0.0, 1.0},
                                   {0.0, -1.0},
                                   {M_SQRT1_2, M_SQRT1_2},
                                   {-M_SQRT1_2, M_SQRT1_2},
                                   {1.0, -0.0}}) {
        ASSERT_EQ(caster.distance({x, y}, dx, dy, 40.0), brute_force(plan, {x, y}, dx, dy, 40.0))
            << x << " " << y << " " << dx << " " << dy;
      }
    }
  }
}

TEST(RayCaster, agrees_for_slanted_walls) {
  FloorPlan plan;
  RandomNumbers numbers = RandomStream(4, "slanted").at(0);
  for (int i = 0; i < 300; ++i) {
    const Point2 from{numbers.uniform(-10.0, 10.0), numbers.uniform(-10.0, 10.0)};
    plan.walls.push_back({from, {from.x + numbers.uniform(-3.0, 3.0), from.y + numbers.uniform(-3.0, 3.0)}});
  }
  const RayCaster caster(plan.walls);
  for (int i = 0; i < 5000; ++i) {
    const Point2 origin{numbers.uniform(-12.0, 12.0), numbers.uniform(-12.0, 12.0)};
    const double angle = numbers.uniform(-M_PI, M_PI);
    ASSERT_EQ(caster.distance(origin, std::cos(angle), std::sin(angle), 30.0),
              brute_force(plan, origin, std::cos(angle), std::sin(angle), 30.0));
  }
}

TEST(RayCaster, meets_a_known_wall_at_a_known_distance) {
  const RayCaster caster(std::vector<Wall>{{{3.0, -1.0}, {3.0, 1.0}}});
  EXPECT_DOUBLE_EQ(caster.distance({0.0, 0.0}, 1.0, 0.0, 10.0), 3.0);
  EXPECT_EQ(caster.distance({0.0, 0.0}, -1.0, 0.0, 10.0), kNoHit);
  EXPECT_EQ(caster.distance({0.0, 0.0}, 1.0, 0.0, 2.9), kNoHit);
  EXPECT_EQ(caster.distance({0.0, 2.0}, 1.0, 0.0, 10.0), kNoHit);
}

TEST(DistanceAlongRay, meets_the_near_side_of_a_disc) {
  EXPECT_DOUBLE_EQ(distance_along_ray({0.0, 0.0}, 1.0, 0.0, {5.0, 0.0}, 0.5), 4.5);
  EXPECT_EQ(distance_along_ray({0.0, 0.0}, -1.0, 0.0, {5.0, 0.0}, 0.5), kNoHit);
  EXPECT_EQ(distance_along_ray({0.0, 0.0}, 1.0, 0.0, {5.0, 0.6}, 0.5), kNoHit);
  EXPECT_EQ(distance_along_ray({5.1, 0.0}, 1.0, 0.0, {5.0, 0.0}, 0.5), 0.0);
}

TEST(RayCaster, looks_over_low_walls_and_under_lintels) {
  std::vector<Wall> walls{{{2.0, -1.0}, {2.0, 1.0}}, {{4.0, -1.0}, {4.0, 1.0}}};
  walls[0].high_m = 0.8;
  walls[1].low_m = 2.0;
  const RayCaster caster(walls);
  EXPECT_FALSE(caster.is_in_sight({0.0, 0.0, 0.5}, {3.0, 0.0, 0.5})) << "behind the low wall";
  EXPECT_TRUE(caster.is_in_sight({0.0, 0.0, 0.5}, {1.9, 0.0, 0.5})) << "before it";
  EXPECT_TRUE(caster.is_in_sight({0.0, 0.0, 1.0}, {3.0, 0.0, 0.9})) << "over it";
  EXPECT_FALSE(caster.is_in_sight({0.0, 0.0, 1.0}, {3.0, 0.0, 0.1})) << "over it, but down again";
  EXPECT_TRUE(caster.is_in_sight({0.0, 0.0, 1.0}, {5.0, 0.0, 1.9})) << "under the lintel";
  EXPECT_FALSE(caster.is_in_sight({0.0, 0.0, 1.0}, {5.0, 0.0, 2.9}));
  EXPECT_TRUE(caster.is_in_sight({0.0, 0.0, 0.5}, {5.0, 5.0, 0.5})) << "past their ends";
  EXPECT_TRUE(caster.is_in_sight({1.0, 0.0, 0.5}, {1.0, 0.0, 2.0})) << "straight up";
}

}  // namespace
}  // namespace mapweave::simulation
