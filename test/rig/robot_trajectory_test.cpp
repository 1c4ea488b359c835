#include <mapweave/rig/robot_trajectory.h>
#include <support/straight_trajectories.h>

#include <gtest/gtest.h>

namespace mapweave::rig {
namespace {

using test::aside_m;
using test::at;
using test::longest_step_m;
Pose3 ahead(double x, double y = 0.0) { return {{x, y, 0.0}, Eigen::Quaterniond::Identity()}; }

// Half a metre a second along x, 10 frames a second; `aside_m`: by how much to the left.
template <class Aside>
CameraTrajectory camera(double begin_s, double end_s, Aside aside_m, double weight = 1.0) {
  return test::straight_trajectory(begin_s, end_s, aside_m, weight);
}
CameraTrajectory camera(double begin_s, double end_s, double aside_m = 0.0, double weight = 1.0) {
  return camera(
      begin_s, end_s, [=](double) { return aside_m; }, weight);
}

TEST(RobotTrajectory, is_the_weighted_mean_at_every_stamp_of_any_camera) {
  const CameraTrajectory one = camera(0.0, 10.0, 0.00, 3.0);
  CameraTrajectory other = camera(0.0, 10.0, 0.04, 1.0);
  for (StampedPose& pose : other.frames) {
    pose.stamp.ns += 50'000'000;
    pose.map_from_robot.t.x() += 0.025;
  }
  const auto trajectory = robot_trajectory({one, other}, {});
  EXPECT_EQ(trajectory.size(), one.frames.size() + other.frames.size());
  EXPECT_NEAR(aside_m(trajectory, 5.0), 0.01, 1e-6);
  for (const StampedPose& pose : trajectory)
    EXPECT_NEAR(pose.map_from_robot.t.x(), 0.5 * (pose.stamp.seconds() - 1000.0), 1e-3);
}

TEST(RobotTrajectory, does_not_jump_where_a_camera_comes_and_goes) {
  const auto trajectory = robot_trajectory({camera(0.0, 20.0, 0.0), camera(5.0, 12.0, 0.08)}, {});
  EXPECT_NEAR(aside_m(trajectory, 8.0), 0.04, 1e-6);
  EXPECT_NEAR(aside_m(trajectory, 15.0), 0.0, 1e-6);
  EXPECT_LT(longest_step_m(trajectory), 0.055);
}

TEST(RobotTrajectory, is_handed_over_without_a_jump) {
  const auto trajectory = robot_trajectory({camera(0.0, 10.0, 0.0), camera(7.0, 20.0, 0.08)}, {});
  EXPECT_NEAR(aside_m(trajectory, 5.0), 0.0, 1e-6);
  EXPECT_NEAR(aside_m(trajectory, 15.0), 0.08, 1e-6);
  EXPECT_LT(longest_step_m(trajectory), 0.055);
}

TEST(RobotTrajectory, is_handed_over_without_a_jump_to_one_that_was_doubted) {
  const auto jumps = [](double t) { return t > 8.0 ? 0.3 : 0.0; };
  const auto trajectory = robot_trajectory({camera(0.0, 15.0), camera(0.0, 25.0, jumps)}, {});
  EXPECT_NEAR(aside_m(trajectory, 14.0), 0.0, 0.01);
  EXPECT_NEAR(aside_m(trajectory, 20.0), 0.3, 1e-6);
  EXPECT_LT(longest_step_m(trajectory), 0.065);
}

TEST(RobotTrajectory, follows_most_cameras_where_one_of_three_errs) {
  const auto errs = [](double t) { return t > 10.0 && t < 15.0 ? 1.5 : 0.0; };
  const auto trajectory = robot_trajectory({camera(0.0, 20.0, errs, 5.0), camera(0.0, 20.0), camera(0.0, 20.0)}, {});
  for (double t = 0.0; t < 19.8; t += 0.1) EXPECT_NEAR(aside_m(trajectory, t), 0.0, 0.01) << t;
}

TEST(RobotTrajectory, believes_the_one_that_wheels_agree_with) {
  // The heavier one slips away slowly.
  const auto slips = [](double t) { return t > 8.0 ? 0.1 * (t - 8.0) : 0.0; };
  const auto trajectory =
      robot_trajectory({camera(0.0, 20.0, slips, 5.0), camera(0.0, 20.0)}, camera(0.0, 20.0).frames);
  EXPECT_NEAR(aside_m(trajectory, 15.0), 0.0, 0.01);
  const auto moved = [](double t) { return t > 8.0 ? 0.1 * (t - 8.0) : 0.0; };
  const auto other =
      robot_trajectory({camera(0.0, 20.0, slips, 5.0), camera(0.0, 20.0)}, camera(0.0, 20.0, moved).frames);
  EXPECT_NEAR(aside_m(other, 15.0), 0.7, 0.01);
}

TEST(RobotTrajectory, does_not_follow_a_camera_that_jumps) {
  const auto jumps = [](double t) { return t > 8.0 ? 0.6 : 0.0; };
  for (const bool first : {true, false}) {
    const CameraTrajectory one = camera(0.0, 20.0, jumps), other = camera(0.0, 20.0);
    const auto trajectory = first ? robot_trajectory({one, other}, {}) : robot_trajectory({other, one}, {});
    EXPECT_NEAR(aside_m(trajectory, 12.0), 0.0, 0.01);
  }
}

TEST(RobotTrajectory, of_one_camera_is_its_own) {
  const CameraTrajectory one = camera(0.0, 3.0);
  const auto trajectory = robot_trajectory({one}, {});
  ASSERT_EQ(trajectory.size(), one.frames.size());
  EXPECT_EQ(trajectory[7].map_from_robot.t, one.frames[7].map_from_robot.t);
}

TEST(CarriedAlong, frames_go_with_the_keyframes_around_them) {
  const std::vector<MovedKeyframe> keyframes{{at(1.0), ahead(1.0), ahead(1.0, 0.2), 1.0},
                                             {at(2.0), ahead(2.0), ahead(2.0, 0.4), 1.0}};
  const auto frames =
      moved_with_keyframes({{at(0.5), ahead(0.5)}, {at(1.5), ahead(1.5)}, {at(3.0), ahead(3.0)}}, keyframes);
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_NEAR(frames[0].map_from_robot.t.y(), 0.2, 1e-9);
  EXPECT_NEAR(frames[1].map_from_robot.t.y(), 0.3, 1e-9);
  EXPECT_NEAR(frames[2].map_from_robot.t.y(), 0.4, 1e-9);
  EXPECT_TRUE(moved_with_keyframes({{at(0.5), ahead(0.5)}}, {}).empty());
}

TEST(CarriedAlong, motions_of_the_camera_grow_and_not_the_robot_under_it) {
  const Pose3 robot_from_camera{{0.3, 0.0, 0.6}, Eigen::Quaterniond::Identity()};
  const Pose3 turned{{1.0, 0.0, 0.0}, Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()))};
  const std::vector<MovedKeyframe> keyframes{{at(1.0), Pose3(), Pose3(), 2.0, robot_from_camera}};
  const Pose3 pose = moved_with_keyframes({{at(1.5), turned}}, keyframes).front().map_from_robot;
  // The camera went from 0.3 m to 0.7 m, and so truly to 1.1 m; the robot that has turned round stands 0.3 m before it.
  EXPECT_NEAR(compose(pose, robot_from_camera).t.x(), 1.1, 1e-9);
  EXPECT_NEAR(pose.t.x(), 1.4, 1e-9);
  EXPECT_NEAR(pose.t.z(), 0.0, 1e-9);
}

}  // namespace
}  // namespace mapweave::rig
