#include <mapweave/fusion/team_frame.h>

#include <gtest/gtest.h>
#include <support/random_map.h>

namespace mapweave::fusion {
namespace {

constexpr double kDegree_rad = M_PI / 180.0;

// A room whose walls stand at `yaw_rad`, as a robot saw it that drove along its middle.
Map room_at(double yaw_rad) {
  Map map;
  map.id = MapId("room");
  auto geometry = std::make_shared<ScanGeometry>();
  geometry->first_angle_rad = -M_PI;
  geometry->angle_step_rad = kDegree_rad;
  geometry->ray_count = 360;
  geometry->max_range_m = 30.0;
  for (std::uint32_t i = 0; i < 10; ++i) {
    const double x = 0.3 * i, heading = 0.2 * i;
    PackedScan scan;
    scan.geometry = geometry;
    for (std::uint32_t ray = 0; ray < geometry->ray_count; ++ray) {
      const double angle = geometry->first_angle_rad + ray * geometry->angle_step_rad + heading;
      const double c = std::cos(angle), s = std::sin(angle);
      const double along = ((c > 0.0 ? 6.0 : -4.0) - x) / c, across = (s > 0.0 ? 3.0 : -2.0) / s;
      scan.ranges.push_back(static_cast<std::uint16_t>(1000.0 * std::min(std::abs(along), std::abs(across))));
    }
    Node node;
    node.id = {SessionId{{RobotId("alpha"), SensorId("laser")}, 1}, i};
    node.map_from_node = spatial(compose(Pose2(2.0, 1.0, yaw_rad), Pose2(x, 0.0, heading)));
    node.payload = std::make_shared<const Payload>(std::move(scan));
    const NodeId id = node.id;
    map.nodes.set(id, std::move(node));
  }
  return map;
}

TEST(TeamFrame, finds_along_which_axes_walls_stand) {
  for (const double degrees : {-44.0, -12.4, 0.0, 0.3, 31.0, 44.5}) {
    const auto direction = direction_of_walls(room_at(degrees * kDegree_rad));
    ASSERT_TRUE(direction) << degrees;
    EXPECT_NEAR(*direction, degrees * kDegree_rad, 0.2 * kDegree_rad);
  }
  EXPECT_NEAR(std::remainder(*direction_of_walls(room_at(100.0 * kDegree_rad)) - 10.0 * kDegree_rad, M_PI / 2), 0.0,
              0.2 * kDegree_rad);
}

TEST(TeamFrame, knows_no_direction_of_walls_where_only_cameras_looked) {
  EXPECT_FALSE(direction_of_walls(test::RandomMaps(1).keyframe_map("alpha", 30)));
  EXPECT_FALSE(direction_of_walls(Map()));
}

TEST(TeamFrame, moves_all_that_is_in_it_and_nothing_else) {
  FusionResult result;
  result.components.resize(2);
  for (std::size_t i = 0; i < 2; ++i) {
    Component& component = result.components[i];
    component.map = room_at(0.1);
    component.members = {MapId(i == 0 ? "alpha" : "gamma")};
    component.team_from_map.set(component.members.front(), spatial(Pose2(1.0, 0.0, 0.0)));
  }
  PairAudit audit;
  audit.a = MapId("alpha");
  audit.b = MapId("beta");
  audit.conflicts.push_back({1.0, 2.0, 0.5});
  result.audits = {audit, audit};
  result.audits[1].is_ghost = true;  // in the frame of alpha's own map
  const FusionResult before = result;
  move_frame(result, 0, spatial(Pose2(10.0, -4.0, M_PI / 2)));
  const auto there = planar(result.components[0].map.nodes.front().second.map_from_node),
             expected = compose(Pose2(10.0, -4.0, M_PI / 2),
                                planar(before.components[0].map.nodes.front().second.map_from_node));
  EXPECT_NEAR(there.x, expected.x, 1e-12);
  EXPECT_NEAR(there.phi, expected.phi, 1e-12);
  EXPECT_NEAR(result.components[0].team_from_map.front().second.t.y(), -3.0, 1e-12);
  EXPECT_NEAR(result.audits[0].conflicts[0].x_m, 8.0, 1e-12);
  EXPECT_NEAR(result.audits[0].conflicts[0].y_m, -3.0, 1e-12);
  EXPECT_EQ(result.audits[1].conflicts[0].x_m, 1.0);
  EXPECT_EQ(result.components[1].map.nodes.front().second.map_from_node.t,
            before.components[1].map.nodes.front().second.map_from_node.t);
}

}  // namespace
}  // namespace mapweave::fusion
