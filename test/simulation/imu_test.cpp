#include "camera_world.h"

#include <mapweave/simulation/imu.h>

#include <gtest/gtest.h>

#include <cmath>

namespace mapweave::simulation {
namespace {

WorldOptions with_imu(double rate) {
  WorldOptions options = test::camera_world(test::tiny_camera(SimulatedCameraKind::mono));
  options.cameras.clear();
  options.imu.readings_per_second = rate;
  options.robots[0].waypoints = {{1.0, 1.0}, {4.0, 1.0}, {1.0, 1.0}};
  return options;
}

ImuOptions perfect(double rate) { return {rate, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0}; }

TEST(ImuRecording, integrates_to_the_turns_and_the_speed_of_the_truth) {
  WorldOptions options = with_imu(200.0);
  options.imu = perfect(200.0);
  const World world = test::built(options);
  ImuRecording recording(world, 0);
  double yaw = 0.0, speed = 0.0, fastest = 0.0, turned = 0.0, true_turned = 0.0;
  Pose2 last = world.trajectory(0).at(0.0);
  while (const auto reading = recording.next()) {
    EXPECT_NEAR(reading->acceleration_m_per_s2.z(), 9.81, 1e-6);
    yaw += reading->turn_rad_per_s.z() / 200.0;
    turned += std::abs(reading->turn_rad_per_s.z()) / 200.0;
    speed += reading->acceleration_m_per_s2.x() / 200.0;
    fastest = std::max(fastest, speed);
    const Pose2 pose = world.trajectory(0).at(seconds_between(world.first_stamp(0), reading->stamp));
    true_turned += std::abs(wrap_angle(pose.phi - last.phi));
    last = pose;
  }
  EXPECT_NEAR(wrap_angle(yaw - (last.phi - world.trajectory(0).at(0.0).phi)), 0.0, 0.03);
  EXPECT_NEAR(turned, true_turned, 0.05);
  EXPECT_GT(true_turned, 3.0);
  double true_fastest = 0.0;
  for (const auto& knot : world.trajectory(0).knots()) true_fastest = std::max(true_fastest, knot.speed_m_per_s);
  EXPECT_NEAR(fastest, true_fastest, 0.05);
}

TEST(ImuRecording, measures_turns_as_many_times_as_large_as_its_scale_says) {
  WorldOptions options = with_imu(100.0), upside_down = options;
  upside_down.imu.gyro_scale = -1.0;
  const World world = test::built(options), other_world = test::built(upside_down);
  ImuRecording recording(world, 0), other(other_world, 0);
  while (const auto reading = recording.next()) ASSERT_EQ(reading->turn_rad_per_s, -other.next()->turn_rad_per_s);
}

TEST(ImuRecording, has_the_noise_and_the_bias_of_its_options) {
  WorldOptions options = with_imu(100.0);
  options.imu = {100.0, 0.001, 0.0, 0.01, 0.0, 0.2, 0.0};
  WorldOptions clean = options;
  clean.imu = perfect(100.0);
  const World world = test::built(options), clean_world = test::built(clean);
  ImuRecording noisy(world, 0), exact(clean_world, 0);
  double sum = 0.0, squares = 0.0, acceleration_squares = 0.0;
  int count = 0;
  while (const auto reading = noisy.next()) {
    const auto truth = exact.next();
    const double error = reading->turn_rad_per_s.x() - truth->turn_rad_per_s.x();
    sum += error;
    squares += error * error;
    acceleration_squares += std::pow(reading->acceleration_m_per_s2.y() - truth->acceleration_m_per_s2.y(), 2);
    ++count;
  }
  const double bias = sum / count;
  EXPECT_GT(std::abs(bias), 0.002);
  EXPECT_LT(std::abs(bias), 0.8);
  EXPECT_NEAR(std::sqrt(squares / count - bias * bias), 0.01, 0.001);
  EXPECT_NEAR(std::sqrt(acceleration_squares / count), 0.1, 0.01);
}

TEST(ImuRecording, is_silent_without_a_rate_and_feels_no_jump) {
  EXPECT_EQ(ImuRecording(test::built(with_imu(0.0)), 0).count(), 0u);
  WorldOptions options = with_imu(100.0);
  options.robots[0].kidnappings.resize(1);
  options.robots[0].kidnappings[0] = {1.0, 1.5, 0.0};
  const World world = test::built(options);
  ImuRecording recording(world, 0);
  while (const auto reading = recording.next()) EXPECT_LT(reading->acceleration_m_per_s2.head<2>().norm(), 20.0);
}

}  // namespace
}  // namespace mapweave::simulation
