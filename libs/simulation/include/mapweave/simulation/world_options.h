#pragma once
// A world file: buildings, the robots that drive in them, people, sensors, noise and one seed.

#include <mapweave/simulation/camera_options.h>
#include <mapweave/simulation/laser_sensor.h>
#include <mapweave/simulation/light.h>
#include <mapweave/simulation/scene.h>
#include <mapweave/simulation/trajectory.h>
#include <mapweave/simulation/wheel_odometry.h>

#include <string>
#include <vector>

namespace mapweave::simulation {

enum class PlanKind { corridor, apartment, repeated_rooms, mirrored_rooms, hall, ring, warehouse };

struct FurnitureOptions {
  double round = 0.0;
  int session = 0;
  double changed = 0.3;
  template <class Visitor>
  void describe(Visitor& v) {
    v.fraction("round", round, "share of boxes that are cylinders instead");
    v.integer("session", session, 0, 1000, "another day in the same building: some furniture differs; 0: the first");
    v.fraction("changed", changed,
               "share of furniture that is gone, or another and smaller piece, in a session after the first");
  }
};

struct BuildingOptions {
  PlanKind kind = PlanKind::apartment;
  std::int64_t seed = 0;
  FurnitureOptions furniture;
  CorridorOptions corridor;
  ApartmentOptions apartment;
  RoomRowOptions repeated_rooms;
  RoomRowOptions mirrored_rooms;
  HallOptions hall;
  RingOptions ring;
  WarehouseOptions warehouse;
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice("kind", kind,
             {{"corridor", PlanKind::corridor},
              {"apartment", PlanKind::apartment},
              {"repeated_rooms", PlanKind::repeated_rooms},
              {"mirrored_rooms", PlanKind::mirrored_rooms},
              {"hall", PlanKind::hall},
              {"ring", PlanKind::ring},
              {"warehouse", PlanKind::warehouse}},
             "which of the plans below it follows");
    v.integer("seed", seed, 0, 2147483647,
              "keeps the building while the world's seed changes; 0: from the world's seed and the building's number");
    v.section("furniture", furniture, "what stands in any of them");
    v.section("corridor", corridor, "a straight corridor");
    v.section("apartment", apartment, "rooms along corridors");
    v.section("repeated_rooms", repeated_rooms, "rooms that are all alike");
    v.section("mirrored_rooms", mirrored_rooms, "rooms that are mirror images of their neighbours");
    v.section("hall", hall, "an open hall");
    v.section("ring", ring, "a corridor that closes on itself");
    v.section("warehouse", warehouse, "aisles between racks");
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

struct KidnappingOptions {
  double after_m = 20.0;
  double skip_m = 10.0;
  double duration_s = 5.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("after_m", after_m, 0.0, 100000.0, "of its path the robot is picked up");
    v.number("skip_m", skip_m, 0.0, 100000.0, "and put down again this much further along its path");
    v.number("duration_s", duration_s, 0.0, 600.0,
             "meanwhile its cameras and its laser are covered; 0: between two frames");
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
  std::vector<KidnappingOptions> kidnappings;
  std::vector<CameraOptions> cameras;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("id", id, "the robot's name; its files are called so");
    v.text("edge", edge, "the edge that maps it; empty: taken in turn");
    v.integer("building", building, 0, 100, "the building it is in, counted from 0");
    v.integer("first_room", first_room, 0, 100000, "its tour visits the rooms from this one, counted from 0");
    v.integer("last_room", last_room, -1, 100000, "to this one; -1: the last there is");
    v.choice("order", order,
             {{"along", TourOrder::along}, {"back", TourOrder::back}, {"shuffled", TourOrder::shuffled}},
             "rooms one after the other, in reverse, or in an order from the seed");
    v.flag("return_to_start", return_to_start, "each lap ends where it began");
    v.integer("laps", laps, 1, 1000, "rounds of the tour");
    v.number("length_m", length_m, 0.0, 100000.0, "drive this far, in as many laps as it takes; 0: as `laps` says");
    v.number("start_s", start_s, 0.0, 31536000.0, "starts this long after the world's first moment, up to a year");
    v.list("waypoints", waypoints, "drive by these points instead of rooms");
    v.list("kidnappings", kidnappings, "carried away, wheels in the air, in the order of the path");
    v.list("cameras", cameras, "its own, instead of the world's");
  }
};

struct PeopleOptions {
  int count = 0;
  double radius_m = 0.2;
  double height_m = 1.7;
  double speed_m_per_s = 1.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("count", count, 0, 100, "people that walk about in each building");
    v.number("radius_m", radius_m, 0.05, 1.0, "of the disc that the laser sees of one");
    v.number("height_m", height_m, 0.5, 2.5, "and of the body that cameras see");
    v.number("speed_m_per_s", speed_m_per_s, 0.1, 3.0, "how fast they walk");
  }
};

enum class LogLayout { rawlog, folders, both };
enum class PictureFormat { embedded, png, jpeg };

struct LogOptions {
  LogLayout layout = LogLayout::rawlog;
  PictureFormat pictures = PictureFormat::png;
  int jpeg_quality = 90;
  bool scans = true;
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice("layout", layout,
             {{"rawlog", LogLayout::rawlog}, {"folders", LogLayout::folders}, {"both", LogLayout::both}},
             "all sensors in one rawlog; a folder for each camera (TUM RGB-D layout; stereo: KITTI odometry layout) "
             "beside a rawlog of the "
             "other sensors; or cameras in both");
    v.choice(
        "pictures", pictures,
        {{"embedded", PictureFormat::embedded}, {"png", PictureFormat::png}, {"jpeg", PictureFormat::jpeg}},
        "in the rawlog (grey ones without loss, colour as MRPT's JPEG), or beside it; folders take png for embedded");
    v.integer("jpeg_quality", jpeg_quality, 1, 100, "of jpeg");
    v.flag("scans", scans, "whether the laser's scans are written");
  }
};

struct WorldOptions {
  std::int64_t seed = 1;
  std::vector<BuildingOptions> buildings;
  std::vector<RobotOptions> robots;
  int edges = 1;
  PeopleOptions people;
  double robot_radius_m = 0.2;
  double robot_height_m = 0.5;
  LookOptions look;
  LightOptions light;
  std::vector<CameraOptions> cameras;
  ImuOptions imu;
  LogOptions logs;
  SimulatedLaserOptions laser;
  WheelOdometryOptions odometry;
  MotionOptions motion;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("seed", seed, 0, 2147483647, "of everything random");
    v.list("buildings", buildings, "none: one apartment; they share nothing and stand apart");
    v.list("robots", robots, "who drives where");
    v.integer("edges", edges, 1, 1000, "edges that robots without one are given to in turn");
    v.section("people", people, "people that walk about");
    v.number("robot_radius_m", robot_radius_m, 0.0, 2.0,
             "of the disc that the other robots' lasers see; 0: robots do not see each other");
    v.number("robot_height_m", robot_height_m, 0.05, 2.5, "and of the body that their cameras see");
    v.section("look", look, "what cameras see of buildings");
    v.section("light", light, "day or night, in all buildings");
    v.list("cameras", cameras, "that every robot carries, unless it has its own");
    v.section("imu", imu, "the inertial unit that every robot carries, at its origin");
    v.section("logs", logs, "how cameras are written");
    v.section("laser", laser, "the laser that every robot carries");
    v.section("odometry", odometry, "its wheels");
    v.section("motion", motion, "how it drives");
  }
};

}  // namespace mapweave::simulation
