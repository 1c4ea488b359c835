#pragma once
// Small worlds in memory, for tests of everything that maps.

#include <mapweave/simulation/world.h>

#include <vector>

namespace mapweave::simulation {

struct TeamOptions {
  int robots = 2;
  double shared =
      0.34;  // share of a robot's rooms that the next robot visits too; 0: disjoint tours, 1: everyone visits all
  bool return_to_start = true;
  double length_m = 0.0;  // of each robot's drive; 0: its tour, once
  std::int64_t seed = 7;
  SimulatedLaserOptions laser;
  WheelOdometryOptions odometry;
  MotionOptions motion;
  PeopleOptions people;
  double robot_radius_m = 0.0;  // 0: robots do not see each other
};

struct SimulatedRobot {
  RobotId id;  // "robot0", "robot1", ...
  std::size_t building = 0;
  std::vector<SimulatedStep> steps;  // with a scan each
};

struct SimulatedTeam {
  std::vector<FloorPlan> buildings;  // one, but for strangers; in the world's frame
  SimulatedLaserOptions laser;
  std::vector<SimulatedRobot> robots;
};

SimulatedTeam make_corridor(const CorridorOptions& = {}, const TeamOptions& = {});
SimulatedTeam make_apartment(const ApartmentOptions& = {}, const TeamOptions& = {});
SimulatedTeam make_repeated_rooms(const RoomRowOptions& = {}, const TeamOptions& = {});
SimulatedTeam make_mirrored_rooms(const RoomRowOptions& = {}, const TeamOptions& = {});
SimulatedTeam make_ring(const RingOptions& = {}, const TeamOptions& = {});
// Every robot in an apartment of its own, each from another seed: nothing to merge.
SimulatedTeam make_two_strangers(const ApartmentOptions& = {}, const TeamOptions& = {});

// The same for any world, with every robot's scans.
SimulatedTeam recorded(const WorldOptions&);

}  // namespace mapweave::simulation
