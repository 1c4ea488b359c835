#include "input/motion_prior.h"

#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <gtest/gtest.h>

namespace mapweave::visual {
namespace {

rawlog::Record odometry(double at_s, double x, double y, double phi) {
  auto observation = mrpt::obs::CObservationOdometry::Create();
  observation->odometry = mrpt::poses::CPose2D(x, y, phi);
  return {stamp_from_seconds(at_s), observation};
}

rawlog::Record turning(double at_s, double rad_per_s) {
  auto observation = mrpt::obs::CObservationIMU::Create();
  observation->set(mrpt::obs::IMU_WX, 0.0);
  observation->set(mrpt::obs::IMU_WY, 0.0);
  observation->set(mrpt::obs::IMU_WZ, rad_per_s);
  return {stamp_from_seconds(at_s), observation};
}

// Looking ahead: z of the camera is x of the robot.
Pose3 looking_ahead() {
  Eigen::Matrix3d robot_from_camera;
  robot_from_camera << 0, 0, 1, -1, 0, 0, 0, -1, 0;
  return {{0.2, 0.0, 0.5}, Eigen::Quaterniond(robot_from_camera)};
}

TEST(MotionPrior, is_unknown_at_the_first_frame_and_without_odometry) {
  MotionPrior prior;
  EXPECT_FALSE(prior.at(stamp_from_seconds(1.0), looking_ahead()));
  EXPECT_FALSE(prior.at(stamp_from_seconds(1.1), looking_ahead()));
}

TEST(MotionPrior, sees_a_robot_that_drives_ahead_as_motion_along_the_optical_axis) {
  MotionPrior prior;
  for (int i = 0; i <= 10; ++i) {
    prior.add(odometry(1.0 + 0.1 * i, 0.05 * i, 0.0, 0.0));
    if (i == 2) prior.at(stamp_from_seconds(1.2), looking_ahead());
  }
  const auto motion = prior.at(stamp_from_seconds(1.44), looking_ahead());
  ASSERT_TRUE(motion && motion->translation);
  EXPECT_TRUE(motion->translation->isApprox(Eigen::Vector3d(0.0, 0.0, 0.12), 1e-9)) << motion->translation->transpose();
}

TEST(MotionPrior, goes_on_as_before_after_the_last_odometry_but_not_for_long) {
  MotionPrior prior;
  prior.add(odometry(1.0, 0.0, 0.0, 0.0));
  prior.add(odometry(1.1, 0.1, 0.0, 0.0));
  prior.at(stamp_from_seconds(1.1), looking_ahead());
  const auto motion = prior.at(stamp_from_seconds(1.2), looking_ahead());
  ASSERT_TRUE(motion && motion->translation);
  EXPECT_NEAR(motion->translation->z(), 0.1, 1e-9);
  EXPECT_FALSE(prior.at(stamp_from_seconds(3.0), looking_ahead()));
}

TEST(MotionPrior, knows_where_a_robot_stood_when_its_log_began) {
  MotionPrior prior;
  prior.add(odometry(1.0, 2.0, 0.0, 0.0));
  const auto first = prior.odometry_from_camera(stamp_from_seconds(1.02), looking_ahead());
  ASSERT_TRUE(first);
  EXPECT_NEAR(first->t.x(), 2.2, 1e-9);
  EXPECT_FALSE(prior.odometry_from_camera(stamp_from_seconds(3.0), looking_ahead()));
}

TEST(MotionPrior, turns_with_the_gyroscope_where_there_is_no_odometry) {
  MotionPrior prior;
  prior.at(stamp_from_seconds(1.0), looking_ahead());
  for (int i = 0; i < 10; ++i) prior.add(turning(1.0 + 0.01 * i, 0.5));
  const auto motion = prior.at(stamp_from_seconds(1.1), looking_ahead());
  ASSERT_TRUE(motion);
  EXPECT_FALSE(motion->translation);
  // Up is -y of the camera.
  const Eigen::AngleAxisd turn(motion->earlier_from_later);
  EXPECT_NEAR(turn.angle(), 0.05, 1e-9);
  EXPECT_TRUE((turn.axis() * turn.angle()).isApprox(Eigen::Vector3d(0.0, -0.05, 0.0), 1e-9));
}

}  // namespace
}  // namespace mapweave::visual
