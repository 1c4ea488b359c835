#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/matching/submap_model.h>
#include <support/pose_matchers.h>
#include <support/simulated_maps.h>

namespace mapweave::laser {
namespace {

using test::error_m;
using test::mapped;

simulation::TeamOptions alone(double length_m) {
  simulation::TeamOptions options;
  options.robots = 1;
  options.length_m = length_m;
  return options;
}

TEST(GraphMapper, maps_an_apartment_within_centimetres) {
  const auto team = simulation::make_apartment({}, alone(40.0));
  const Map map = mapped(team.robots[0], team.laser);
  ASSERT_EQ(map.nodes.size(), team.robots[0].steps.size());
  EXPECT_LT(error_m(map, team.robots[0]), 0.02);
}

TEST(GraphMapper, closes_a_loop) {
  const auto team = simulation::make_ring({}, alone(140.0));
  const Map map = mapped(team.robots[0], team.laser);
  const auto loops = std::count_if(map.constraints.begin(), map.constraints.end(),
                                   [](const auto& entry) { return entry.first.kind == ConstraintKind::loop; });
  EXPECT_GT(loops, 0);
  EXPECT_LT(error_m(map, team.robots[0]), 0.04);
}

TEST(GraphMapper, says_where_each_scan_was_when_it_came) {
  const auto team = simulation::make_ring({}, alone(90.0));
  const auto& robot = team.robots[0];
  const auto geometry = test::scan_geometry(team.laser);
  GraphMapper mapper({robot.id, SensorId("laser")}, {});
  std::size_t count = 0;
  for (const auto& step : robot.steps) {
    mapper.add(OdometryInput{step.stamp, spatial(step.odometry_from_robot)});
    mapper.add(ScanInput{step.stamp, test::packed(step.ranges, geometry)});
    for (const LivePose& pose : mapper.take_live_poses()) {
      ASSERT_EQ(pose.stamp, step.stamp);
      if (++count % 60 == 0) {
        const Map so_far = mapper.snapshot();
        EXPECT_LT((so_far.nodes.back().second.map_from_node.t - pose.map_from_robot.t).norm(), 1e-9);
      }
    }
  }
  EXPECT_EQ(count, robot.steps.size());
  EXPECT_TRUE(mapper.take_live_poses().empty());
}

TEST(GraphMapper, works_without_odometry) {
  const auto team = simulation::make_apartment({}, alone(20.0));
  EXPECT_LT(error_m(mapped(team.robots[0], team.laser, false), team.robots[0]), 0.10);
}

TEST(GraphMapper, gets_over_a_first_scan_that_saw_nothing) {
  auto team = simulation::make_apartment({}, alone(15.0));
  auto& robot = team.robots[0];
  robot.steps.front().ranges.assign(robot.steps.front().ranges.size(), 0.0F);
  const Map map = mapped(robot, team.laser, false);
  EXPECT_GT(map.submaps.size(), 0U);
  EXPECT_LT(error_m(map, robot), 0.3);
}

TEST(GraphMapper, begins_a_new_piece_of_map_where_nothing_fits_and_there_is_no_odometry) {
  const auto team = simulation::make_apartment({}, alone(25.0));
  auto robot = team.robots[0];
  // Carried off in the middle: what the laser sees next fits nothing.
  const auto away = simulation::make_ring({}, alone(20.0));
  robot.steps.resize(robot.steps.size() / 2);
  Stamp stamp = robot.steps.back().stamp;
  for (auto step : away.robots[0].steps) {
    stamp.ns += 200000000;
    step.stamp = stamp;
    robot.steps.push_back(step);
  }
  const Map map = mapped(robot, team.laser, false);
  const auto carried = static_cast<std::uint32_t>(team.robots[0].steps.size() / 2);
  std::size_t after = 0;
  for (const auto& [id, submap] : map.submaps) after += submap.anchor().index > carried;
  EXPECT_GT(after, 1U) << "the second place has submaps of its own";
}

TEST(GraphMapper, gets_over_wheels_that_miss_turns) {
  auto options = alone(30.0);
  options.odometry.slips_per_100_m = 20.0;
  options.odometry.slip_min_deg = 5.0;
  options.odometry.slip_max_deg = 10.0;
  const auto team = simulation::make_apartment({}, options);
  EXPECT_LT(error_m(mapped(team.robots[0], team.laser), team.robots[0]), 0.02);
}

TEST(GraphMapper, holds_on_to_odometry_along_a_bare_corridor) {
  simulation::CorridorOptions corridor;
  corridor.doors = 0;
  corridor.clutter = 0;
  corridor.length_m = 40.0;
  auto options = alone(25.0);
  options.laser.max_range_m = 8.0;
  options.odometry.slips_per_100_m = 0.0;
  const auto team = simulation::make_corridor(corridor, options);
  EXPECT_LT(error_m(mapped(team.robots[0], team.laser), team.robots[0]), 0.8);
}

TEST(GraphMapper, gives_the_same_bytes_twice) {
  const auto team = simulation::make_apartment({}, alone(15.0));
  MapUpdate one = difference({}, mapped(team.robots[0], team.laser)),
            two = difference({}, mapped(team.robots[0], team.laser));
  one.origin = two.origin = {TierId("edge"), MapId("robot0")};
  one.sequence = two.sequence = 1;
  EXPECT_EQ(encode(one), encode(two));
}

TEST(GraphMapper, freezes_submaps_that_overlap_by_half) {
  const auto team = simulation::make_apartment({}, alone(30.0));
  const Map map = mapped(team.robots[0], team.laser);
  ASSERT_GT(map.submaps.size(), 4U);
  const Submap* last = nullptr;
  for (const auto& [id, submap] : map.submaps) {
    EXPECT_TRUE(submap.frozen);
    EXPECT_EQ(submap.content, content_hash(submap, map.nodes));
    if (last != nullptr) {
      EXPECT_TRUE(std::any_of(last->submap_from_node.begin(), last->submap_from_node.end(),
                              [&](const auto& member) { return member.first == submap.anchor(); }));
    }
    last = &submap;
  }
}

TEST(GraphMapper, takes_scans_that_see_nothing_and_a_log_of_nothing) {
  GraphMapper empty({RobotId("nobody"), SensorId("laser")}, {});
  empty.finish();
  EXPECT_TRUE(empty.snapshot().empty());

  auto geometry = std::make_shared<ScanGeometry>();
  geometry->ray_count = 90;
  geometry->angle_step_rad = 0.03;
  geometry->max_range_m = 20;
  GraphMapper blind({RobotId("blind"), SensorId("laser")}, {});
  for (int i = 0; i < 50; ++i) {
    blind.add(OdometryInput{stamp_from_seconds(i), spatial(Pose2{0.2 * i, 0, 0})});
    blind.add(ScanInput{stamp_from_seconds(i), {geometry, std::vector<std::uint16_t>(90, 0)}});
  }
  blind.finish();
  const Map map = blind.snapshot();
  ASSERT_EQ(map.nodes.size(), 50U);
  // Nothing seen: the wheels are all there is.
  EXPECT_THAT(planar(map.nodes.back().second.map_from_node), test::IsNear(Pose2{0.2 * 49, 0, 0}, 0.01, 0.01));
  EXPECT_THROW(blind.finish(), ContractViolation);
}

TEST(GraphMapper, shows_its_map_while_it_works) {
  const auto team = simulation::make_apartment({}, alone(12.0));
  const auto geometry = test::scan_geometry(team.laser);
  GraphMapper mapper({RobotId("alpha"), SensorId("laser")}, {});
  std::size_t added = 0;
  for (const auto& step : team.robots[0].steps) {
    mapper.add(ScanInput{step.stamp, test::packed(step.ranges, geometry)});
    if (++added % 20 == 0) {
      EXPECT_EQ(mapper.snapshot().nodes.size(), added);
    }
  }
}

}  // namespace
}  // namespace mapweave::laser
