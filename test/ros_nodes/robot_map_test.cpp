// A robot's own map in a preview of several.
#include <exporters/small_map.h>
#include <gmock/gmock.h>
#include <robot_map.h>

namespace mapweave::ros_nodes {
namespace {

using test::add_pose;
using test::cross_scan;
using test::node_id;

Pose3 pose(double x, double y, double phi = 0.0) { return spatial(Pose2(x, y, phi)); }

runtime::LivePreview two_parts() {
  runtime::LivePreview preview;
  preview.parts.resize(2);
  Map& large = preview.parts[0].map;
  add_pose(large, node_id("alpha", 0), 10, pose(4, 1, M_PI / 2), cross_scan({1, 1, 1, 1}));
  add_pose(large, node_id("alpha", 1), 20, pose(4, 3, M_PI / 2));
  add_pose(large, node_id("beta", 0), 5, pose(0, 0), cross_scan({2, 2, 2, 2}));
  add_pose(preview.parts[1].map, node_id("beta", 0, 8), 50, pose(1, 1));
  return preview;
}

TEST(RobotMap, has_the_robot_s_nodes_seen_from_where_it_stood_first) {
  const auto own = robot_map(two_parts(), RobotId("alpha"));
  ASSERT_TRUE(own);
  EXPECT_EQ(own->part, 0u);
  ASSERT_EQ(own->map.nodes.size(), 2u);
  EXPECT_LT(own->map.nodes.front().second.map_from_node.t.norm(), 1e-12);
  EXPECT_LT((own->map.nodes.back().second.map_from_node.t - Eigen::Vector3d(2, 0, 0)).norm(), 1e-12);
  EXPECT_LT((own->part_from_robot_map.t - Eigen::Vector3d(4, 1, 0)).norm(), 1e-12);
  ASSERT_EQ(own->trajectory.size(), 2u);
  EXPECT_EQ(own->trajectory.back().stamp, Stamp{20});
  EXPECT_NE(own->map.nodes.front().second.payload, nullptr);
}

TEST(RobotMap, is_of_the_part_with_the_newest_pose) {
  const auto own = robot_map(two_parts(), RobotId("beta"));
  ASSERT_TRUE(own);
  EXPECT_EQ(own->part, 1u);
  EXPECT_EQ(own->map.nodes.size(), 1u);
  EXPECT_FALSE(robot_map(two_parts(), RobotId("gamma")));
  EXPECT_FALSE(robot_map(runtime::LivePreview{}, RobotId("alpha")));
}

TEST(RobotMap, of_a_map_of_its_own_is_the_same_wherever_that_lies) {
  const auto own = robot_map(two_parts().parts[0].map, RobotId("alpha"));
  ASSERT_TRUE(own);
  EXPECT_LT((own->map.nodes.back().second.map_from_node.t - Eigen::Vector3d(2, 0, 0)).norm(), 1e-12);
  EXPECT_EQ(own->trajectory.size(), 2u);
  EXPECT_FALSE(robot_map(Map(), RobotId("alpha")));
}

TEST(RobotMap, looks_other_once_a_node_comes_or_moves_or_shows_something_else) {
  const Map map = two_parts().parts[0].map;
  EXPECT_FALSE(looks_the_same(map, two_parts().parts[0].map)) << "scans of their own";
  EXPECT_TRUE(looks_the_same(map, map));
  Map moved = map;
  moved.nodes.find(node_id("alpha", 1))->map_from_node.t.x() += 1e-3;
  EXPECT_FALSE(looks_the_same(map, moved));
  Map longer = map;
  add_pose(longer, node_id("alpha", 2), 30, pose(0, 0));
  EXPECT_FALSE(looks_the_same(map, longer));
}

}  // namespace
}  // namespace mapweave::ros_nodes
