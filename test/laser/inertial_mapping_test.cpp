// How the engine `graph` uses an inertial unit.
#include <gtest/gtest.h>
#include <support/simulated_maps.h>

namespace mapweave::laser {
namespace {

using test::error_m;
using test::swept_geometry;

// A robot that turns fast on wheels that slip.
simulation::SimulatedTeam slipping_team(double sweep_s, std::int64_t seed = 7) {
  simulation::TeamOptions options;
  options.robots = 1;
  options.length_m = 30.0;
  options.seed = seed;
  options.motion.turn_rate_deg_per_s = 120.0;
  options.laser.rays = 121;
  options.laser.field_of_view_deg = 240.0;
  options.laser.max_range_m = 8.0;
  options.laser.sweep_s = sweep_s;
  options.laser.sweep_stamp = 0.5;
  options.odometry.slips_per_100_m = 40.0;
  options.odometry.slip_min_deg = 10.0;
  options.odometry.slip_max_deg = 20.0;
  return simulation::make_apartment({}, options);
}

struct Unit {
  double scale = 1.0, bias_rad_s = 0.01;
  bool exists = true;
};

struct InertialRun {
  Map map;
  std::vector<std::string> notes;
};

InertialRun mapped_with(const simulation::SimulatedTeam& team, const Unit& unit, bool with_odometry = true) {
  const auto& robot = team.robots[0];
  const auto geometry = swept_geometry(team.laser);
  GraphMapper mapper({robot.id, SensorId("laser")}, {});
  double yaw_rad = 0.0;
  for (std::size_t i = 0; i < robot.steps.size(); ++i) {
    const auto& step = robot.steps[i];
    if (i > 0) yaw_rad += wrap_angle(step.world_from_robot.phi - robot.steps[i - 1].world_from_robot.phi);
    const double seconds = seconds_between(robot.steps.front().stamp, step.stamp);
    if (with_odometry) mapper.add(OdometryInput{step.stamp, spatial(step.odometry_from_robot)});
    if (unit.exists) mapper.add(InertialInput{step.stamp, unit.scale * (yaw_rad + unit.bias_rad_s * seconds)});
    mapper.add(ScanInput{step.stamp, test::packed(step.ranges, geometry)});
  }
  mapper.finish();
  return {mapper.snapshot(), mapper.notes()};
}

TEST(GraphMapper, believes_the_inertial_unit_of_turns_that_the_wheels_miss) {
  const auto team = slipping_team(0.1);
  const InertialRun with = mapped_with(team, {});
  EXPECT_LT(error_m(with.map, team.robots[0]), 0.02);
  EXPECT_TRUE(with.notes.empty());
}

TEST(GraphMapper, maps_each_scan_whether_or_not_it_waits_for_the_inertial_unit) {
  const auto team = slipping_team(0.0);
  ASSERT_EQ(mapped_with(team, {}).map.nodes.size(), team.robots[0].steps.size());
}

TEST(GraphMapper, turns_by_the_inertial_unit_without_wheels) {
  const auto team = slipping_team(0.0);
  EXPECT_LT(error_m(mapped_with(team, {}, false).map, team.robots[0]), 0.05);
}

TEST(GraphMapper, finds_out_what_is_wrong_with_an_inertial_unit) {
  const auto team = slipping_team(0.0);
  const double without = error_m(mapped_with(team, {1.0, 0.0, false}).map, team.robots[0]);
  const auto check = [&](double scale, const std::string& expected) {
    const InertialRun run = mapped_with(team, {scale, 0.01, true});
    ASSERT_EQ(run.notes.size(), 1U) << scale;
    EXPECT_NE(run.notes.front().find(expected), std::string::npos) << scale << ": " << run.notes.front();
    EXPECT_LT(error_m(run.map, team.robots[0]), without + 0.01) << "a wrong unit does no harm, scale " << scale;
  };
  check(0.0, "dead");
  check(-1.0, "upside down");
  check(57.29578, "degrees");
}

TEST(GraphMapper, says_nothing_of_an_inertial_unit_where_there_is_none) {
  EXPECT_TRUE(mapped_with(slipping_team(0.0), {1.0, 0.0, false}).notes.empty());
}

}  // namespace
}  // namespace mapweave::laser
