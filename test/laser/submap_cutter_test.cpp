#include <mapweave/core/error.h>
#include <mapweave/laser/submap_cutter.h>
#include <support/pose_matchers.h>

#include <limits>
#include <set>

namespace mapweave::laser {
namespace {

using mapweave::test::IsNear;

const SessionId kSession{{RobotId("alpha"), SensorId("laser")}, 5};

PackedScan some_scan(std::uint16_t range = 2000, std::uint32_t returns = 20) {
  auto geometry = std::make_shared<ScanGeometry>();
  geometry->angle_step_rad = 0.1;
  geometry->ray_count = 20;
  geometry->max_range_m = 30.0;
  PackedScan scan{geometry, std::vector<std::uint16_t>(20, 0)};
  std::fill_n(scan.ranges.begin(), returns, range);
  return scan;
}

// Straight ahead, `step_m` a scan, from anywhere.
std::vector<TrackedScan> straight(int scans, double step_m) {
  std::vector<TrackedScan> tracked;
  for (int i = 0; i < scans; ++i)
    tracked.push_back({Stamp{1000 * i},
                       some_scan(static_cast<std::uint16_t>(2000 + i)),
                       {4.0, 2.0 + i * step_m, M_PI / 2},
                       Pose2{i == 0 ? 0.0 : step_m, 0.0, 0.0}});
  return tracked;
}

Map cut(std::vector<TrackedScan> scans, const SubmapCutterOptions& options = {}) {
  return cut_into_submaps(MapId("alpha"), kSession, std::move(scans), options);
}

TEST(SubmapCutter, starts_the_map_at_the_first_scan) {
  const Map map = cut(straight(3, 0.5));
  EXPECT_THAT(planar(map.nodes.begin()->second.map_from_node), IsNear(Pose2{0, 0, 0}, 1e-9, 1e-9));
  EXPECT_THAT(planar(map.nodes.back().second.map_from_node), IsNear(Pose2{1.0, 0, 0}, 1e-9, 1e-9));
}

TEST(SubmapCutter, makes_a_node_of_every_scan_and_content_of_those_that_moved) {
  const Map map = cut(straight(100, 0.03));
  ASSERT_EQ(map.nodes.size(), 100u);
  int content = 0;
  for (const auto& [id, node] : map.nodes) {
    EXPECT_EQ(node.stamp.ns, 1000 * id.index);
    content += node.payload != nullptr;
  }
  EXPECT_EQ(content, 25);  // every 0.12 m: the first multiple of 0.03 past 0.1
}

TEST(SubmapCutter, closes_submaps_after_seven_metres_half_overlapping) {
  const Map map = cut(straight(211, 0.1));  // 21 m
  ASSERT_EQ(map.submaps.size(), 5u);
  std::vector<std::pair<double, double>> paths;
  for (const auto& [id, submap] : map.submaps) {
    ASSERT_FALSE(submap.submap_from_node.empty());
    const auto x = [&](const NodeId& node) { return map.nodes.find(node)->map_from_node.t.x(); };
    paths.emplace_back(x(submap.submap_from_node.front().first), x(submap.submap_from_node.back().first));
  }
  for (std::size_t i = 0; i < paths.size(); ++i) {
    EXPECT_NEAR(paths[i].first, 3.5 * static_cast<double>(i), 0.25 * static_cast<double>(i + 1));
    if (i + 1 < paths.size()) {
      EXPECT_NEAR(paths[i].second - paths[i].first, 7.0, 0.25);
    }
  }
  EXPECT_NEAR(paths.back().second, 21.0, 0.25);
}

TEST(SubmapCutter, leaves_no_content_outside_submaps) {
  for (const int scans : {1, 2, 40, 71, 72, 140}) {
    const Map map = cut(straight(scans, 0.15));
    std::set<NodeId> held;
    for (const auto& [id, submap] : map.submaps)
      for (const auto& [node, pose] : submap.submap_from_node) held.insert(node);
    for (const auto& [id, node] : map.nodes)
      EXPECT_EQ(node.payload != nullptr, held.count(id) == 1) << scans << " scans, " << to_string(id);
  }
}

TEST(SubmapCutter, freezes_submaps_whose_frame_is_their_first_node) {
  const Map map = cut(straight(211, 0.1));
  for (const auto& [id, submap] : map.submaps) {
    EXPECT_TRUE(submap.frozen);
    EXPECT_EQ(submap.content, content_hash(submap, map.nodes));
    const Pose2 map_from_submap = planar(map.nodes.find(submap.anchor())->map_from_node);
    for (const auto& [node, submap_from_node] : submap.submap_from_node)
      EXPECT_THAT(compose(map_from_submap, planar(submap_from_node)),
                  IsNear(planar(map.nodes.find(node)->map_from_node), 1e-9, 1e-9));
  }
}

TEST(SubmapCutter, constrains_neighbours_by_matching_and_by_wheels_where_they_measured) {
  auto scans = straight(10, 0.2);
  scans[4].previous_from_this.reset();
  const Map map = cut(std::move(scans));
  int matched = 0, measured = 0;
  for (const auto& [id, constraint] : map.constraints) {
    EXPECT_EQ(id.from.index + 1, id.to.index);
    EXPECT_THAT(planar(constraint.from_from_to.pose), IsNear(Pose2{0.2, 0, 0}, 1e-9, 1e-9));
    (id.kind == ConstraintKind::odometry ? measured : matched) += 1;
  }
  EXPECT_EQ(matched, 9);
  EXPECT_EQ(measured, 8);
}

TEST(SubmapCutter, trusts_a_path_alike_whether_it_has_few_nodes_or_many) {
  const auto variance_along = [](const Map& map) {
    double sum = 0.0;
    for (const auto& [id, constraint] : map.constraints)
      if (id.kind == ConstraintKind::scan_match) sum += 1.0 / planar(constraint.information)(0, 0);
    return sum;
  };
  const double dense = variance_along(cut(straight(41, 0.1))), sparse = variance_along(cut(straight(5, 1.0)));
  EXPECT_NEAR(dense / sparse, 1.0, 0.15);
}

TEST(SubmapCutter, takes_no_content_from_scans_that_saw_nothing) {
  std::vector<TrackedScan> scans = straight(20, 0.5);
  for (int i = 0; i < 5; ++i) scans[static_cast<std::size_t>(i)].scan = some_scan(2000, 3);
  const Map map = cut(std::move(scans));
  EXPECT_EQ(map.nodes.size(), 20u);
  EXPECT_EQ(map.submaps.begin()->second.anchor().index, 5u);
}

TEST(SubmapCutter, makes_an_empty_map_of_no_scans) {
  const Map map = cut({});
  EXPECT_TRUE(map.empty());
  EXPECT_TRUE(map.submaps.empty());
  EXPECT_EQ(map.id, MapId("alpha"));
}

TEST(SubmapCutter, refuses_a_pose_that_is_no_number) {
  auto scans = straight(3, 0.5);
  scans[1].map_from_robot.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(cut(std::move(scans)), ContractViolation);
}

}  // namespace
}  // namespace mapweave::laser
