#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/maps/scan.h>

namespace mapweave {
namespace {

PackedScan four_rays(const Pose3& robot_from_laser) {  // rays ahead, left, behind, right
  ScanGeometry geometry;
  geometry.angle_step_rad = M_PI / 2;
  geometry.ray_count = 4;
  geometry.max_range_m = 10.0;
  geometry.robot_from_laser = robot_from_laser;
  return {std::make_shared<const ScanGeometry>(geometry), {1000, 2000, 3000, 4000}};
}

TEST(PointsInRobot, puts_the_ends_of_rays_where_the_laser_saw_them) {
  const auto points = points_in_robot(four_rays(spatial(Pose2(0.5, 0.0, M_PI / 2))));
  ASSERT_EQ(points.size(), 4U);
  EXPECT_NEAR(points[0].x, 0.5, 1e-6);
  EXPECT_NEAR(points[0].y, 1.0, 1e-6);
  EXPECT_NEAR(points[1].x, -1.5, 1e-6);
  EXPECT_NEAR(points[3].x, 4.5, 1e-6);
}

TEST(PointsInRobot, mirrors_the_rays_of_a_laser_mounted_upside_down) {
  Pose3 robot_from_laser;
  robot_from_laser.q = Eigen::Quaterniond(0, 1, 0, 0);  // rolled by pi
  const auto points = points_in_robot(four_rays(robot_from_laser));
  EXPECT_NEAR(points[0].x, 1.0, 1e-6);
  EXPECT_NEAR(points[1].y, -2.0, 1e-6);
}

TEST(PointsInRobot, projects_the_rays_of_a_tilted_laser_on_the_ground) {
  Pose3 robot_from_laser;
  robot_from_laser.q = Eigen::AngleAxisd(M_PI / 3, Eigen::Vector3d::UnitY());
  const auto points = points_in_robot(four_rays(robot_from_laser));
  EXPECT_NEAR(points[0].x, 0.5, 1e-6);
  EXPECT_NEAR(points[1].y, 2.0, 1e-6);
}

TEST(PointsInRobot, leaves_out_what_has_no_return_is_near_or_is_far) {
  PackedScan scan = four_rays({});
  scan.ranges = {0, 10000, 500, 4000};
  EXPECT_EQ(points_in_robot(scan).size(), 2U) << "10 m is this laser's largest range: no return";
  EXPECT_EQ(points_in_robot(scan, 1.0).size(), 1U);
  EXPECT_EQ(points_in_robot(scan, 0.0, 1.0).size(), 1U);
}

TEST(PointsInRobot, expects_as_many_ranges_as_rays) {
  PackedScan scan = four_rays({});
  scan.ranges.pop_back();
  EXPECT_THROW(points_in_robot(scan), ContractViolation);
}

// A quarter turn per second to the left while the laser turns once around in a second, from behind the right hand side.
TEST(PointsInRobot, undistorts_what_the_robots_turn_bent) {
  PackedScan scan = four_rays({});
  auto geometry = std::make_shared<ScanGeometry>(*scan.geometry);
  geometry->first_ray_s = -0.25;
  geometry->ray_step_s = 0.25;
  scan.geometry = geometry;
  scan.motion = sweep_motion({0.0, 0.0, 0.4});
  const auto points = points_in_robot(scan);
  ASSERT_EQ(points.size(), 4U);
  EXPECT_NEAR(std::atan2(points[0].y, points[0].x), -0.1, 1e-4) << "measured a quarter of a second before the stamp";
  EXPECT_NEAR(std::atan2(points[1].y, points[1].x), M_PI / 2, 1e-4) << "measured at the stamp";
  EXPECT_NEAR(std::atan2(points[3].y, points[3].x), -M_PI / 2 + 0.2, 1e-4);
  EXPECT_NEAR(std::hypot(points[3].x, points[3].y), 4.0, 1e-5);
}

TEST(PointsInRobot, undistorts_what_the_robots_drive_bent) {
  PackedScan scan = four_rays(spatial(Pose2(0.5, 0.0, 0.0)));
  auto geometry = std::make_shared<ScanGeometry>(*scan.geometry);
  geometry->ray_step_s = -0.1;  // the last ray first
  geometry->first_ray_s = 0.3;
  scan.geometry = geometry;
  scan.motion = sweep_motion({2.0, -1.0, 0.0});
  const auto points = points_in_robot(scan);
  EXPECT_NEAR(points[0].x, 1.5 + 0.6, 1e-5);
  EXPECT_NEAR(points[0].y, -0.3, 1e-5);
  EXPECT_NEAR(points[3].x, 0.5, 1e-5) << "measured at the stamp";
}

TEST(PointsInRobot, leaves_the_scans_of_a_robot_that_stands_still_as_they_are) {
  const PackedScan plain = four_rays({});
  PackedScan swept = plain;
  auto geometry = std::make_shared<ScanGeometry>(*plain.geometry);
  geometry->ray_step_s = 0.25;
  swept.geometry = geometry;
  const auto expected = points_in_robot(plain), points = points_in_robot(swept);
  for (std::size_t i = 0; i < expected.size(); ++i) {
    EXPECT_EQ(points[i].x, expected[i].x);
    EXPECT_EQ(points[i].y, expected[i].y);
  }
}

TEST(SweepMotion, drives_along_an_arc) {
  const SweepMotion motion = sweep_motion({1.0, 0.0, 1.0});
  const Pose2 end = moved(motion, 0.2);
  EXPECT_NEAR(end.x, std::sin(0.2), 2e-3);
  EXPECT_NEAR(end.y, 1.0 - std::cos(0.2), 2e-3);
  EXPECT_NEAR(end.phi, 0.2, 1e-9);
  EXPECT_EQ(sweep_motion({1e9, -1e9, 0.0004}), (SweepMotion{32000, -32000, 0}));
}

}  // namespace
}  // namespace mapweave
