#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/fusion/growing_grid.h>
#include <support/random_map.h>
#include <support/simulated_maps.h>

#include <set>
#include <utility>

namespace mapweave::fusion {
namespace {

// One scan of a single ray along x that ends at 2.02 m.
Map one_ray(const Pose2& map_from_robot) {
  Map map;
  map.id = MapId("ray");
  auto geometry = std::make_shared<ScanGeometry>();
  geometry->ray_count = 2;
  geometry->angle_step_rad = 0.001;
  geometry->max_range_m = 20;
  const NodeId id{{{RobotId("ray"), SensorId("laser")}, 0}, 0};
  map.nodes.set(
      id, Node{id, {}, spatial(map_from_robot), std::make_shared<const Payload>(PackedScan{geometry, {2020, 0}})});
  return map;
}

std::int16_t value_at(const OccupancyGrid& grid, double x, double y) {
  const int column = static_cast<int>(std::floor((x - grid.origin_x_m) / grid.resolution_m)),
            row = static_cast<int>(std::floor((y - grid.origin_y_m) / grid.resolution_m));
  return grid.inside(column, row) ? grid.at(column, row) : OccupancyGrid::kUnknown;
}

TEST(ComposeGrid, draws_free_space_up_to_the_wall_and_nothing_behind) {
  WorkerPool pool(1);
  for (const double yaw : {0.0, 0.4, M_PI / 2, 2.5, -1.2}) {
    const Pose2 pose{0.51, -0.27, yaw};
    const OccupancyGrid grid = compose_grid(one_ray(pose), {}, pool);
    const auto at = [&](double range) {
      return value_at(grid, pose.x + range * std::cos(yaw), pose.y + range * std::sin(yaw));
    };
    EXPECT_GT(at(2.02), 0) << yaw;
    for (double range = 0.1; range < 1.9; range += 0.1) EXPECT_LT(at(range), 0) << yaw << " " << range;
    EXPECT_EQ(at(2.2), OccupancyGrid::kUnknown);
  }
}

TEST(ComposeGrid, touches_the_cells_of_a_ray_once_each) {
  WorkerPool pool(1);
  const OccupancyGrid grid = compose_grid(one_ray({0.0, 0.0, 0.35}), {}, pool);
  const auto lowest = *std::min_element(grid.log_odds.begin(), grid.log_odds.end());
  std::set<std::int16_t> values(grid.log_odds.begin(), grid.log_odds.end());
  EXPECT_EQ(values.size(), 3U);  // unknown, free once, wall once
  EXPECT_NEAR(probability(lowest), 0.4, 0.005);
}

TEST(ComposeGrid, is_the_same_for_any_number_of_threads) {
  simulation::TeamOptions options;
  options.robots = 1;
  options.length_m = 15.0;
  const auto team = simulation::make_apartment({}, options);
  const Map map = test::truth_map(team.robots[0], team.laser);
  WorkerPool one(1), four(4);
  const auto a = compose_grid(map, {}, one), b = compose_grid(map, {}, four);
  EXPECT_EQ(a.log_odds, b.log_odds);
  EXPECT_EQ(a.columns, b.columns);
}

TEST(ComposeGrid, draws_the_walls_of_the_plan) {
  simulation::TeamOptions options;
  options.robots = 1;
  const auto team = simulation::make_apartment({}, options);
  const Map map = test::truth_map(team.robots[0], team.laser);
  WorkerPool pool(1);
  const OccupancyGrid grid = compose_grid(map, {}, pool);
  // Where the robot drove there is no wall.
  std::size_t driven = 0;
  for (const auto& [id, node] : map.nodes)
    driven += value_at(grid, node.map_from_node.t.x(), node.map_from_node.t.y()) < 0;
  EXPECT_GT(static_cast<double>(driven), 0.97 * static_cast<double>(map.nodes.size()));
}

TEST(ComposeGrid, is_drawn_around_keyframes_as_if_they_were_not_there) {
  WorkerPool pool(1);
  Map map = one_ray({});
  const OccupancyGrid without = compose_grid(map, {}, pool);
  const Map keyframes = test::RandomMaps(1).keyframe_map("alpha", 12);
  for (const auto& [id, node] : keyframes.nodes) map.nodes.set(id, node);
  const OccupancyGrid with = compose_grid(map, {}, pool);
  EXPECT_EQ(with.log_odds, without.log_odds);
  EXPECT_EQ(with.columns, without.columns);
  EXPECT_TRUE(compose_grid(keyframes, {}, pool).empty());
}

// The share of cells that differ; 1 where the grids are not laid alike.
double difference_of(const OccupancyGrid& one, const OccupancyGrid& other) {
  if (one.columns != other.columns || one.rows != other.rows || one.resolution_m != other.resolution_m ||
      std::abs(one.origin_x_m - other.origin_x_m) > 1e-9 || std::abs(one.origin_y_m - other.origin_y_m) > 1e-9)
    return 1.0;
  std::size_t other_cells = 0;
  for (std::size_t i = 0; i < one.log_odds.size(); ++i) other_cells += one.log_odds[i] != other.log_odds[i] ? 1 : 0;
  return static_cast<double>(other_cells) / static_cast<double>(one.log_odds.size());
}

TEST(GrowingGrid, is_that_of_the_whole_map_however_it_grew) {
  simulation::TeamOptions options;
  options.robots = 1;
  const auto team = simulation::make_apartment({}, options);
  const Map map = test::truth_map(team.robots[0], team.laser);
  WorkerPool pool(1);
  GrowingGrid growing{{}};
  EXPECT_TRUE(growing.draw({}, pool).empty());
  Map so_far;
  std::size_t larger = 0, count = 0;
  std::int64_t cells = 0;
  for (const auto& [id, node] : map.nodes) {
    so_far.nodes.set(id, node);
    if (++count % 7 != 0 && count != map.nodes.size()) continue;
    const OccupancyGrid& grid = growing.draw(so_far, pool);
    const std::int64_t now = std::int64_t{grid.columns} * grid.rows;
    larger += now > std::exchange(cells, now) ? 1 : 0;
  }
  EXPECT_GT(larger, 3U);
  // A ray that ends on the border between two cells may end in the other one, for cells are counted from the corner.
  EXPECT_LT(difference_of(growing.draw(map, pool), compose_grid(map, {}, pool)), 1e-3);
  Map moved = map;
  for (auto& [id, node] : moved.nodes) node.map_from_node.t.x() += 0.01;
  const OccupancyGrid before = growing.draw(map, pool);
  EXPECT_EQ(difference_of(growing.draw(moved, pool), before), 0.0) << "too little to be drawn anew";
  moved.nodes.find(moved.nodes.front().first)->map_from_node.t.x() += 0.05;
  EXPECT_EQ(difference_of(growing.draw(moved, pool), compose_grid(moved, {}, pool)), 0.0);
  EXPECT_EQ(difference_of(growing.draw(one_ray({}), pool), compose_grid(one_ray({}), {}, pool)), 0.0) << "another map";
}

TEST(GrowingGrid, goes_on_after_what_cannot_be_drawn) {
  WorkerPool pool(1);
  GrowingGrid growing{{}};
  Map map = one_ray({});
  growing.draw(map, pool);
  const NodeId far{map.nodes.front().first.session, 1};
  map.nodes.set(far, Node{far, {}, spatial(Pose2{5000.0, 0, 0}), map.nodes.front().second.payload});
  EXPECT_THROW(growing.draw(map, pool), Error);
  map.nodes.find(far)->map_from_node = spatial(Pose2{1.0, 0, 0});
  EXPECT_EQ(difference_of(growing.draw(map, pool), compose_grid(map, {}, pool)), 0.0);
}

TEST(ComposeGrid, is_empty_for_nothing_and_refuses_a_runaway) {
  WorkerPool pool(1);
  EXPECT_TRUE(compose_grid({}, {}, pool).empty());
  Map map = one_ray({});
  const NodeId far{map.nodes.front().first.session, 1};
  map.nodes.set(far, Node{far, {}, spatial(Pose2{5000.0, 0, 0}), map.nodes.front().second.payload});
  EXPECT_THROW(compose_grid(map, {}, pool), Error);
}

}  // namespace
}  // namespace mapweave::fusion
