#include <mapweave/rig/fused_pose.h>

#include <gtest/gtest.h>
#include <algorithm>
#include <functional>

namespace mapweave::rig {
namespace {

Stamp at(double seconds) { return stamp_from_seconds(1000.0 + seconds); }

// A robot that drives half a metre a second along an arc.
Pose2 truth(double seconds) {
  constexpr double kTurn = 0.1, kSpeed = 0.5;
  return {kSpeed / kTurn * std::sin(kTurn * seconds), kSpeed / kTurn * (1.0 - std::cos(kTurn * seconds)),
          wrap_angle(kTurn * seconds)};
}

struct Sensing {
  double begin_s = 0.0, end_s = 20.0, period_s = 0.1;
  Pose3 map_from_world = {};
  int session = 0;
  double scale = 1.0;
};

SpokenPoses sensed(PoseSensor sensor, const std::vector<Sensing>& times) {
  SpokenPoses result{std::move(sensor), {}};
  for (const Sensing& time : times)
    for (int i = 0; time.begin_s + i * time.period_s < time.end_s - 1e-9; ++i) {
      const double t = time.begin_s + i * time.period_s;
      Pose3 pose = compose(time.map_from_world, spatial(truth(t)));
      pose.t *= time.scale;
      result.poses.push_back({at(t), time.session, pose});
    }
  return result;
}
const PoseSensor kLaser{"laser", true, true, {}}, kCamera{"camera", false, true, {}}, kMono{"mono", false, false, {}};

// Readings 20 times a second, 2 % too long.
std::vector<StampedPose> wheels(double end_s = 20.0) {
  std::vector<StampedPose> readings;
  for (int i = 0; 0.05 * i < end_s - 1e-9; ++i) {
    const double t = 0.05 * i;
    const Pose2 pose = truth(t);
    readings.push_back({at(t), spatial(Pose2{1.02 * pose.x + 3.0, 1.02 * pose.y, pose.phi})});
  }
  return readings;
}

double largest_error_m(const FusedTrajectory& trajectory, double from_s = 0.0, double until_s = 100.0) {
  double largest = 0.0;
  for (const FusedPose& pose : trajectory.poses) {
    const double seconds = seconds_between(at(0.0), pose.stamp);
    if (seconds < from_s || seconds > until_s) continue;
    const Pose2 there = truth(seconds), here = planar(pose.map_from_robot);
    largest = std::max(largest, std::hypot(here.x - there.x, here.y - there.y));
  }
  return largest;
}

std::vector<PoseEvent> events(const FusedTrajectory& trajectory) {
  std::vector<PoseEvent> result;
  for (const FusedPose& pose : trajectory.poses)
    if (pose.event != PoseEvent::none) result.push_back(pose.event);
  return result;
}

TEST(FusedPoses, fill_in_by_wheels_between_scans) {
  const auto trajectory = fused_poses({sensed(kLaser, {{0.0, 20.0, 0.2}})}, wheels());
  EXPECT_EQ(trajectory.poses.size(), 400U) << "at the rate of the wheels";
  EXPECT_EQ(trajectory.report.sources[0].poses, 100U);
  EXPECT_LT(largest_error_m(trajectory), 0.005);
  EXPECT_EQ(trajectory.report.sources[1].led_s, 0.0) << "the laser is in charge all the time";
  EXPECT_EQ(events(trajectory), std::vector<PoseEvent>{PoseEvent::begins});
  for (std::size_t i = 1; i < trajectory.poses.size(); ++i)
    ASSERT_LT(trajectory.poses[i - 1].stamp, trajectory.poses[i].stamp);
}

TEST(FusedPoses, rest_on_nothing_that_came_later) {
  const auto camera = sensed(kCamera, {{0.0, 6.0}, {9.0, 20.0}});
  const auto all = fused_poses({camera}, wheels());
  for (const double until_s : {5.0, 7.5, 9.05, 15.0}) {
    SpokenPoses part = camera;
    part.poses.erase(std::remove_if(part.poses.begin(), part.poses.end(),
                                    [&](const SensorPose& pose) { return at(until_s) < pose.stamp; }),
                     part.poses.end());
    std::vector<StampedPose> turned = wheels();
    turned.erase(
        std::remove_if(turned.begin(), turned.end(), [&](const StampedPose& pose) { return at(until_s) < pose.stamp; }),
        turned.end());
    const auto so_far = fused_poses({part}, turned);
    for (std::size_t i = 0; i < so_far.poses.size(); ++i) {
      ASSERT_EQ(so_far.poses[i].stamp, all.poses[i].stamp);
      ASSERT_EQ(so_far.poses[i].map_from_robot.t, all.poses[i].map_from_robot.t);
      ASSERT_EQ(so_far.poses[i].event, all.poses[i].event);
    }
  }
}

TEST(FusedPoses, are_bridged_by_wheels_while_a_camera_is_dark) {
  const auto trajectory = fused_poses({sensed(kCamera, {{0.0, 8.0}, {13.0, 20.0}})}, wheels());
  EXPECT_LT(trajectory.report.longest_gap_s, 0.06);
  EXPECT_NEAR(trajectory.report.longest_on_wheels_s, 5.1, 0.11);
  EXPECT_NEAR(trajectory.report.sources[1].led_s, 4.6, 0.2) << "but for the half second of patience";
  EXPECT_EQ(events(trajectory), (std::vector<PoseEvent>{PoseEvent::begins, PoseEvent::fails_over, PoseEvent::returns}));
  EXPECT_LT(largest_error_m(trajectory), 0.1);
  for (const FusedPose& pose : trajectory.poses) {
    const double seconds = seconds_between(at(0.0), pose.stamp);
    if (seconds < 8.5 || seconds > 12.95) continue;
    ASSERT_EQ(trajectory.report.sources[pose.leader].name, "wheels") << seconds;
    ASSERT_GT(pose.deviation_m, 0.02);
  }
}

TEST(FusedPoses, leave_a_gap_where_nothing_knows) {
  const auto trajectory = fused_poses({sensed(kCamera, {{0.0, 8.0}, {13.0, 20.0}})}, {});
  EXPECT_NEAR(trajectory.report.longest_gap_s, 5.1, 0.01);
}

TEST(FusedPoses, go_over_to_another_sensor_without_a_jump_and_return) {
  const Pose3 elsewhere{{4.0, -2.0, 0.0}, Eigen::Quaterniond(Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitZ()))};
  const auto laser = sensed(kLaser, {{0.0, 6.0, 0.2}, {12.0, 20.0, 0.2}});
  const auto camera = sensed(kCamera, {{0.03, 20.0, 0.1, elsewhere}});
  for (const auto& odometry : {wheels(), std::vector<StampedPose>{}}) {
    const auto trajectory = fused_poses({camera, laser}, odometry);
    EXPECT_EQ(trajectory.report.sources[0].name, "laser") << "the laser first, however they are listed";
    EXPECT_LT(largest_error_m(trajectory), 0.03);
    EXPECT_EQ(trajectory.report.failovers, 1U);
    EXPECT_EQ(trajectory.report.returns, 1U);
    EXPECT_EQ(trajectory.report.jumps, 0U);
    EXPECT_NEAR(trajectory.report.sources[1].led_s, 6.0, 0.6);
  }
  FusedPoseOptions options;
  options.first = FirstSource::cameras;
  EXPECT_EQ(fused_poses({camera, laser}, wheels(), options).report.sources[0].name, "camera");
}

TEST(FusedPoses, say_where_a_loop_closure_moved_the_map) {
  const Pose3 corrected{{0.4, 0.0, 0.0}, Eigen::Quaterniond::Identity()};
  const auto trajectory = fused_poses({sensed(kLaser, {{0.0, 10.0, 0.2}, {10.0, 20.0, 0.2, corrected}})}, wheels());
  EXPECT_EQ(trajectory.report.jumps, 1U);
  EXPECT_NEAR(trajectory.report.largest_jump_m, 0.4, 0.01);
  EXPECT_EQ(events(trajectory), (std::vector<PoseEvent>{PoseEvent::begins, PoseEvent::jump}));
}

TEST(FusedPoses, begin_a_new_map_where_the_wheels_say_and_return_to_the_old_one) {
  const Pose3 elsewhere{{7.0, 1.0, 0.0}, Eigen::Quaterniond::Identity()};
  const auto trajectory =
      fused_poses({sensed(kCamera, {{0.0, 5.0}, {8.0, 12.0, 0.1, elsewhere, 1}, {12.0, 20.0}})}, wheels());
  EXPECT_LT(largest_error_m(trajectory), 0.1);
  EXPECT_GT(largest_error_m(trajectory, 8.0, 11.9), 0.02) << "it rests on wheels";
  EXPECT_LT(largest_error_m(trajectory, 12.0, 20.0), 0.005) << "and is forgotten where the old map is back";
  const auto seen = events(trajectory);
  EXPECT_EQ(std::count(seen.begin(), seen.end(), PoseEvent::new_map), 1);
}

TEST(FusedPoses, let_a_single_camera_speak_once_wheels_gave_its_scale) {
  const auto trajectory = fused_poses({sensed(kMono, {{0.0, 20.0, 0.1, {}, 0, 0.37}})}, wheels());
  ASSERT_TRUE(trajectory.report.scale);
  EXPECT_NEAR(*trajectory.report.scale, 1.02 / 0.37, 0.02);
  EXPECT_TRUE(trajectory.report.is_metric);
  EXPECT_LT(largest_error_m(trajectory), 0.3);
  EXPECT_EQ(trajectory.report.sources[trajectory.poses.front().source].name, "wheels");
  EXPECT_EQ(trajectory.report.sources[trajectory.poses.back().leader].name, "mono");
  const auto alone = fused_poses({sensed(kMono, {{0.0, 20.0, 0.1, {}, 0, 0.37}})}, {});
  EXPECT_FALSE(alone.report.is_metric) << "in units of its own";
  EXPECT_EQ(alone.poses.size(), 200U);
}

TEST(FusedPoses, wait_for_a_laser_that_is_slow) {
  const auto trajectory = fused_poses({sensed(kLaser, {{0.0, 20.0, 1.5}})}, wheels());
  EXPECT_EQ(trajectory.report.failovers, 0U);
}

TEST(FusedPoses, are_none_where_no_sensor_spoke) {
  EXPECT_TRUE(fused_poses({sensed(kLaser, {})}, wheels()).poses.empty());
  EXPECT_TRUE(fused_poses({}, {}).poses.empty());
}

TEST(FusedPoses, name_a_source_for_each_line_of_the_trajectory) {
  const auto trajectory = fused_poses({sensed(kLaser, {{0.0, 2.0, 0.2}})}, wheels(2.0));
  const std::string text = trajectory.sources_csv();
  EXPECT_EQ(static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n')), trajectory.poses.size() + 1);
  EXPECT_NE(text.find("\n1000.000000,laser,laser,0.020,0.000,begins,0.000,0.0000\n"), std::string::npos) << text;
  EXPECT_NE(text.find("\n1000.050000,wheels,laser,"), std::string::npos) << text;
}

}  // namespace
}  // namespace mapweave::rig
