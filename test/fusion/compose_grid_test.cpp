#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/fusion/compose_grid.h>
#include <support/random_map.h>
#include <support/simulated_maps.h>

#include <set>

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
