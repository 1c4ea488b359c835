// Maps as messages, compared with what is written to files.
#include <exporters/small_map.h>
#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/exporters/session_trajectories.h>
#include <mapweave/runtime/live_status.h>
#include <ros/names.h>
#include <ros_messages.h>
#include <ros_names.h>
#include <nlohmann/json.hpp>

#include <cstring>
#include <limits>

namespace mapweave::ros_nodes {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using test::add_pose;
using test::cross_scan;
using test::drawn_grid;
using test::node_id;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using Json = nlohmann::ordered_json;

const OccupancyGrid kCorner = drawn_grid({"####",  //
                                          "#.. ",  //
                                          "#.  "},
                                         0.1, -3.2, 1.7);

Pose3 pose(double x, double y, double phi = 0.0) { return spatial(Pose2(x, y, phi)); }

// The pixels that map_saver of ROS writes (map_server/src/map_saver.cpp, thresholds 25 and 65).
std::string saved_pixels(const nav_msgs::OccupancyGrid& grid) {
  std::string pixels;
  for (std::uint32_t y = 0; y < grid.info.height; ++y)
    for (std::uint32_t x = 0; x < grid.info.width; ++x) {
      const int cell = grid.data[x + (grid.info.height - y - 1) * grid.info.width];
      pixels += static_cast<char>(cell >= 0 && cell <= 25 ? 254 : cell >= 65 ? 0 : 205);
    }
  return pixels;
}

TEST(RosMessages, a_grid_has_the_cells_of_the_exported_map) {
  const nav_msgs::OccupancyGrid message = grid_message(kCorner, "alpha/map");
  const std::string pgm = exporters::pgm_bytes(kCorner);
  const std::string pixels = saved_pixels(message);
  ASSERT_EQ(pixels.size(), 12u);
  EXPECT_EQ(pixels, pgm.substr(pgm.size() - pixels.size()));
  EXPECT_THAT(message.data, ElementsAre(100, 0, -1, -1, 100, 0, 0, -1, 100, 100, 100, 100));
  EXPECT_EQ(message.header.frame_id, "alpha/map");
  EXPECT_EQ(message.info.width, 4u);
  EXPECT_EQ(message.info.height, 3u);
  EXPECT_EQ(message.info.resolution, 0.1f);
  EXPECT_EQ(message.info.origin.position.x, -3.2);
  EXPECT_EQ(message.info.origin.position.y, 1.7);
  EXPECT_EQ(message.info.origin.orientation.w, 1.0);
}

nav_msgs::OccupancyGrid message_of(const std::vector<std::string>& rows) { return grid_message(drawn_grid(rows), "m"); }

TEST(RosMessages, an_update_is_the_smallest_rectangle_that_changed) {
  nav_msgs::OccupancyGrid before = message_of({"     ",  //
                                               " ... ",  //
                                               " ... ",  //
                                               "     "});
  const nav_msgs::OccupancyGrid now = message_of({"     ",  //
                                                  " ..# ",  //
                                                  "  .. ",  //
                                                  "     "});
  const auto update = grid_update(before, now);
  ASSERT_TRUE(update);
  EXPECT_EQ(update->header.frame_id, "m");
  EXPECT_EQ(update->x, 1);
  EXPECT_EQ(update->y, 1);
  EXPECT_EQ(update->width, 3u);
  EXPECT_EQ(update->height, 2u);
  // As RViz and costmap_2d apply it.
  for (std::uint32_t y = 0, i = 0; y < update->height; ++y)
    for (std::uint32_t x = 0; x < update->width; ++x)
      before.data[(static_cast<std::uint32_t>(update->y) + y) * before.info.width +
                  static_cast<std::uint32_t>(update->x) + x] = update->data[i++];
  EXPECT_EQ(before.data, now.data);
}

TEST(RosMessages, one_changed_cell_at_an_edge_is_an_update_of_one_cell) {
  const auto first = grid_update(message_of({"..", ".."}), message_of({"..", "#."}));
  ASSERT_TRUE(first);
  EXPECT_THAT((std::array{first->x, first->y}), ElementsAre(0, 0));
  EXPECT_THAT(first->data, ElementsAre(100));
  const auto last = grid_update(message_of({"..", ".."}), message_of({". ", ".."}));
  ASSERT_TRUE(last);
  EXPECT_THAT((std::array{last->x, last->y}), ElementsAre(1, 1));
  EXPECT_THAT(last->data, ElementsAre(-1));
}

TEST(RosMessages, there_is_no_update_between_grids_of_other_size_place_or_frame) {
  const nav_msgs::OccupancyGrid grid = message_of({".#"});
  OccupancyGrid moved = drawn_grid({".#"});
  moved.origin_x_m = 0.05;
  EXPECT_FALSE(grid_update(grid, grid_message(moved, "m")));
  EXPECT_FALSE(grid_update(grid, message_of({".#", ".#"})));
  EXPECT_FALSE(grid_update(grid, grid_message(drawn_grid({".#"}), "n")));
  EXPECT_FALSE(grid_update(grid, grid_message(drawn_grid({".#"}, 0.1), "m")));
  OccupancyGrid surer = drawn_grid({".#"});
  surer.log_odds = {-300, 300};
  const auto update = grid_update(grid, grid_message(surer, "m"));
  ASSERT_TRUE(update);
  EXPECT_EQ(update->width, 0u) << "surer of the same cells";
  EXPECT_THAT(update->data, IsEmpty());
}

TEST(RosMessages, a_path_has_a_robot_s_nodes_by_stamp) {
  Map map;
  add_pose(map, node_id("alpha", 0, 9), 3'500'000'000, pose(3, 0));
  add_pose(map, node_id("alpha", 0, 7), 5'000'000'000, pose(5, 0));
  add_pose(map, node_id("alpha", 1, 7), 2'000'000'001, pose(2, 1, M_PI / 2));
  add_pose(map, node_id("beta", 0), 1'000'000'000, pose(9, 9));
  const nav_msgs::Path path = path_message(exporters::robot_trajectories(map).at(RobotId("alpha")), "alpha/map");
  std::vector<double> x;
  for (const auto& one : path.poses) x.push_back(one.pose.position.x);
  EXPECT_THAT(x, ElementsAre(2.0, 3.0, 5.0));
  EXPECT_EQ(path.header.frame_id, "alpha/map");
  EXPECT_EQ(path.poses[0].header.frame_id, "alpha/map");
  EXPECT_EQ(path.poses[0].header.stamp, ros::Time(2, 1));
  EXPECT_EQ(path.poses[0].pose.position.y, 1.0);
  EXPECT_NEAR(path.poses[0].pose.orientation.z, std::sqrt(0.5), 1e-12);
}

TEST(RosMessages, a_stamp_that_ros_cannot_hold_is_said) {
  EXPECT_EQ(stamp_of(ros_time({1'700'000'000'123'456'789})), (Stamp{1'700'000'000'123'456'789}));
  EXPECT_THROW(ros_time({-1}), Error);
  EXPECT_THROW(ros_time({std::int64_t{1} << 62}), Error);
}

TEST(RosMessages, poses_from_outside_are_checked) {
  const Pose3 given = pose(1.0, -2.0, 0.7);
  const auto same = pose_of(pose_message(given));
  ASSERT_TRUE(same);
  EXPECT_EQ(same->t, given.t);
  EXPECT_LT(same->q.angularDistance(given.q), 1e-12);
  geometry_msgs::Pose message = pose_message(given);
  message.position.z = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(pose_of(message));
  EXPECT_FALSE(pose_of(geometry_msgs::Pose())) << "a quaternion of zeros is no rotation";
  geometry_msgs::Transform transform = transform_message(given);
  transform.rotation.w = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(pose_of(transform));
}

TEST(RosMessages, a_cloud_has_the_points_of_the_exported_one) {
  const std::vector<exporters::ColouredPoint> points = {{{1.0f, 2.0f, 3.0f}, 0x102030},
                                                        {{-1.5f, 0.0f, 0.25f}, 0xffffff}};
  const sensor_msgs::PointCloud2 cloud = cloud_message(points, "team");
  EXPECT_EQ(cloud.header.frame_id, "team");
  EXPECT_EQ(cloud.width * cloud.height, 2u);
  ASSERT_EQ(cloud.data.size(), cloud.row_step * cloud.height);
  std::vector<std::string> names;
  for (const auto& field : cloud.fields) {
    names.push_back(field.name + "@" + std::to_string(field.offset));
    EXPECT_EQ(field.datatype, sensor_msgs::PointField::FLOAT32);
  }
  EXPECT_THAT(names, ElementsAre("x@0", "y@4", "z@8", "rgb@12"));
  std::array<float, 3> second{};
  std::memcpy(second.data(), cloud.data.data() + cloud.point_step, sizeof second);
  EXPECT_THAT(second, ElementsAre(-1.5f, 0.0f, 0.25f));
  std::uint32_t rgb = 0;
  std::memcpy(&rgb, cloud.data.data() + 12, sizeof rgb);
  EXPECT_EQ(rgb, 0x102030u);
}

Constraint constraint(ConstraintKind kind, const NodeId& from, const NodeId& to) {
  return planar_constraint({kind, from, to, 0}, Pose2(), Eigen::Matrix3d::Identity());
}

TEST(RosMessages, a_graph_shows_each_kind_of_constraint_by_itself) {
  Map map;
  for (std::uint32_t i = 0; i < 3; ++i) add_pose(map, node_id("alpha", i), i, pose(i, 0));
  for (std::uint32_t i = 0; i < 2; ++i) add_pose(map, node_id("beta", i), i, pose(i, 5));
  for (const Constraint& one : {constraint(ConstraintKind::odometry, node_id("alpha", 0), node_id("alpha", 1)),
                                constraint(ConstraintKind::scan_match, node_id("alpha", 1), node_id("alpha", 2)),
                                constraint(ConstraintKind::loop, node_id("alpha", 0), node_id("alpha", 2)),
                                constraint(ConstraintKind::loop, node_id("alpha", 0), node_id("beta", 0)),
                                constraint(ConstraintKind::between_maps, node_id("beta", 1), node_id("alpha", 2)),
                                constraint(ConstraintKind::odometry, node_id("beta", 0), node_id("beta", 8))})
    map.constraints.set(one.id, one);
  std::map<std::string, visualization_msgs::Marker> markers;
  for (const auto& marker : graph_message(map, "team").markers) {
    EXPECT_EQ(marker.id, 0);
    EXPECT_EQ(marker.header.frame_id, "team");
    EXPECT_TRUE(markers.emplace(marker.ns, marker).second);
  }
  std::map<std::string, std::size_t> points;
  for (const auto& [name, marker] : markers) points[name] = marker.points.size();
  EXPECT_EQ(points, (std::map<std::string, std::size_t>{{"nodes", 5},
                                                        {"trajectories", 6},
                                                        {"odometry", 2},
                                                        {"scan_matches", 2},
                                                        {"extrinsics", 0},
                                                        {"loops", 2},
                                                        {"between_maps", 4}}))
      << "a constraint of a node that is not there is left out";
  EXPECT_EQ(markers["extrinsics"].action, visualization_msgs::Marker::DELETE);
  EXPECT_EQ(markers["loops"].action, visualization_msgs::Marker::ADD);
  EXPECT_EQ(markers["loops"].points[1].x, 2.0);
  ASSERT_EQ(markers["nodes"].colors.size(), 5u);
  EXPECT_EQ(markers["nodes"].colors[0], markers["nodes"].colors[2]);
  EXPECT_FALSE(markers["nodes"].colors[0] == markers["nodes"].colors[3]) << "robots have colours of their own";
  EXPECT_FALSE(markers["loops"].color == markers["between_maps"].color);
}

std::map<std::string, std::string> values_of(const DiagnosticStatus& status) {
  std::map<std::string, std::string> values;
  for (const auto& value : status.values) values[value.key] = value.value;
  return values;
}

TEST(RosMessages, diagnostics_have_the_worst_finding_of_each_tier) {
  constexpr runtime::StatusTerms kLongUp{15.0, 100.0};
  runtime::LiveEdgeCounts good;
  good.previews = 3;
  good.is_cloud_on_wire = true;
  good.cloud_silent_s = 1.0;
  runtime::LiveEdgeCounts warned = good, broken = good;
  warned.refused = 2;
  broken.refused = 2;
  broken.trouble = "disk full";
  Json status = runtime::program_status(
      "demo", "hall",
      {tier_status(TierId("north"), good, kLongUp), tier_status(TierId("south"), warned, kLongUp),
       tier_status(TierId("west"), broken, kLongUp), tier_status(runtime::LiveCloudCounts{}, kLongUp)},
      kLongUp);
  const auto message = diagnostics_message(status);
  ASSERT_EQ(message.status.size(), 4u);
  EXPECT_EQ(message.status[0].level, DiagnosticStatus::OK);
  EXPECT_EQ(message.status[0].name, "mapweave: edge north");
  EXPECT_EQ(message.status[0].message, "mapping");
  EXPECT_EQ(message.status[0].hardware_id, "hall");
  EXPECT_EQ(values_of(message.status[0])["previews"], "3");
  EXPECT_EQ(values_of(message.status[0])["cloud cloud: silent_seconds"], "1.0");
  EXPECT_EQ(message.status[1].level, DiagnosticStatus::WARN);
  EXPECT_THAT(message.status[1].message, HasSubstr("refused 2 times"));
  EXPECT_EQ(message.status[2].level, DiagnosticStatus::ERROR);
  EXPECT_EQ(message.status[2].message, "disk full");
  EXPECT_THAT(values_of(message.status[2])["warning"], HasSubstr("refused 2 times"));
  EXPECT_EQ(message.status[3].name, "mapweave: cloud");
}

TEST(RosMessages, what_says_nothing_readable_is_stale) {
  for (const char* text : {"null", "[]", "{\"tiers\": []}", "{\"tiers\": 7, \"name\": 3}"}) {
    const auto message = diagnostics_message(Json::parse(text));
    ASSERT_EQ(message.status.size(), 1u) << text;
    EXPECT_EQ(message.status[0].level, DiagnosticStatus::STALE) << text;
  }
  const auto message = diagnostics_message(Json::parse(
      R"({"tiers": [5, {"role": "edge", "name": "north", "state": "mapping", "links": 3, "findings": "x"}]})"));
  ASSERT_EQ(message.status.size(), 2u);
  EXPECT_EQ(message.status[0].level, DiagnosticStatus::STALE);
  EXPECT_EQ(message.status[1].name, "mapweave: edge north");
}

TEST(RosNames, ids_become_names_that_ros_allows_and_that_differ) {
  const RosNames names({"robot-1.a", "robot_1_a", "7", "tb3_0", "_x"});
  EXPECT_EQ(names.of("robot_1_a"), "robot_1_a") << "what is a name stays";
  EXPECT_EQ(names.of("robot-1.a"), "robot_1_a_2");
  EXPECT_EQ(names.of("7"), "r7");
  EXPECT_EQ(names.of("tb3_0"), "tb3_0");
  EXPECT_EQ(names.of("_x"), "r_x");
  EXPECT_EQ(names.of("never-given"), "never_given");
  for (const char* id : {"robot-1.a", "7", "_x"}) {
    std::string error;
    EXPECT_TRUE(ros::names::validate(names.of(id), error)) << error;
  }
}

}  // namespace
}  // namespace mapweave::ros_nodes
