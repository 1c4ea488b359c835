#include <mapweave/fusion/robot_way.h>
#include <support/straight_ways.h>

#include <gtest/gtest.h>

namespace mapweave::fusion {
namespace {

using test::aside_m;
using test::at;
using test::longest_step_m;
Pose3 ahead(double x, double y = 0.0) { return {{x, y, 0.0}, Eigen::Quaterniond::Identity()}; }

// Half a metre a second along x, 10 frames a second; `aside_m`: by how much to the left.
template <class Aside>
SeenWay camera(double begin_s, double end_s, Aside aside_m, double weight = 1.0) {
  return test::straight_way(begin_s, end_s, aside_m, weight);
}
SeenWay camera(double begin_s, double end_s, double aside_m = 0.0, double weight = 1.0) {
  return camera(
      begin_s, end_s, [=](double) { return aside_m; }, weight);
}

TEST(RobotWay, is_the_weighted_mean_at_every_stamp_of_any_camera) {
  const SeenWay one = camera(0.0, 10.0, 0.00, 3.0);
  SeenWay other = camera(0.0, 10.0, 0.04, 1.0);
  for (StampedPose& pose : other.frames) pose.stamp.ns += 50'000'000, pose.map_from_robot.t.x() += 0.025;
  const auto way = robot_way({one, other}, {});
  EXPECT_EQ(way.size(), one.frames.size() + other.frames.size());
  EXPECT_NEAR(aside_m(way, 5.0), 0.01, 1e-6);
  for (const StampedPose& pose : way) EXPECT_NEAR(pose.map_from_robot.t.x(), 0.5 * (pose.stamp.seconds() - 1000.0), 1e-3);
}

TEST(RobotWay, does_not_jump_where_a_camera_comes_and_goes) {
  const auto way = robot_way({camera(0.0, 20.0, 0.0), camera(5.0, 12.0, 0.08)}, {});
  EXPECT_NEAR(aside_m(way, 8.0), 0.04, 1e-6);
  EXPECT_NEAR(aside_m(way, 15.0), 0.0, 1e-6);
  EXPECT_LT(longest_step_m(way), 0.055);
}

TEST(RobotWay, is_handed_over_without_a_jump) {
  const auto way = robot_way({camera(0.0, 10.0, 0.0), camera(7.0, 20.0, 0.08)}, {});
  EXPECT_NEAR(aside_m(way, 5.0), 0.0, 1e-6);
  EXPECT_NEAR(aside_m(way, 15.0), 0.08, 1e-6);
  EXPECT_LT(longest_step_m(way), 0.055);
}

TEST(RobotWay, is_handed_over_without_a_jump_to_one_that_was_doubted) {
  const auto jumps = [](double t) { return t > 8.0 ? 0.3 : 0.0; };
  const auto way = robot_way({camera(0.0, 15.0), camera(0.0, 25.0, jumps)}, {});
  EXPECT_NEAR(aside_m(way, 14.0), 0.0, 0.01);
  EXPECT_NEAR(aside_m(way, 20.0), 0.3, 1e-6);
  EXPECT_LT(longest_step_m(way), 0.065);
}

TEST(RobotWay, is_told_by_most_where_one_of_three_errs) {
  const auto errs = [](double t) { return t > 10.0 && t < 15.0 ? 1.5 : 0.0; };
  const auto way = robot_way({camera(0.0, 20.0, errs, 5.0), camera(0.0, 20.0), camera(0.0, 20.0)}, {});
  for (double t = 0.0; t < 19.8; t += 0.1) EXPECT_NEAR(aside_m(way, t), 0.0, 0.01) << t;
}

TEST(RobotWay, believes_the_one_that_wheels_agree_with) {
  // The heavier one slips away slowly.
  const auto slips = [](double t) { return t > 8.0 ? 0.1 * (t - 8.0) : 0.0; };
  const auto way = robot_way({camera(0.0, 20.0, slips, 5.0), camera(0.0, 20.0)}, camera(0.0, 20.0).frames);
  EXPECT_NEAR(aside_m(way, 15.0), 0.0, 0.01);
  const auto moved = [](double t) { return t > 8.0 ? 0.1 * (t - 8.0) : 0.0; };
  const auto other = robot_way({camera(0.0, 20.0, slips, 5.0), camera(0.0, 20.0)}, camera(0.0, 20.0, moved).frames);
  EXPECT_NEAR(aside_m(other, 15.0), 0.7, 0.01);
}

TEST(RobotWay, does_not_follow_a_camera_that_jumps) {
  const auto jumps = [](double t) { return t > 8.0 ? 0.6 : 0.0; };
  for (const bool first : {true, false}) {
    const SeenWay one = camera(0.0, 20.0, jumps), other = camera(0.0, 20.0);
    const auto way = first ? robot_way({one, other}, {}) : robot_way({other, one}, {});
    EXPECT_NEAR(aside_m(way, 12.0), 0.0, 0.01);
  }
}

TEST(RobotWay, of_one_camera_is_its_own) {
  const SeenWay one = camera(0.0, 3.0);
  const auto way = robot_way({one}, {});
  ASSERT_EQ(way.size(), one.frames.size());
  EXPECT_EQ(way[7].map_from_robot.t, one.frames[7].map_from_robot.t);
}

TEST(CarriedAlong, frames_go_with_the_keyframes_around_them) {
  const std::vector<MovedKeyframe> keyframes{{at(1.0), ahead(1.0), ahead(1.0, 0.2), 1.0}, {at(2.0), ahead(2.0), ahead(2.0, 0.4), 1.0}};
  const auto frames = carried_along({{at(0.5), ahead(0.5)}, {at(1.5), ahead(1.5)}, {at(3.0), ahead(3.0)}}, keyframes);
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_NEAR(frames[0].map_from_robot.t.y(), 0.2, 1e-9);
  EXPECT_NEAR(frames[1].map_from_robot.t.y(), 0.3, 1e-9);
  EXPECT_NEAR(frames[2].map_from_robot.t.y(), 0.4, 1e-9);
  EXPECT_TRUE(carried_along({{at(0.5), ahead(0.5)}}, {}).empty());
}

TEST(CarriedAlong, ways_of_the_camera_grow_and_not_the_robot_under_it) {
  const Pose3 robot_from_camera{{0.3, 0.0, 0.6}, Eigen::Quaterniond::Identity()};
  const Pose3 turned{{1.0, 0.0, 0.0}, Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitZ()))};
  const std::vector<MovedKeyframe> keyframes{{at(1.0), Pose3(), Pose3(), 2.0, robot_from_camera}};
  const Pose3 pose = carried_along({{at(1.5), turned}}, keyframes).front().map_from_robot;
  // The camera went from 0.3 m to 0.7 m, and so truly to 1.1 m; the robot that has turned round stands 0.3 m before it.
  EXPECT_NEAR(compose(pose, robot_from_camera).t.x(), 1.1, 1e-9);
  EXPECT_NEAR(pose.t.x(), 1.4, 1e-9);
  EXPECT_NEAR(pose.t.z(), 0.0, 1e-9);
}

}  // namespace
}  // namespace mapweave::fusion
