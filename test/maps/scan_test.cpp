#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/maps/scan.h>

namespace mapweave {
namespace {

PackedScan four_ways(const Pose3& robot_from_laser) {  // rays ahead, left, behind, right
  ScanGeometry geometry;
  geometry.angle_step_rad = M_PI / 2;
  geometry.ray_count = 4;
  geometry.max_range_m = 10.0;
  geometry.robot_from_laser = robot_from_laser;
  return {std::make_shared<const ScanGeometry>(geometry), {1000, 2000, 3000, 4000}};
}

TEST(PointsInRobot, puts_the_ends_of_rays_where_the_laser_saw_them) {
  const auto points = points_in_robot(four_ways(spatial(Pose2(0.5, 0.0, M_PI / 2))));
  ASSERT_EQ(points.size(), 4U);
  EXPECT_NEAR(points[0].x, 0.5, 1e-6);
  EXPECT_NEAR(points[0].y, 1.0, 1e-6);
  EXPECT_NEAR(points[1].x, -1.5, 1e-6);
  EXPECT_NEAR(points[3].x, 4.5, 1e-6);
}

TEST(PointsInRobot, mirrors_the_rays_of_a_laser_mounted_upside_down) {
  Pose3 robot_from_laser;
  robot_from_laser.q = Eigen::Quaterniond(0, 1, 0, 0);  // rolled by pi
  const auto points = points_in_robot(four_ways(robot_from_laser));
  EXPECT_NEAR(points[0].x, 1.0, 1e-6);
  EXPECT_NEAR(points[1].y, -2.0, 1e-6);
}

TEST(PointsInRobot, projects_the_rays_of_a_tilted_laser_on_the_ground) {
  Pose3 robot_from_laser;
  robot_from_laser.q = Eigen::AngleAxisd(M_PI / 3, Eigen::Vector3d::UnitY());
  const auto points = points_in_robot(four_ways(robot_from_laser));
  EXPECT_NEAR(points[0].x, 0.5, 1e-6);
  EXPECT_NEAR(points[1].y, 2.0, 1e-6);
}

TEST(PointsInRobot, leaves_out_what_has_no_return_is_near_or_is_far) {
  PackedScan scan = four_ways({});
  scan.ranges = {0, 10000, 500, 4000};
  EXPECT_EQ(points_in_robot(scan).size(), 2U) << "10 m is this laser's largest range: no return";
  EXPECT_EQ(points_in_robot(scan, 1.0).size(), 1U);
  EXPECT_EQ(points_in_robot(scan, 0.0, 1.0).size(), 1U);
}

TEST(PointsInRobot, expects_as_many_ranges_as_rays) {
  PackedScan scan = four_ways({});
  scan.ranges.pop_back();
  EXPECT_THROW(points_in_robot(scan), ContractViolation);
}

}  // namespace
}  // namespace mapweave
