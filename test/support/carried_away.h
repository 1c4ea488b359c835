#pragma once
// A robot that was carried elsewhere while it mapped, and whose map does not know it: right at first, then of another
// building.

#include <mapweave/simulation/tiny_worlds.h>
#include <support/simulated_maps.h>

#include <algorithm>
#include <vector>

namespace mapweave::test {

// Its steps until it first was east of `x_m`.
inline simulation::SimulatedRobot until_east_of(simulation::SimulatedRobot robot, double x_m) {
  const auto end = std::find_if(robot.steps.begin(), robot.steps.end(),
                                [&](const simulation::SimulatedStep& step) { return step.world_from_robot.x > x_m; });
  robot.steps.erase(end, robot.steps.end());
  return robot;
}

// What `carried` saw, then what `stranger` saw in its first steps, with the corner of its building at (x_m, 0).
inline Map carried_away(simulation::SimulatedRobot carried, double x_m, const simulation::SimulatedRobot& stranger,
                        std::size_t steps, const simulation::SimulatedLaserOptions& laser) {
  const std::int64_t later_ns = carried.steps.back().stamp.ns - stranger.steps.front().stamp.ns;
  for (std::size_t i = 1; i < std::min(steps, stranger.steps.size()); ++i) {
    simulation::SimulatedStep step = stranger.steps[i];
    step.stamp.ns += later_ns;
    step.world_from_robot = compose(Pose2(x_m, 0.0, 0.0), step.world_from_robot);
    carried.steps.push_back(step);
  }
  return truth_map(carried, laser);
}

// Three robots of a flat that is 50 m long: "robot0" was everywhere, "robot2" in the west alone; "robot1", too, and its
// map shows another building in the east. `west_m`: how far the west goes.
struct CarriedAway {
  static constexpr double kWest_m = 18.0, kWrongFrom_m = 34.0;
  std::vector<Map> maps;
  Map before;               // of robot1
  Pose2 world_from_first;   // where robot0's map frame lies
  Pose2 first_from_second;  // robot1's in it

  explicit CarriedAway(double west_m = kWest_m) {
    simulation::ApartmentOptions flat, elsewhere;
    flat.width_m = 50.0;
    flat.height_m = elsewhere.height_m = 12.0;
    simulation::TeamOptions options, alone;
    options.robots = 3;
    options.shared = 1.0;
    alone.robots = 1;
    alone.seed = 98;
    constexpr std::size_t kSteps = 200;
    const auto team = simulation::make_apartment(flat, options);
    const auto stranger = simulation::make_apartment(elsewhere, alone);
    const auto in_west = [&](std::size_t robot) { return until_east_of(team.robots[robot], west_m); };
    maps = {truth_map(team.robots[0], team.laser),
            carried_away(in_west(1), kWrongFrom_m, stranger.robots[0], kSteps, team.laser),
            truth_map(in_west(2), team.laser)};
    before = truth_map(in_west(1), team.laser);
    world_from_first = team.robots[0].steps.front().world_from_robot;
    first_from_second = between(world_from_first, team.robots[1].steps.front().world_from_robot);
  }
};

}  // namespace mapweave::test
