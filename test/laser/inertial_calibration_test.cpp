#include <gtest/gtest.h>
#include <mapweave/core/geometry.h>
#include <mapweave/simulation/random.h>

#include "inertial_calibration.h"

#include <cmath>
#include <functional>

namespace mapweave::laser {
namespace {

using Measured = std::function<double(double turn_rad, double seconds)>;

// Of a robot that turns to and fro, and stands in between; scans every 0.2 s.
InertialCalibration calibrated(const Measured& measured, int steps = 600) {
  InertialCalibration calibration(0.001, 0.01);
  simulation::RandomNumbers numbers = simulation::RandomStream(3, "headings").at(0);
  double heading = 0.0;
  for (int i = 0; i < steps; ++i) {
    const double turn = i % 40 < 20 ? 0.2 * std::sin(0.11 * i) : 0.0;
    heading += turn;
    calibration.add_step(0.2, measured(turn, 0.2), turn + 0.004 * numbers.normal());
    if (calibration.wants_heading()) calibration.add_heading(wrap_angle(heading + 0.004 * numbers.normal()));
  }
  return calibration;
}

TEST(InertialCalibration, learns_scale_and_bias) {
  const auto calibration = calibrated([](double turn, double seconds) { return 1.03 * turn + 0.05 * seconds; });
  ASSERT_TRUE(calibration.is_believed()) << calibration.described();
  EXPECT_NEAR(calibration.turn_rad(0.2, 1.03 * 0.3 + 0.05 * 0.2), 0.3, 0.003) << calibration.described();
  EXPECT_LT(calibration.turn_sigma_rad(0.2, 0.3), 0.02);
  EXPECT_FALSE(calibration.doubt());
}

TEST(InertialCalibration, learns_how_noisy_a_unit_is) {
  const auto calm = calibrated([](double turn, double) { return turn; });
  simulation::RandomNumbers numbers = simulation::RandomStream(4, "noise").at(0);
  const auto noisy = calibrated([&](double turn, double) { return turn + 0.005 * numbers.normal(); });
  ASSERT_TRUE(noisy.is_believed()) << noisy.described();
  EXPECT_GT(noisy.turn_sigma_rad(0.2, 0.0), 1.3 * calm.turn_sigma_rad(0.2, 0.0));
}

TEST(InertialCalibration, turns_the_sign_of_a_unit_that_hangs_upside_down_and_says_so) {
  const auto calibration = calibrated([](double turn, double) { return -turn; });
  ASSERT_TRUE(calibration.is_believed()) << calibration.described();
  EXPECT_NEAR(calibration.turn_rad(0.2, -0.3), 0.3, 0.003);
  EXPECT_NE(calibration.doubt().value_or("").find("upside down"), std::string::npos);
}

TEST(InertialCalibration, does_not_believe_units_that_are_dead_in_degrees_of_another_scale_or_of_another_robot) {
  const auto doubt_of = [](const Measured& measured) {
    const auto calibration = calibrated(measured);
    EXPECT_FALSE(calibration.is_believed()) << calibration.described();
    return calibration.doubt().value_or("nothing");
  };
  EXPECT_NE(doubt_of([](double, double) { return 0.0; }).find("dead"), std::string::npos);
  EXPECT_NE(doubt_of([](double turn, double) { return 57.29578 * turn; }).find("degrees"), std::string::npos);
  EXPECT_NE(doubt_of([](double turn, double) { return 1.5 * turn; }).find("1.50 times"), std::string::npos);
  simulation::RandomNumbers numbers = simulation::RandomStream(5, "another robot").at(0);
  EXPECT_NE(doubt_of([&](double turn, double) { return turn + 0.1 * numbers.normal(); }).find("contradicts"),
            std::string::npos);
}

TEST(InertialCalibration, says_nothing_before_the_robot_turned_enough) {
  EXPECT_FALSE(InertialCalibration(0.001, 0.01).is_believed());
  const auto early = calibrated([](double turn, double) { return -turn; }, 12);
  EXPECT_FALSE(early.is_believed());
  EXPECT_FALSE(early.doubt());
}

TEST(InertialCalibration, passes_over_matches_that_went_wrong) {
  InertialCalibration calibration(0.001, 0.01);
  for (int i = 0; i < 200; ++i) {
    calibration.add_step(0.2, 0.2 * std::sin(0.11 * i), 0.2 * std::sin(0.11 * i));
    if (i % 31 == 30) calibration.add_gap();
    if (!calibration.wants_heading()) continue;
    double heading = 0.0;
    for (int k = 0; k <= i; ++k) heading += 0.2 * std::sin(0.11 * k);
    calibration.add_heading(i % 37 == 0 ? heading + 0.5 : heading);
  }
  ASSERT_TRUE(calibration.is_believed()) << calibration.described();
  EXPECT_NEAR(calibration.turn_rad(0.2, 0.3), 0.3, 0.01) << calibration.described();
}

}  // namespace
}  // namespace mapweave::laser
