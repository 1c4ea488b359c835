#include <mapweave/rig/robot_pose.h>
#include <support/straight_trajectories.h>

#include <gtest/gtest.h>
#include <algorithm>
#include <functional>
#include <limits>
#include <random>

namespace mapweave::rig {
namespace {

using test::aside_m;
using test::at;
using test::longest_step_m;

// Half a metre a second along x.
Pose3 straight(double seconds, double aside_m = 0.0) {
  return {{0.5 * seconds, aside_m, 0.0}, Eigen::Quaterniond::Identity()};
}

using Aside = std::function<double(double seconds)>;
double none(double) { return 0.0; }

// Frames, 10 a second; `aside_m`: by how much to the left.
CameraTrajectory camera(double begin_s, double end_s, const Aside& aside_m = none, double weight = 1.0) {
  return test::straight_trajectory(begin_s, end_s, aside_m, weight);
}
CameraTrajectory joined(CameraTrajectory trajectory, const CameraTrajectory& more) {
  trajectory.frames.insert(trajectory.frames.end(), more.frames.begin(), more.frames.end());
  return trajectory;
}

// What is answered after each pose, as they come; odometry before cameras.
std::vector<StampedPose> answered(const std::vector<CameraTrajectory>& cameras,
                                  const std::vector<StampedPose>& odometry = {}, bool reversed = false) {
  struct Said {
    Stamp stamp;
    std::size_t by;
    StampedPose pose;
  };
  std::vector<Said> all;
  for (const StampedPose& pose : odometry) all.push_back({pose.stamp, 0, pose});
  for (std::size_t c = 0; c < cameras.size(); ++c)
    for (const StampedPose& frame : cameras[c].frames)
      all.push_back({frame.stamp, reversed ? cameras.size() - c : c + 1, frame});
  std::stable_sort(all.begin(), all.end(),
                   [](const Said& a, const Said& b) { return a.stamp == b.stamp ? a.by < b.by : a.stamp < b.stamp; });
  RobotPose robot;
  std::vector<StampedPose> answers;
  for (const Said& said : all) {
    const std::size_t number = reversed ? cameras.size() - said.by : said.by - 1;
    if (said.by == 0)
      robot.add_odometry(said.pose);
    else
      robot.add(SensorId("camera" + std::to_string(number)), said.pose, cameras[number].weight);
    const auto answer = robot.now();
    if (!answer) continue;
    EXPECT_LE(answer->pose.stamp, said.stamp);
    if (!answers.empty() && answers.back().stamp == answer->pose.stamp)
      answers.back() = answer->pose;
    else
      answers.push_back(answer->pose);
  }
  return answers;
}

double farthest_aside_m(const std::vector<StampedPose>& trajectory) {
  double farthest = 0.0;
  for (const StampedPose& pose : trajectory) farthest = std::max(farthest, std::abs(pose.map_from_robot.t.y()));
  return farthest;
}

TEST(RobotPose, is_the_weighted_mean_of_cameras_that_agree) {
  CameraTrajectory one = camera(0.0, 10.0, none, 3.0), other = camera(0.0, 10.0, [](double) { return 0.04; });
  for (StampedPose& pose : other.frames) {
    pose.stamp.ns += 50'000'000;
    pose.map_from_robot.t.x() += 0.025;
  }
  const auto trajectory = answered({one, other});
  EXPECT_EQ(trajectory.size(), one.frames.size() + other.frames.size());
  EXPECT_NEAR(aside_m(trajectory, 5.0), 0.01, 1e-6);
  for (std::size_t i = 3; i < trajectory.size(); ++i)  // from where each camera's motion is known
    EXPECT_NEAR(trajectory[i].map_from_robot.t.x(), 0.5 * (trajectory[i].stamp.seconds() - 1000.0), 1e-6);
}

TEST(RobotPose, does_not_jump_where_a_camera_goes_silent_and_comes_back) {
  const auto left = [](double) { return 0.08; };
  const CameraTrajectory blinking = joined(camera(0.0, 8.0, left), camera(12.0, 20.0, left));
  for (const bool with_odometry : {false, true}) {
    const auto trajectory =
        answered({camera(0.0, 20.0), blinking}, with_odometry ? camera(0.0, 20.0).frames : std::vector<StampedPose>());
    EXPECT_NEAR(aside_m(trajectory, 7.0), 0.04, 1e-6);
    EXPECT_NEAR(aside_m(trajectory, 11.0), 0.0, 1e-6);
    EXPECT_NEAR(aside_m(trajectory, 15.0), 0.04, 1e-6);
    EXPECT_LT(longest_step_m(trajectory), 0.055);
  }
}

TEST(RobotPose, is_handed_over_without_a_jump) {
  const auto trajectory = answered({camera(0.0, 10.0), camera(7.0, 20.0, [](double) { return 0.08; })});
  EXPECT_NEAR(aside_m(trajectory, 5.0), 0.0, 1e-6);
  EXPECT_NEAR(aside_m(trajectory, 15.0), 0.08, 1e-6);
  EXPECT_LT(longest_step_m(trajectory), 0.055);
}

TEST(RobotPose, does_not_follow_a_camera_that_odometry_contradicts) {
  // The heavier one slips away slowly.
  const auto slips = [](double t) { return t > 8.0 ? 0.1 * (t - 8.0) : 0.0; };
  const auto trajectory = answered({camera(0.0, 20.0, slips, 5.0), camera(0.0, 20.0)}, camera(0.0, 20.0).frames);
  EXPECT_LT(farthest_aside_m(trajectory), 0.1);
  EXPECT_NEAR(aside_m(trajectory, 15.0), 0.0, 0.01);
  EXPECT_LT(longest_step_m(trajectory), 0.06);
  const auto other = answered({camera(0.0, 20.0, slips, 5.0), camera(0.0, 20.0)}, camera(0.0, 20.0, slips).frames);
  EXPECT_NEAR(aside_m(other, 15.0), 0.7, 0.01);
}

TEST(RobotPose, follows_most_cameras_where_one_of_three_errs) {
  const auto errs = [](double t) { return t > 10.0 && t < 15.0 ? 1.5 : 0.0; };
  const auto trajectory = answered({camera(0.0, 20.0, errs, 5.0), camera(0.0, 20.0), camera(0.0, 20.0)});
  EXPECT_LT(farthest_aside_m(trajectory), 0.01);
  EXPECT_LT(longest_step_m(trajectory), 0.055);
}

TEST(RobotPose, goes_on_by_odometry_where_no_camera_sees_and_comes_back_without_a_jump) {
  const auto left = [](double t) { return t > 5.0 ? 0.3 : 0.0; };
  const CameraTrajectory blind = joined(camera(0.0, 5.0), camera(9.0, 20.0, left));
  const auto trajectory = answered({blind}, camera(0.0, 20.0).frames);
  EXPECT_NEAR(aside_m(trajectory, 8.0), 0.0, 1e-6);
  EXPECT_NEAR(aside_m(trajectory, 12.0), 0.3, 1e-6);
  EXPECT_LT(longest_step_m(trajectory), 0.065);
  EXPECT_GT(trajectory.size(), 195U);
}

TEST(RobotPose, says_by_how_many_cameras_and_nothing_where_odometry_was_alone_for_long) {
  RobotPose robot;
  EXPECT_FALSE(robot.now());
  for (int i = 0; i < 10; ++i) {
    robot.add_odometry({at(0.1 * i), straight(0.1 * i)});
    robot.add(SensorId("left"), {at(0.1 * i), straight(0.1 * i)});
    robot.add(SensorId("right"), {at(0.1 * i), straight(0.1 * i)});
  }
  EXPECT_EQ(robot.now()->cameras, 2);
  for (int i = 10; i < 250; ++i) robot.add_odometry({at(0.1 * i), straight(0.1 * i)});
  ASSERT_TRUE(robot.now());
  EXPECT_EQ(robot.now()->cameras, 0);
  EXPECT_NEAR(robot.now()->pose.map_from_robot.t.x(), 0.5 * 24.9, 1e-6);
  for (int i = 250; i < 350; ++i) robot.add_odometry({at(0.1 * i), straight(0.1 * i)});
  EXPECT_FALSE(robot.now());
}

TEST(RobotPose, does_not_depend_on_which_camera_of_one_moment_comes_first) {
  const auto jumps = [](double t) { return t > 8.0 ? 0.6 : 0.02; };
  const std::vector<CameraTrajectory> cameras{camera(0.0, 20.0, jumps), camera(0.0, 20.0), camera(3.0, 12.0)};
  const auto one = answered(cameras), other = answered(cameras, {}, true);
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i) EXPECT_EQ(one[i].map_from_robot.t, other[i].map_from_robot.t) << i;
}

TEST(RobotPose, is_not_disturbed_by_poses_that_are_late_or_mean_nothing) {
  RobotPose robot, disturbed;
  for (int i = 0; i < 50; ++i) {
    const StampedPose pose{at(0.1 * i), straight(0.1 * i)};
    for (RobotPose* one : {&robot, &disturbed}) one->add(SensorId("left"), pose);
    disturbed.add(SensorId("left"), {at(0.1 * i - 0.05), straight(7.0, 5.0)});
    disturbed.add(SensorId("right"), {at(0.1 * i - 3.0), straight(7.0, 5.0)});
    disturbed.add(SensorId("right"), {pose.stamp, straight(std::numeric_limits<double>::quiet_NaN())});
    disturbed.add(SensorId("right"), {pose.stamp, straight(0.1 * i, 0.05)}, 0.0);
    disturbed.add_odometry({pose.stamp, straight(std::numeric_limits<double>::infinity())});
    EXPECT_EQ(disturbed.now()->pose.map_from_robot.t, robot.now()->pose.map_from_robot.t);
    EXPECT_EQ(disturbed.now()->cameras, 1);
  }
}

TEST(RobotPose, keeps_as_much_after_an_hour_as_after_two_minutes) {
  RobotPose robot;
  std::size_t early = 0;
  for (int i = 0; i < 3600 * 100; ++i) {
    const double t = 0.01 * i;
    robot.add_odometry({at(t), straight(t)});
    if (i % 10 == 0)
      robot.add(SensorId("camera" + std::to_string(i / 1000)), {at(t), straight(t)});  // another one every ten seconds
    if (i <= 120 * 100) early = std::max(early, robot.kept());
    ASSERT_LE(robot.kept(), early + 20) << t;
  }
  EXPECT_LT(early, 8000U);
}

// In a curve, with noise, cameras that go blind in turn, one that is wrong for a while, and odometry that drifts.
TEST(RobotPose, is_nearly_what_is_known_afterwards) {
  std::mt19937 random(7);
  const auto noise = [&](double sigma) {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(random()) / 4294967295.0;
    return sigma * sum;
  };
  const auto truth = [](double t, double drift = 0.0) {
    const double turn = (0.2 + drift) * t;
    return Pose3{{2.5 * std::sin(turn), 2.5 * (1.0 - std::cos(turn)), 0.0},
                 Eigen::Quaterniond(Eigen::AngleAxisd(turn, Eigen::Vector3d::UnitZ()))};
  };
  std::vector<CameraTrajectory> cameras(3);
  std::vector<StampedPose> odometry;
  for (int i = 0; i < 60 * 50; ++i) odometry.push_back({at(0.02 * i), truth(0.02 * i, 0.001)});
  for (std::size_t c = 0; c < cameras.size(); ++c)
    for (double t = 0.013 * static_cast<double>(c); t < 59.9; t += 0.0667) {
      const double phase = std::fmod(t + 7.0 * static_cast<double>(c), 20.0);
      if (phase < 3.0) continue;
      Pose3 pose = truth(t);
      pose.t += Eigen::Vector3d(noise(0.004) + 0.01 * static_cast<double>(c), noise(0.004), noise(0.004));
      if (c == 1 && t > 30.0 && t < 40.0) pose.t.x() += 0.5;
      cameras[c].frames.push_back({at(t), pose});
    }
  const auto afterwards = robot_trajectory(cameras, odometry);
  double farthest = 0.0, sum = 0.0, from_truth = 0.0;
  const auto trajectory = answered(cameras, odometry);
  for (const StampedPose& pose : trajectory) {
    if (const auto later = pose_at(afterwards, pose.stamp, 0.25)) {
      const double apart = (later->t - pose.map_from_robot.t).norm();
      farthest = std::max(farthest, apart);
      sum += apart;
    }
    from_truth = std::max(from_truth, (truth(pose.stamp.seconds() - 1000.0).t - pose.map_from_robot.t).norm());
  }
  EXPECT_GT(trajectory.size(), 3000U);
  EXPECT_LT(farthest, 0.03);
  EXPECT_LT(sum / static_cast<double>(trajectory.size()), 0.005);
  EXPECT_LT(from_truth, 0.05);
}

}  // namespace
}  // namespace mapweave::rig
