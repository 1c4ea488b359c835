#include "small_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/evaluation/trajectory_file.h>
#include <mapweave/evaluation/tum_trajectory.h>
#include <mapweave/exporters/session_trajectories.h>
#include <mapweave/exporters/trajectory_files.h>

#include <cmath>

namespace mapweave::exporters {
namespace {

using test::add_pose;
using test::node_id;

TEST(TumText, is_one_line_per_scan_with_six_decimals) {
  Map map;
  add_pose(map, node_id("alpha", 0), 976052857337530000, spatial(Pose2(1.0, -2.5, M_PI / 2)));
  add_pose(map, node_id("alpha", 1), 976052857537530499,
           {{-1e-9, 123456.7890123, 0.5}, Eigen::Quaterniond(-0.5, 0.5, 0.5, -0.5)});
  EXPECT_EQ(tum_text(map, RobotId("alpha")),
            "976052857.337530 1.000000 -2.500000 0.000000 0.000000 0.000000 0.707107 0.707107\n"
            "976052857.537530 0.000000 123456.789012 0.500000 -0.500000 -0.500000 0.500000 0.500000\n");
}

TEST(TumText, of_a_team_loses_no_pose_of_robots_that_drove_at_the_same_time) {
  Map map;
  add_pose(map, node_id("beta", 0), 1000000000, spatial(Pose2(10.0, 0.0, 0.0)));
  add_pose(map, node_id("beta", 1), 3000000000, spatial(Pose2(11.0, 0.0, 0.0)));
  add_pose(map, node_id("alpha", 0), 2000000000, spatial(Pose2(1.0, 0.0, 0.0)));
  add_pose(map, node_id("alpha", 1), 3000000400,
           spatial(Pose2(2.0, 0.0, 0.0)));  // 0.4 microseconds on: the same when written
  EXPECT_EQ(tum_text(map, RobotId("alpha")),
            "2.000000 1.000000 0.000000 0.000000 0.000000 0.000000 0.000000 1.000000\n"
            "3.000000 2.000000 0.000000 0.000000 0.000000 0.000000 0.000000 1.000000\n");
  EXPECT_EQ(tum_text(map, RobotId("beta")),
            "1.000000 10.000000 0.000000 0.000000 0.000000 0.000000 0.000000 1.000000\n"
            "3.000000 11.000000 0.000000 0.000000 0.000000 0.000000 0.000000 1.000000\n");
  EXPECT_EQ(tum_text(map, RobotId("gamma")), "");
}

TEST(TumText, joins_a_robots_sessions_and_leaves_out_served_grids) {
  Map map;
  add_pose(map, node_id("alpha", 0, 50), 1000000000, {});
  add_pose(map, node_id("alpha", 0, 60), 2000000000, {});
  add_pose(map, node_id("floor", 0), 1500000000, {}, std::make_shared<const Payload>(test::drawn_grid({"#."})));
  EXPECT_EQ(evaluation::parse_tum(tum_text(map, RobotId("alpha")), "map").size(), 2u);
  EXPECT_EQ(session_trajectories(map).size(), 2u);
}

TEST(TumText, holds_the_robots_poses_at_keyframes) {
  Map map;
  auto camera = std::make_shared<CameraGeometry>();
  camera->robot_from_camera.t = {5.0, 5.0, 5.0};
  add_pose(map, node_id("alpha", 0), 1000000000, spatial(Pose2(1.0, 2.0, 0.0)),
           std::make_shared<const Payload>(KeyframeFeatures{camera, {}, {}}));
  EXPECT_EQ(tum_text(map, RobotId("alpha")),
            "1.000000 1.000000 2.000000 0.000000 0.000000 0.000000 0.000000 1.000000\n");
}

TEST(TumText, writes_stamps_before_the_epoch_and_rounds_them) {
  Map map;
  add_pose(map, node_id("alpha", 0), -1500000600, {});
  add_pose(map, node_id("alpha", 1), 999999600, {});
  EXPECT_THAT(tum_text(map, RobotId("alpha")), testing::HasSubstr("-1.500001 0.0"));
  EXPECT_THAT(tum_text(map, RobotId("alpha")), testing::HasSubstr("\n1.000000 0.0"));
}

TEST(TumText, reads_back_as_it_was_to_the_sixth_decimal) {
  Map map;
  for (std::uint32_t i = 0; i < 50; ++i) {
    const double angle = 0.37 * i;
    const Pose3 pose{{std::cos(angle) * 20.0, std::sin(angle) * 3.0, 0.1 * i},
                     Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d(0.3, -0.2, 0.9).normalized()))};
    add_pose(map, node_id("alpha", i), 1211500000000 + 217391000LL * i, pose);
  }
  const auto trajectory = evaluation::parse_tum(tum_text(map, RobotId("alpha")), "map");
  ASSERT_EQ(trajectory.size(), 50u);
  std::size_t i = 0;
  for (const auto& [id, node] : map.nodes) {
    EXPECT_EQ(trajectory[i].stamp, node.stamp);
    EXPECT_NEAR((trajectory[i].pose.t - node.map_from_node.t).norm(), 0.0, 1e-6);
    EXPECT_NEAR(trajectory[i].pose.q.angularDistance(node.map_from_node.q), 0.0, 4e-6);
    ++i;
  }
}

TEST(TumText, does_not_write_a_pose_that_is_no_pose) {
  Map map;
  add_pose(map, node_id("alpha", 0), 1, spatial(Pose2(NAN, 0.0, 0.0)));
  EXPECT_THROW(tum_text(map, RobotId("alpha")), ContractViolation);
}

TEST(TrajectoryTexts, of_kitti_and_euroc_read_back_as_they_were) {
  std::vector<StampedPose> poses;
  for (int i = 0; i < 5; ++i)
    poses.push_back({Stamp{1403715273262140000LL + i * 50000000LL},
                     {{0.1 * i, -2.0, 3.0},
                      Eigen::Quaterniond(Eigen::AngleAxisd(0.3 * i, Eigen::Vector3d(1.0, 2.0, -1.0).normalized()))}});
  const auto euroc = evaluation::parse_trajectory(euroc_text(poses), "e");
  const auto kitti = evaluation::parse_trajectory(kitti_text(poses), "k", kitti_times_text(poses));
  EXPECT_EQ(euroc.format, evaluation::TrajectoryFormat::euroc);
  EXPECT_EQ(kitti.format, evaluation::TrajectoryFormat::kitti);
  for (const auto* read : {&euroc.trajectory, &kitti.trajectory}) {
    ASSERT_EQ(read->size(), poses.size());
    for (std::size_t i = 0; i < poses.size(); ++i) {
      EXPECT_EQ((*read)[i].stamp, poses[i].stamp);
      EXPECT_NEAR(((*read)[i].pose.t - poses[i].map_from_robot.t).norm(), 0.0, 1e-6);
      EXPECT_NEAR((*read)[i].pose.q.angularDistance(poses[i].map_from_robot.q), 0.0, 4e-6);
    }
  }
}

}  // namespace
}  // namespace mapweave::exporters
