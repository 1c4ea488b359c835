#include <mapweave/simulation/tiny_worlds.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

WorldOptions world_of(const TeamOptions& team) {
  WorldOptions world;
  world.seed = team.seed;
  world.laser = team.laser;
  world.odometry = team.odometry;
  world.motion = team.motion;
  world.people = team.people;
  world.robot_radius_m = team.robot_radius_m;
  for (int i = 0; i < team.robots; ++i) {
    RobotOptions robot;
    robot.id = "robot" + std::to_string(i);
    robot.return_to_start = team.return_to_start;
    robot.length_m = team.length_m;
    world.robots.push_back(std::move(robot));
  }
  return world;
}

// The rooms of a building are shared out so that each robot has equally many and neighbours share the wanted part of
// them.
SimulatedTeam one_building(const BuildingOptions& building, std::size_t rooms, const TeamOptions& team) {
  MAPWEAVE_EXPECT(team.robots >= 1 && team.shared >= 0.0 && team.shared <= 1.0,
                  "a team has robots that share 0 to 1 of their rooms");
  WorldOptions world = world_of(team);
  world.buildings.push_back(building);
  const double count = static_cast<double>(rooms), each = count / (1.0 + (team.robots - 1) * (1.0 - team.shared));
  for (int i = 0; i < team.robots; ++i) {
    const double first = i * each * (1.0 - team.shared);
    RobotOptions& robot = world.robots[static_cast<std::size_t>(i)];
    robot.first_room = std::min(static_cast<int>(rooms) - 1, static_cast<int>(std::lround(first)));
    robot.last_room =
        std::clamp(static_cast<int>(std::lround(first + each)) - 1, robot.first_room, static_cast<int>(rooms) - 1);
  }
  return recorded(world);
}

std::uint64_t seed_of(const TeamOptions& team) {
  MAPWEAVE_EXPECT(team.seed > 0, "a team's seed is positive");
  return static_cast<std::uint64_t>(team.seed);
}

BuildingOptions building_of(PlanKind kind, const TeamOptions& team) {
  BuildingOptions building;
  building.kind = kind;
  building.seed = team.seed;
  return building;
}

}  // namespace

SimulatedTeam make_corridor(const CorridorOptions& options, const TeamOptions& team) {
  BuildingOptions building = building_of(PlanKind::corridor, team);
  building.corridor = options;
  return one_building(building, make_corridor_plan(options, seed_of(team)).rooms.size(), team);
}

SimulatedTeam make_apartment(const ApartmentOptions& options, const TeamOptions& team) {
  BuildingOptions building = building_of(PlanKind::apartment, team);
  building.apartment = options;
  return one_building(building, make_apartment_plan(options, seed_of(team)).rooms.size(), team);
}

SimulatedTeam make_repeated_rooms(const RoomRowOptions& options, const TeamOptions& team) {
  BuildingOptions building = building_of(PlanKind::repeated_rooms, team);
  building.repeated_rooms = options;
  return one_building(building, static_cast<std::size_t>(options.rooms), team);
}

SimulatedTeam make_mirrored_rooms(const RoomRowOptions& options, const TeamOptions& team) {
  BuildingOptions building = building_of(PlanKind::mirrored_rooms, team);
  building.mirrored_rooms = options;
  return one_building(building, static_cast<std::size_t>(options.rooms), team);
}

SimulatedTeam make_ring(const RingOptions& options, const TeamOptions& team) {
  BuildingOptions building = building_of(PlanKind::ring, team);
  building.ring = options;
  return one_building(building, make_ring_plan(options, seed_of(team)).rooms.size(), team);
}

SimulatedTeam make_two_strangers(const ApartmentOptions& options, const TeamOptions& team) {
  WorldOptions world = world_of(team);
  for (std::size_t i = 0; i < world.robots.size(); ++i) {
    BuildingOptions building;
    building.apartment = options;
    world.buildings.push_back(building);
    world.robots[i].building = static_cast<int>(i);
  }
  return recorded(world);
}

SimulatedTeam recorded(const WorldOptions& options) {
  WorkerPool here(1);
  const World world(options, here);
  SimulatedTeam team{world.buildings(), world.options().laser, {}};
  for (std::size_t i = 0; i < world.robot_count(); ++i) {
    SimulatedRobot robot{world.robot_id(i), world.building_of(i), {}};
    Recording recording(world, i);
    while (auto step = recording.next()) {
      if (!step->ranges.empty()) robot.steps.push_back(std::move(*step));
    }
    team.robots.push_back(std::move(robot));
  }
  return team;
}

}  // namespace mapweave::simulation
