#include <mapweave/simulation/wheel_odometry.h>

#include <support/pose_matchers.h>

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace mapweave::simulation {
namespace {

Pose2 on_a_curve(int step) {
  return {3.0 + 0.02 * step, 2.0 * std::sin(0.01 * step), std::atan2(0.02 * std::cos(0.01 * step), 0.02)};
}

TEST(WheelOdometry, without_errors_is_the_truth_seen_from_the_start) {
  WheelOdometry odometry(perfect_odometry(), 1, "alpha");
  Pose2 last;
  for (int step = 0; step <= 5000; ++step) last = odometry.step(on_a_curve(step));
  EXPECT_THAT(last, test::IsNear(between(on_a_curve(0), on_a_curve(5000)), 1e-9, 1e-9));
}

TEST(WheelOdometry, starts_at_its_own_origin) {
  WheelOdometry odometry({}, 1, "alpha");
  EXPECT_THAT(odometry.step({5.0, -2.0, 1.0}), test::IsNear(Pose2{0.0, 0.0, 0.0}, 0.0, 0.0));
}

TEST(WheelOdometry, does_not_move_while_the_robot_stands) {
  WheelOdometry odometry({}, 1, "alpha");
  for (int i = 0; i < 100; ++i)
    EXPECT_THAT(odometry.step({5.0, -2.0, 1.0}), test::IsNear(Pose2{0.0, 0.0, 0.0}, 1e-12, 1e-12));
}

TEST(WheelOdometry, errs_with_the_root_of_the_path_whatever_the_steps) {
  WheelOdometryOptions options = perfect_odometry();
  options.yaw_noise_deg = 0.5;
  options.noise_m = 0.02;
  for (const double step_m : {0.02, 0.2}) {
    double yaw_square = 0.0, along_square = 0.0;
    constexpr int kRuns = 1000;
    for (int run = 0; run < kRuns; ++run) {
      WheelOdometry odometry(options, static_cast<std::uint64_t>(run), "alpha");
      Pose2 last;
      for (int i = 0; i <= std::lround(4.0 / step_m); ++i) last = odometry.step({i * step_m, 0.0, 0.0});
      yaw_square += last.phi * last.phi / kRuns;
      along_square += (last.x - 4.0) * (last.x - 4.0) / kRuns;
    }
    EXPECT_NEAR(std::sqrt(yaw_square) * 180.0 / M_PI, 1.0, 0.1) << step_m;  // 0.5 degrees after 1 m, so 1 after 4
    EXPECT_NEAR(std::sqrt(along_square), 0.04, 0.004) << step_m;
  }
}

TEST(WheelOdometry, turns_with_errors_of_its_own) {
  WheelOdometryOptions options = perfect_odometry();
  options.turn_noise_deg = 2.0;
  double square = 0.0;
  constexpr int kRuns = 1000;
  for (int run = 0; run < kRuns; ++run) {
    WheelOdometry odometry(options, static_cast<std::uint64_t>(run), "alpha");
    Pose2 last;
    for (int i = 0; i <= 40; ++i) last = odometry.step({0.0, 0.0, wrap_angle(2.0 * M_PI * i / 40)});
    square += last.phi * last.phi / kRuns;
  }
  EXPECT_NEAR(std::sqrt(square) * 180.0 / M_PI, 2.0, 0.2);
}

TEST(WheelOdometry, keeps_one_scale_error_per_robot) {
  WheelOdometryOptions options = perfect_odometry();
  options.scale_error = 0.02;
  double square = 0.0;
  constexpr int kRobots = 500;
  for (int robot = 0; robot < kRobots; ++robot) {
    WheelOdometry odometry(options, 3, "robot" + std::to_string(robot));
    odometry.step({0.0, 0.0, 0.0});
    const double first = odometry.step({1.0, 0.0, 0.0}).x, second = odometry.step({2.0, 0.0, 0.0}).x;
    EXPECT_NEAR(second, 2.0 * first, 1e-9);
    square += (first - 1.0) * (first - 1.0) / kRobots;
  }
  EXPECT_NEAR(std::sqrt(square), 0.02, 0.002);
}

TEST(WheelOdometry, slips_as_often_and_as_far_as_its_options_say) {
  WheelOdometryOptions options = perfect_odometry();
  options.slips_per_100_m = 4.0;
  options.slip_min_deg = 3.0;
  options.slip_max_deg = 10.0;
  int slips = 0, left = 0, reported = 0;
  for (int run = 0; run < 50; ++run) {
    WheelOdometry odometry(options, static_cast<std::uint64_t>(run), "alpha");
    Pose2 last{};
    for (int i = 0; i <= 2000; ++i) {  // 200 m
      const Pose2 now = odometry.step({0.1 * i, 0.0, 0.0});
      const double miss = wrap_angle(now.phi - last.phi) * 180.0 / M_PI;
      last = now;
      if (std::abs(miss) < 1e-9) continue;
      EXPECT_GE(std::abs(miss), 3.0 - 1e-9);
      EXPECT_LE(std::abs(miss), 10.0 + 1e-9);
      ++slips;
      left += miss > 0.0;
    }
    reported += odometry.slips();
  }
  EXPECT_EQ(slips, reported);
  EXPECT_NEAR(slips, 400, 80);  // 10000 m; four standard deviations
  EXPECT_NEAR(left, slips / 2, 50);
}

}  // namespace
}  // namespace mapweave::simulation
