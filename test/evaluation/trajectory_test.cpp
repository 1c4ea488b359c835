#include <gtest/gtest.h>
#include <mapweave/evaluation/trajectory.h>
#include <support/pose_matchers.h>

namespace mapweave::evaluation {
namespace {

using test::IsNear;

Stamp at(double seconds) { return Stamp{static_cast<std::int64_t>(std::llround(seconds * 1e9))}; }

// At 10 s, 12 s and 20 s; turns across the seam at 180 degrees between the first two.
const Trajectory kThree = {{at(10.0), spatial(Pose2(0.0, 0.0, 3.0))},
                           {at(12.0), spatial(Pose2(2.0, 1.0, -3.0))},
                           {at(20.0), spatial(Pose2(9.0, 9.0, 0.0))}};

TEST(InterpolatedPose, goes_straight_and_turns_by_the_smaller_angle) {
  const auto pose = interpolated_pose(kThree, at(11.0), 2.0);
  ASSERT_TRUE(pose);
  EXPECT_THAT(planar(*pose), IsNear(Pose2(1.0, 0.5, M_PI), 1e-9, 1e-9));
}

TEST(InterpolatedPose, is_the_pose_itself_at_its_stamp) {
  for (const auto& point : kThree) {
    const auto pose = interpolated_pose(kThree, point.stamp, 0.0);
    ASSERT_TRUE(pose);
    EXPECT_THAT(planar(*pose), IsNear(planar(point.pose), 1e-12, 1e-12));
  }
}

TEST(InterpolatedPose, does_not_bridge_a_gap_longer_than_allowed) {
  EXPECT_FALSE(interpolated_pose(kThree, at(11.0), 1.9));
  EXPECT_FALSE(interpolated_pose(kThree, at(15.0), 2.0));
  EXPECT_TRUE(interpolated_pose(kThree, at(15.0), 8.0));
}

TEST(InterpolatedPose, does_not_go_past_either_end) {
  EXPECT_FALSE(interpolated_pose(kThree, at(9.999), 100.0));
  EXPECT_FALSE(interpolated_pose(kThree, at(20.001), 100.0));
  EXPECT_FALSE(interpolated_pose({}, at(1.0), 100.0));
}

TEST(NearestPoint, is_the_nearer_neighbour_within_the_tolerance) {
  EXPECT_EQ(nearest_point(kThree, at(10.9), 2.0), &kThree[0]);
  EXPECT_EQ(nearest_point(kThree, at(11.1), 2.0), &kThree[1]);
  EXPECT_EQ(nearest_point(kThree, at(11.0), 2.0), &kThree[0]);  // equally near: the earlier
  EXPECT_EQ(nearest_point(kThree, at(0.0), 10.0), &kThree[0]);
  EXPECT_EQ(nearest_point(kThree, at(21.0), 1.0), &kThree[2]);
  EXPECT_EQ(nearest_point(kThree, at(15.0), 2.0), nullptr);
  EXPECT_EQ(nearest_point({}, at(15.0), 2.0), nullptr);
}

}  // namespace
}  // namespace mapweave::evaluation
