#include "every_plan.h"

#include <mapweave/simulation/laser_sensor.h>

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

SimulatedLaserOptions perfect_laser() {
  SimulatedLaserOptions options;
  options.noise_m = options.noise_per_m = options.outliers = options.dropouts = 0.0;
  return options;
}
RandomNumbers numbers(std::uint64_t index) { return RandomStream(1, "laser").at(index); }

FloorPlan square_room() {  // 10 x 10 m around the origin
  FloorPlan plan;
  plan.walls = {{{-5, -5}, {5, -5}}, {{5, -5}, {5, 5}}, {{5, 5}, {-5, 5}}, {{-5, 5}, {-5, -5}}};
  return plan;
}

TEST(LaserSensor, sees_the_walls_of_a_square_room_where_they_are) {
  const RayCaster room(square_room().walls);
  const auto ranges = LaserSensor(room, perfect_laser()).scan({1.0, 0.0, 0.0}, {}, numbers(0));
  ASSERT_EQ(ranges.size(), 181u);
  EXPECT_NEAR(ranges[0], 5.0, 1e-5);    // to the right, -90 degrees
  EXPECT_NEAR(ranges[90], 4.0, 1e-5);   // ahead
  EXPECT_NEAR(ranges[180], 5.0, 1e-5);  // to the left
  EXPECT_NEAR(ranges[120], 4.0 / std::cos(M_PI / 6.0), 1e-5);
}

TEST(LaserSensor, looks_from_where_it_is_mounted) {
  const RayCaster room(square_room().walls);
  SimulatedLaserOptions options = perfect_laser();
  options.x_m = 0.3;
  options.y_m = -0.2;
  options.yaw_deg = 90.0;
  const auto ranges =
      LaserSensor(room, options).scan({0.0, 0.0, M_PI / 2.0}, {}, numbers(0));  // laser at (0.2, 0.3), looking along -x
  EXPECT_NEAR(ranges[90], 5.2, 1e-5);
  EXPECT_NEAR(ranges[0], 4.7, 1e-5);
}

TEST(LaserSensor, answers_nothing_beyond_its_range) {
  const RayCaster room(square_room().walls);
  SimulatedLaserOptions options = perfect_laser();
  options.max_range_m = 5.5;
  const auto ranges = LaserSensor(room, options).scan({0.0, 0.0, 0.0}, {}, numbers(0));
  EXPECT_NEAR(ranges[90], 5.0, 1e-5);
  EXPECT_EQ(ranges[45], 0.0f);  // the corner is 7 m away
  EXPECT_EQ(static_cast<std::size_t>(options.rays), ranges.size());
}

TEST(LaserSensor, casts_each_ray_from_where_the_robot_is_at_its_time) {
  const RayCaster room(square_room().walls);
  SimulatedLaserOptions options = perfect_laser();
  options.sweep_s = 0.2;
  options.sweep_stamp = 0.5;
  const auto driving = [](double after_s) { return Pose2(1.0 + 2.0 * after_s, 0.5, 0.0); };
  const auto ranges = LaserSensor(room, options).swept_scan(driving, {}, numbers(0));
  EXPECT_NEAR(ranges[90], 4.0, 1e-5) << "ahead, in the middle of the sweep";
  EXPECT_NEAR(ranges[0], 5.5, 1e-5);
  EXPECT_NEAR(ranges[120], (5.0 - (1.0 + 2.0 * 0.2 / 6.0)) / std::cos(M_PI / 6.0), 1e-5)
      << "to the left, a sixth of the sweep later";
  options.clockwise = true;
  const auto clockwise = LaserSensor(room, options).swept_scan(driving, {}, numbers(0));
  EXPECT_NEAR(clockwise[120], (5.0 - (1.0 - 2.0 * 0.2 / 6.0)) / std::cos(M_PI / 6.0), 1e-5);
}

TEST(LaserSensor, sees_the_same_of_a_robot_that_stands_however_long_it_takes) {
  const RayCaster room(square_room().walls);
  SimulatedLaserOptions slow;
  slow.sweep_s = 0.5;
  EXPECT_EQ(LaserSensor(room, slow).swept_scan([](double) { return Pose2(1.0, 0.5, 0.3); }, {}, numbers(3)),
            LaserSensor(room, SimulatedLaserOptions{}).scan(Pose2(1.0, 0.5, 0.3), {}, numbers(3)));
}

TEST(LaserSensor, sees_people_before_walls_and_never_itself) {
  const RayCaster room(square_room().walls);
  const LaserSensor laser(room, perfect_laser());
  const auto ranges = laser.scan({0.0, 0.0, 0.0}, {{{2.0, 0.0}, 0.25}, {{0.1, 0.0}, 0.25}}, numbers(0));
  EXPECT_NEAR(ranges[90], 1.75, 1e-5);
  EXPECT_NEAR(ranges[0], 5.0, 1e-5);
}

TEST(LaserSensor, errs_as_much_as_its_options_say) {
  const RayCaster room(square_room().walls);
  SimulatedLaserOptions options;
  options.noise_m = 0.02;
  options.noise_per_m = 0.002;
  options.outliers = 0.03;
  options.dropouts = 0.05;
  const LaserSensor truth(room, perfect_laser()), laser(room, options);
  const auto exact = truth.scan({}, {}, numbers(0));
  int rays = 0, dropouts = 0, outliers = 0, good = 0;
  double mean = 0.0, square = 0.0;
  for (std::uint64_t scan = 0; scan < 500; ++scan) {
    const auto ranges = laser.scan({}, {}, numbers(scan));
    for (std::size_t ray = 0; ray < ranges.size(); ++ray, ++rays) {
      const double error = ranges[ray] - exact[ray], deviation = 0.02 + 0.002 * exact[ray];
      if (ranges[ray] == 0.0f) {
        ++dropouts;
      } else if (std::abs(error) > 6.0 * deviation) {
        EXPECT_LT(error, 0.0) << "nothing is seen behind a wall";
        ++outliers;
      } else {
        ++good;
        mean += error / deviation;
        square += error * error / (deviation * deviation);
      }
    }
  }
  EXPECT_NEAR(static_cast<double>(dropouts) / rays, 0.05, 0.003);
  EXPECT_NEAR(static_cast<double>(outliers) / rays, 0.03, 0.003);
  EXPECT_NEAR(mean / good, 0.0, 0.02);
  EXPECT_NEAR(square / good, 1.0, 0.03);
}

}  // namespace
}  // namespace mapweave::simulation
