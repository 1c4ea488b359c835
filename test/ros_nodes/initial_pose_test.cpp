// A pose that a user gives of a robot, as what is known of where robots began.
#include <exporters/small_map.h>
#include <gmock/gmock.h>
#include <initial_pose.h>
#include <mapweave/core/error.h>

namespace mapweave::ros_nodes {
namespace {

using test::node_id;

Pose3 pose(double x, double y, double phi = 0.0) { return spatial(Pose2(x, y, phi)); }

// Alpha in the largest part; beta by itself, three metres from where it began.
runtime::LivePreview two_parts() {
  runtime::LivePreview preview;
  preview.parts.resize(2);
  test::add_pose(preview.parts[0].map, node_id("alpha", 0), 10, pose(1, 2));
  test::add_pose(preview.parts[0].map, node_id("alpha", 1), 20, pose(4, 2));
  test::add_pose(preview.parts[1].map, node_id("beta", 0), 10, pose(0, 0));
  test::add_pose(preview.parts[1].map, node_id("beta", 1), 20, pose(3, 0));
  return preview;
}

runtime::RunConfiguration two_robots() {
  runtime::RunConfiguration configuration;
  configuration.robots = {{"alpha", "alpha.mcap", ""}, {"beta", "beta.mcap", ""}};
  return configuration;
}

const GivenPose kGiven{RobotId("beta"), Pose2(5, 5, 0), 0.3, 0.2};

TEST(InitialPose, says_where_the_robot_and_another_one_began) {
  runtime::LiveRequests requests;
  add_pose(kGiven, two_parts(), two_robots(), requests);
  const runtime::StartPose beta = requests.starts.at(RobotId("beta")), alpha = requests.starts.at(RobotId("alpha"));
  EXPECT_NEAR(beta.x_m, 2.0, 1e-9);
  EXPECT_NEAR(beta.y_m, 5.0, 1e-9);
  EXPECT_EQ(beta.sigma_m, 0.3);
  EXPECT_EQ(beta.sigma_rad, 0.2);
  EXPECT_NEAR(alpha.x_m, 1.0, 1e-9);
  EXPECT_NEAR(alpha.y_m, 2.0, 1e-9);
  EXPECT_LT(alpha.sigma_m, 0.1);
}

TEST(InitialPose, is_put_into_the_frame_of_starts_that_are_known) {
  runtime::LiveRequests requests;
  requests.starts[RobotId("alpha")] = {10.0, 0.0, M_PI / 2, 0.1, 0.1};
  add_pose(kGiven, two_parts(), two_robots(), requests);
  EXPECT_EQ(requests.starts.at(RobotId("alpha")).x_m, 10.0);
  const runtime::StartPose beta = requests.starts.at(RobotId("beta"));
  EXPECT_NEAR(beta.x_m, 7.0, 1e-9);
  EXPECT_NEAR(beta.y_m, 1.0, 1e-9);
  EXPECT_NEAR(beta.yaw_rad, M_PI / 2, 1e-9);
}

TEST(InitialPose, of_a_robot_without_a_map_is_where_it_begins) {
  runtime::LivePreview preview = two_parts();
  preview.parts.pop_back();
  runtime::LiveRequests requests;
  add_pose(kGiven, preview, two_robots(), requests);
  EXPECT_NEAR(requests.starts.at(RobotId("beta")).x_m, 5.0, 1e-9);
}

TEST(InitialPose, needs_a_map_with_another_robot) {
  runtime::LiveRequests requests;
  EXPECT_THROW(add_pose(kGiven, {}, two_robots(), requests), Error);
  runtime::LivePreview alone = two_parts();
  alone.parts.erase(alone.parts.begin());
  EXPECT_THROW(add_pose(kGiven, alone, two_robots(), requests), Error);
  EXPECT_TRUE(requests.starts.empty());
}

}  // namespace
}  // namespace mapweave::ros_nodes
