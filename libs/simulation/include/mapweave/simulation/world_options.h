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
    v.fraction("round", round,
               "share of the boxes among a building's furniture that are cylinders instead; larger values make more of "
               "them round");
    v.integer("session", session, 0, 1000,
              "number of the session in a building: in every session after 0 some furniture differs from the first "
              "one's, as on another day");
    v.fraction("changed", changed,
               "share of a building's furniture that is gone, or replaced by a smaller piece, in every session after "
               "the first; larger values change more");
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
             "plan of the building; the section of the same name has its options");
    v.integer("seed", seed, 0, 2147483647,
              "seed of this building's own random numbers, which keeps the building while the world's seed changes; 0: "
              "from the world's seed and the building's number");
    v.section("furniture", furniture, "furniture of the building, whatever its kind");
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
    v.number("x_m", x_m, -100000.0, 100000.0, "x coordinate of a waypoint in metres, in the building's frame");
    v.number("y_m", y_m, -100000.0, 100000.0, "y coordinate of a waypoint in metres, in the building's frame");
  }
};

struct KidnappingOptions {
  double after_m = 20.0;
  double skip_m = 10.0;
  double duration_s = 5.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("after_m", after_m, 0.0, 100000.0,
             "length in metres of the planned path after which the robot is picked up; larger values pick it up later");
    v.number(
        "skip_m", skip_m, 0.0, 100000.0,
        "length in metres of the planned path that the robot is carried past; larger values put it down farther away");
    v.number("duration_s", duration_s, 0.0, 600.0,
             "time in seconds for which the robot is carried, with its cameras and its laser covered; larger values "
             "leave a longer gap; 0: it is moved between two frames");
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
    v.text("id", id, "name of the robot, which its files have too");
    v.text("edge", edge, "edge that maps the robot; empty: the edges in turn");
    v.integer("building", building, 0, 100, "number of the building that the robot drives in, counted from 0");
    v.integer("first_room", first_room, 0, 100000, "number of the first room of the robot's tour, counted from 0");
    v.integer("last_room", last_room, -1, 100000,
              "number of the last room of the robot's tour, counted from 0; -1: the building's last room");
    v.choice(
        "order", order, {{"along", TourOrder::along}, {"back", TourOrder::back}, {"shuffled", TourOrder::shuffled}},
        "order of the rooms in a tour; along: one after the other; back: in reverse; shuffled: at random, by the seed");
    v.flag("return_to_start", return_to_start,
           "each lap of the tour ends where the robot started; false: in the last room");
    v.integer("laps", laps, 1, 1000, "number of laps of the robot's tour; larger values drive longer");
    v.number("length_m", length_m, 0.0, 100000.0,
             "length in metres of the path that the robot drives, in as many laps as that takes; larger values drive "
             "longer; 0: as many laps as the option laps says");
    v.number(
        "start_s", start_s, 0.0, 31536000.0,
        "time in seconds after the world's first moment at which the robot starts; larger values let it start later");
    v.list("waypoints", waypoints, "points that the robot drives by, instead of through rooms");
    v.list("kidnappings", kidnappings,
           "times that the robot is carried away, with its wheels in the air, in the order of its path");
    v.list("cameras", cameras, "cameras of this robot; empty: the world's cameras");
  }
};

struct PeopleOptions {
  int count = 0;
  double radius_m = 0.2;
  double height_m = 1.7;
  double speed_m_per_s = 1.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("count", count, 0, 100,
              "number of people that walk about in each building; larger values hide more of it");
    v.number("radius_m", radius_m, 0.05, 1.0,
             "radius in metres of a person, whom lasers and cameras see as a round body; larger values hide more");
    v.number("height_m", height_m, 0.5, 2.5,
             "height in metres of a person, as cameras see it; larger values hide more");
    v.number("speed_m_per_s", speed_m_per_s, 0.1, 3.0,
             "speed of people in metres per second; larger values are faster");
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
             "files that logs are written to; rawlog: all sensors in one rawlog; folders: a folder for each camera "
             "(TUM RGB-D layout; stereo: KITTI odometry layout) beside a rawlog of the other sensors; both: a rawlog "
             "of all sensors, and a folder for each camera");
    v.choice("pictures", pictures,
             {{"embedded", PictureFormat::embedded}, {"png", PictureFormat::png}, {"jpeg", PictureFormat::jpeg}},
             "form of the pictures of a log; embedded: within the rawlog (grey pictures without loss, colour as MRPT's "
             "JPEG); png, jpeg: files beside it. In folders, embedded means png");
    v.integer("jpeg_quality", jpeg_quality, 1, 100,
              "quality of JPEG pictures (pictures: jpeg); larger values lose less and make larger files");
    v.flag("scans", scans, "write the laser's scans into the logs");
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
    v.integer("seed", seed, 0, 2147483647, "seed of all random numbers of a world; the same seed gives the same bytes");
    v.list("buildings", buildings, "buildings, which stand apart and share nothing; empty: one apartment");
    v.list("robots", robots, "robots, and where each of them drives");
    v.integer("edges", edges, 1, 1000, "number of edges to which robots that name none are assigned in turn");
    v.section("people", people, "people that walk about in the buildings");
    v.number("robot_radius_m", robot_radius_m, 0.0, 2.0,
             "radius in metres of a robot, which other robots' lasers and cameras see as a round body; larger values "
             "hide more; 0: robots do not see each other");
    v.number("robot_height_m", robot_height_m, 0.05, 2.5,
             "height in metres of a robot, as other robots' cameras see it; larger values hide more");
    v.section("look", look, "what buildings look like to cameras");
    v.section("light", light, "light in all buildings, by day or by night");
    v.list("cameras", cameras, "cameras that every robot carries, unless it has its own");
    v.section("imu", imu, "inertial unit that every robot carries, at its origin");
    v.section("logs", logs, "how sensors are written to files");
    v.section("laser", laser, "laser that every robot carries");
    v.section("odometry", odometry, "wheel odometry of every robot, and its errors");
    v.section("motion", motion, "how robots drive");
  }
};

}  // namespace mapweave::simulation
