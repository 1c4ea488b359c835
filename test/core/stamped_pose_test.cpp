#include <mapweave/core/stamped_pose.h>

#include <gtest/gtest.h>

namespace mapweave {
namespace {

Pose3 at(double x, double yaw) {
  return {{x, 0, 0}, Eigen::Quaterniond(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()))};
}
const std::vector<StampedPose> trajectory{
    {Stamp{1'000'000'000}, at(0.0, 0.0)}, {Stamp{2'000'000'000}, at(2.0, 0.4)}, {Stamp{5'000'000'000}, at(3.0, 0.4)}};

TEST(PoseAt, lies_between_the_poses_around_it) {
  const auto pose = pose_at(trajectory, Stamp{1'250'000'000}, 1.0);
  ASSERT_TRUE(pose);
  EXPECT_NEAR(pose->t.x(), 0.5, 1e-12);
  EXPECT_NEAR(planar(*pose).phi, 0.1, 1e-12);
}

TEST(PoseAt, is_unknown_outside_and_in_long_gaps_but_not_at_a_pose) {
  EXPECT_FALSE(pose_at(trajectory, Stamp{999'999'999}, 1.0));
  EXPECT_FALSE(pose_at(trajectory, Stamp{5'000'000'001}, 1.0));
  EXPECT_FALSE(pose_at(trajectory, Stamp{3'000'000'000}, 1.0));
  EXPECT_TRUE(pose_at(trajectory, Stamp{3'000'000'000}, 3.0));
  for (const StampedPose& known : trajectory) EXPECT_TRUE(pose_at(trajectory, known.stamp, 0.1));
  EXPECT_FALSE(pose_at({}, Stamp{1}, 1.0));
}

}  // namespace
}  // namespace mapweave
