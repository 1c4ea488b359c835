#include <gtest/gtest.h>
#include <mapweave/core/geometry.h>

#include <support/pose_matchers.h>
#include <limits>

namespace mapweave {
namespace {

using test::IsNear;

TEST(WrapAngle, brings_any_angle_between_minus_pi_and_pi) {
  EXPECT_DOUBLE_EQ(wrap_angle(0.5), 0.5);
  EXPECT_DOUBLE_EQ(wrap_angle(M_PI), -M_PI);
  EXPECT_DOUBLE_EQ(wrap_angle(-M_PI), -M_PI);
  for (int turns = -20; turns <= 20; ++turns) EXPECT_NEAR(wrap_angle(1.25 + 2.0 * M_PI * turns), 1.25, 1e-12);
}

TEST(Pose2, composes_as_mrpt_does) {
  for (const Pose2& a : {Pose2{1.0, -2.0, 0.7}, Pose2{0.0, 3.0, -3.0}}) {
    for (const Pose2& b : {Pose2{-4.0, 0.5, 2.9}, Pose2{0.1, 0.2, 0.3}}) {
      const Pose2 expected = a + b;
      EXPECT_THAT(compose(a, b), IsNear(expected, 1e-12, 1e-12));
    }
  }
}

TEST(Pose2, between_undoes_compose) {
  const Pose2 a_from_b{1.0, -2.0, 2.5}, b_from_c{-4.0, 0.5, 1.9};
  EXPECT_THAT(between(a_from_b, compose(a_from_b, b_from_c)), IsNear(b_from_c, 1e-12, 1e-12));
  EXPECT_THAT(compose(a_from_b, inverse(a_from_b)), IsNear(Pose2{0, 0, 0}, 1e-12, 1e-12));
}

TEST(Pose3, between_undoes_compose) {
  const Pose3 a_from_b{{1, 2, 3}, Eigen::Quaterniond(0.5, 0.1, -0.7, 0.2).normalized()};
  const Pose3 b_from_c{{-3, 0.5, 1}, Eigen::Quaterniond(-0.2, 0.9, 0.3, 0.1).normalized()};
  const Pose3 back = between(a_from_b, compose(a_from_b, b_from_c));
  EXPECT_NEAR((back.t - b_from_c.t).norm(), 0.0, 1e-12);
  EXPECT_NEAR(back.q.angularDistance(b_from_c.q), 0.0, 1e-7);
  const Eigen::Vector3d point_in_c(0.3, -0.4, 0.5);
  EXPECT_NEAR(
      (transformed(point_in_c, compose(a_from_b, b_from_c)) - transformed(transformed(point_in_c, b_from_c), a_from_b))
          .norm(),
      0.0, 1e-12);
}

TEST(Pose3, is_planar_seen_from_above) {
  for (const double yaw : {-3.1, -1.0, 0.0, 0.4, 3.1})
    EXPECT_THAT(planar(spatial(Pose2{2.0, -1.0, yaw})), IsNear(Pose2(2.0, -1.0, yaw), 1e-12, 1e-12));
  const Pose3 lifted_and_pitched = compose(
      spatial(Pose2{1, 2, 0.8}), {{0, 0, 5}, Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitY()))});
  EXPECT_THAT(planar(lifted_and_pitched), IsNear(Pose2(1, 2, 0.8), 1e-12, 1e-12));
}

TEST(Sim3, compose_and_inverse_move_points_and_poses_alike) {
  const Sim3 a_from_b{{{1, 2, 3}, Eigen::Quaterniond(0.5, 0.1, -0.7, 0.2).normalized()}, 1.7},
      b_from_c{{{-3, 0.5, 1}, Eigen::Quaterniond(-0.2, 0.9, 0.3, 0.1).normalized()}, 0.4};
  const Eigen::Vector3d in_c(0.3, -0.4, 0.5);
  const Eigen::Vector3d in_a = transformed(transformed(in_c, b_from_c), a_from_b);
  EXPECT_NEAR((transformed(in_c, compose(a_from_b, b_from_c)) - in_a).norm(), 0.0, 1e-12);
  EXPECT_NEAR((transformed(in_a, inverse(compose(a_from_b, b_from_c))) - in_c).norm(), 0.0, 1e-12);
  const Pose3 pose_in_a = transformed(Pose3{in_c, Eigen::Quaterniond::Identity()}, a_from_b);
  EXPECT_NEAR((pose_in_a.t - transformed(in_c, a_from_b)).norm(), 0.0, 1e-12);
  EXPECT_NEAR(pose_in_a.q.angularDistance(a_from_b.pose.q), 0.0, 1e-7);
}

TEST(Pose, knows_whether_it_is_finite) {
  const double nan = std::numeric_limits<double>::quiet_NaN(), infinity = std::numeric_limits<double>::infinity();
  EXPECT_TRUE(is_finite(Pose2{1, 2, 3}));
  EXPECT_FALSE(is_finite(Pose2{1, nan, 3}));
  EXPECT_FALSE(is_finite(Pose2{1, 2, infinity}));
  EXPECT_TRUE(is_finite(Pose3{}));
  EXPECT_FALSE(is_finite(Pose3{{0, infinity, 0}, Eigen::Quaterniond::Identity()}));
  EXPECT_FALSE(is_finite(Pose3{{0, 0, 0}, Eigen::Quaterniond(nan, 0, 0, 0)}));
}

}  // namespace
}  // namespace mapweave
