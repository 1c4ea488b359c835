#pragma once
// A world file: buildings, the robots that drive in them, people, sensors, noise and one seed.

#include <mapweave/simulation/laser_sensor.h>
#include <mapweave/simulation/trajectory.h>
#include <mapweave/simulation/wheel_odometry.h>

#include <string>
#include <vector>

namespace mapweave::simulation {

enum class PlanKind { corridor, apartment, repeated_rooms, mirrored_rooms, hall, ring };

struct BuildingOptions {
  PlanKind kind = PlanKind::apartment;
  std::int64_t seed = 0;
  CorridorOptions corridor;
  ApartmentOptions apartment;
  RoomRowOptions repeated_rooms;
  RoomRowOptions mirrored_rooms;
  HallOptions hall;
  RingOptions ring;
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice("kind", kind,
             {{"corridor", PlanKind::corridor},
              {"apartment", PlanKind::apartment},
              {"repeated_rooms", PlanKind::repeated_rooms},
              {"mirrored_rooms", PlanKind::mirrored_rooms},
              {"hall", PlanKind::hall},
              {"ring", PlanKind::ring}},
             "which of the plans below it follows");
    v.integer("seed", seed, 0, 2147483647,
              "keeps the building while the world's seed changes; 0: from the world's seed and the building's number");
    v.section("corridor", corridor, "a straight corridor");
    v.section("apartment", apartment, "rooms along corridors");
    v.section("repeated_rooms", repeated_rooms, "rooms that are all alike");
    v.section("mirrored_rooms", mirrored_rooms, "rooms that are mirror images of their neighbours");
    v.section("hall", hall, "an open hall");
    v.section("ring", ring, "a corridor that closes on itself");
  }
};

struct WaypointOptions {
  double x_m = 0.0, y_m = 0.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("x_m", x_m, -100000.0, 100000.0, "in the building's frame");
    v.number("y_m", y_m, -100000.0, 100000.0, "in the building's frame");
  }
};

enum class TourOrder { along, back, shuffled };

struct RobotOptions {
  std::string id;
  std::string edge;
  int building = 0;
  int first_room = 0;
  int last_room = -1;
  TourOrder order = TourOrder::along;
  bool return_to_start = true;
  int laps = 1;
  double length_m = 0.0;
  double start_s = 0.0;
  std::vector<WaypointOptions> waypoints;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("id", id, "the robot's name; its files are called so");
    v.text("edge", edge, "the edge that maps it; empty: taken in turn");
    v.integer("building", building, 0, 100, "the building it is in, counted from 0");
    v.integer("first_room", first_room, 0, 100000, "its tour visits the rooms from this one, counted from 0");
    v.integer("last_room", last_room, -1, 100000, "to this one; -1: the last there is");
    v.choice("order", order, {{"along", TourOrder::along}, {"back", TourOrder::back}, {"shuffled", TourOrder::shuffled}},
             "rooms one after the other, the other way round, or in an order from the seed");
    v.flag("return_to_start", return_to_start, "each lap ends where it began");
    v.integer("laps", laps, 1, 1000, "rounds of the tour");
    v.number("length_m", length_m, 0.0, 100000.0, "drive this far, in as many laps as it takes; 0: as `laps` says");
    v.number("start_s", start_s, 0.0, 100000.0, "starts this long after the world's first moment");
    v.list("waypoints", waypoints, "drive by these points instead of rooms");
  }
};

struct PeopleOptions {
  int count = 0;
  double radius_m = 0.2;
  double speed_m_per_s = 1.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("count", count, 0, 100, "people that walk about in each building");
    v.number("radius_m", radius_m, 0.05, 1.0, "of the disc that the laser sees of one");
    v.number("speed_m_per_s", speed_m_per_s, 0.1, 3.0, "how fast they walk");
  }
};

struct WorldOptions {
  std::int64_t seed = 1;
  std::vector<BuildingOptions> buildings;
  std::vector<RobotOptions> robots;
  int edges = 1;
  PeopleOptions people;
  double robot_radius_m = 0.2;
  LaserOptions laser;
  WheelOdometryOptions odometry;
  MotionOptions motion;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("seed", seed, 0, 2147483647, "of everything random");
    v.list("buildings", buildings, "none: one apartment; they share nothing and stand apart");
    v.list("robots", robots, "who drives where");
    v.integer("edges", edges, 1, 1000, "edges that robots without one are given to in turn");
    v.section("people", people, "people that walk about");
    v.number("robot_radius_m", robot_radius_m, 0.0, 2.0, "of the disc that the other robots' lasers see; 0: robots do not see each other");
    v.section("laser", laser, "the laser that every robot carries");
    v.section("odometry", odometry, "its wheels");
    v.section("motion", motion, "how it drives");
  }
};

}  // namespace mapweave::simulation
