#pragma once
// What `run` does, as a configuration file says it; `slam` and `merge` read the same keys.

#include <mapweave/core/error.h>
#include <mapweave/core/ids.h>
#include <mapweave/core/options.h>
#include <mapweave/exporters/depth_cloud.h>
#include <mapweave/exporters/map_folder.h>
#include <mapweave/exporters/octo_map.h>
#include <mapweave/fusion/compose_grid.h>
#include <mapweave/fusion/fusion_options.h>
#include <mapweave/laser/engines.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/rig/fused_pose.h>
#include <mapweave/rig/laser_camera_alignment.h>
#include <mapweave/rig/rig.h>
#include <mapweave/runtime/live_options.h>
#include <mapweave/runtime/sensor_kinds.h>
#include <mapweave/runtime/tier_options.h>
#include <mapweave/scheduling/plan.h>
#include <mapweave/tiers/camera_agent.h>
#include <mapweave/tiers/visual_server.h>
#include <mapweave/visual/client_options.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::runtime {

struct RoutePoint {
  double x_m = 0.0, y_m = 0.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("x_m", x_m, -1e6, 1e6, "x coordinate of a point of the route in metres, in a frame that all robots share");
    v.number("y_m", y_m, -1e6, 1e6, "y coordinate of a point of the route in metres, in a frame that all robots share");
  }
};

// Where a robot was when its log began, in a frame that all robots share.
struct StartPose {
  double x_m = 0.0, y_m = 0.0, yaw_rad = 0.0, sigma_m = 0.0, sigma_rad = 0.1;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("x_m", x_m, -1e6, 1e6,
             "x coordinate in metres of where the robot began, in a frame that all robots share");
    v.number("y_m", y_m, -1e6, 1e6,
             "y coordinate in metres of where the robot began, in a frame that all robots share");
    v.number("yaw_rad", yaw_rad, -7.0, 7.0,
             "heading in radians with which the robot began, counter-clockwise from the x axis of a frame that all "
             "robots share");
    v.non_negative("sigma_m", sigma_m,
                   "standard deviation in metres of the position where the robot began; larger values let walls "
                   "decide; 0: its start is not known, or 0.5 if other numbers of the start are given");
    v.positive(
        "sigma_rad", sigma_rad,
        "standard deviation in radians of the heading with which the robot began; larger values let walls decide");
  }
};

constexpr double kStartSigma_m = 0.5;  // default standard deviation of a start or a prior

struct RobotEntry {
  std::string id, log, edge;
  double from_s = 0.0;
  std::vector<RoutePoint> route = {};
  StartPose start = {};
  std::vector<std::string> edges = {};
  std::vector<OptionSetting> own = {};  // override the options of all robots
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("id", id, "the robot's name; empty: its log's file name");
    v.text("log", log, "path of the robot's log, or of a folder of pictures, relative to this file");
    v.text("edge", edge,
           "edge that maps the robot, or with a coordinator the one that maps it at first; empty: as the coordinator "
           "decides, else the "
           "edges in turn");
    v.texts("edges", edges,
            "edges that map the robot's data together (partial offloading): its log is cut into parts of equal "
            "duration, one for each edge in this order, which are merged again like maps of robots; for lasers, "
            "without a coordinator; empty: `edge` maps everything");
    v.non_negative("from_s", from_s,
                   "time in seconds after the team's start at which the robot joins (with a coordinator, or rounds); "
                   "larger values let it join later");
    v.list("route", route,
           "points of the route that the robot is going to drive; lets the coordinator estimate overlaps before there "
           "is a map");
    v.section("start", start,
              "pose where the robot began, if it is known: a prior for merging its map, which walls may contradict");
    v.overrides("sensor", own, "for this robot alone: what the option sensor says for all");
    v.overrides("reading", own, "for this robot alone: options of the section reading");
    v.overrides("laser", own, "for this robot alone: options of the section laser, as {engine: icp}");
    v.overrides("visual", own, "for this robot alone: options of the section visual; the vocabulary is the team's");
    v.overrides("rig", own, "for this robot alone: options of the section rig");
    v.overrides("pose", own, "for this robot alone: options of the section pose");
  }
};

struct VisualOptions {
  std::string label, vocabulary;
  visual::ClientOptions client;
  matching::ChosenVocabulary chosen_vocabulary;  // content of that file (read_vocabulary)
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("label", label, "sensor label of the camera to map with where a robot has several; empty: all of them");
    v.text("vocabulary", vocabulary,
           "file with the binary words by which cameras recognise places, as mapweave vocabulary train writes it, "
           "relative to this file; empty: the vocabulary that mapweave brings");
    client.describe(v);
  }
};

struct EdgeEntry {
  std::string id, broker = {};
  double speed = 1.0, from_s = 0.0, until_s = 0.0;
  int capacity = 0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("id", id, "name of the edge, by which robots refer to it and its results are called");
    v.text("broker", broker,
           "NATS server of this edge, a leaf node of live.broker (serve): nats://host:port. Its robots and the edge "
           "connect to it, and go on while the cloud is away; empty: live.broker");
    v.positive("speed", speed, "speed of this edge's processor relative to processors.edge; larger values are faster");
    v.integer("capacity", capacity, 0, 1000000,
              "most robots that the edge maps; larger values let the coordinator put more robots there; 0: any number");
    v.non_negative("from_s", from_s,
                   "time in seconds after the team's start from which the edge is available (with a coordinator); "
                   "larger values make it available later");
    v.non_negative("until_s", until_s,
                   "time in seconds after the team's start at which the edge fails, with all maps on it; larger values "
                   "let it fail later; 0: it stays (with a coordinator)");
  }
};

// What merged maps look like from outside.
struct TeamMapOptions {
  std::string frame;
  std::vector<std::string> refuse;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("frame", frame,
           "frame of the merged map (run, merge): the name of a map or robot, whose frame is kept; walls: axes along "
           "the walls; x,y,yaw in metres and radians: where the first map's frame lies in it; empty: the frame of the "
           "first robot listed, of the first map given. Each team without that map keeps the frame of its own first");
    v.texts("refuse", refuse,
            "pairs of robots (run) or maps (merge) whose maps are never matched to each other, as in "
            "[\"alpha,beta\"]; a third one may still join them");
  }
};

// How `run` chooses an edge for each robot.
struct CoordinatorEntry {
  std::optional<scheduling::PlanMethod> method;  // none: there is no coordinator
  std::string at, model;
  double overlap_period_s = 10.0, hysteresis = 0.1, route_range_m = 6.0;
  scheduling::RecslamOptions recslam;
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice("method", method,
             {{"none", std::nullopt},
              {"default", scheduling::PlanMethod::standard},
              {"recslam", scheduling::PlanMethod::recslam},
              {"greedy", scheduling::PlanMethod::greedy},
              {"random", scheduling::PlanMethod::random},
              {"metis", scheduling::PlanMethod::metis},
              {"exact", scheduling::PlanMethod::exact}},
             "how robots are grouped on edges (see: mapweave plan --help); none: there is no coordinator, and edges "
             "are as robots name "
             "them, or in turn");
    v.text("at", at,
           "edge that runs the coordinator (run); empty: the cloud. The summary says how long map summaries took to it "
           "(summary_seconds); decisions do not wait for them. One that is a program of its own (serve) is where it is "
           "started");
    v.text(
        "model", model,
        "file with a latency model, as mapweave profile writes it, relative to this file; empty: the built-in model");
    v.positive(
        "overlap_period_s", overlap_period_s,
        "recorded time (serve: clock time) in seconds between two estimates of the robots' overlaps; larger values "
        "let the coordinator react later and send fewer summaries");
    v.fraction("hysteresis", hysteresis,
               "least saving, as a share of the expected time, for which the coordinator moves robots to other edges; "
               "larger values move "
               "them less often");
    v.positive("route_range_m", route_range_m,
               "distance in metres to both sides of an announced route that a robot is expected to see; larger values "
               "expect more overlap");
    v.section("recslam", recslam, "RecSLAM's own grouping, for method recslam");
  }
};

// What depth cameras and stereo pairs saw between their landmarks: a second pass over the logs.
struct DenseOptions {
  int every_frames = 0;
  int step_px = 2;
  double most_error_m = 0.1;
  exporters::DepthCloudOptions cloud;
  exporters::OctoMapOptions octomap;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("every_frames", every_frames, 0, 1000000,
              "use the depth of every n-th frame for dense maps; larger values are faster and leave more gaps; 0: of "
              "keyframes alone");
    v.integer("step_px", step_px, 1, 64,
              "use every n-th pixel of a depth picture, in rows and columns; larger values are faster and coarser");
    v.positive("most_error_m", most_error_m,
               "largest standard deviation in metres of a depth that is used; it grows with the square of the "
               "distance; larger values use depths that are farther away");
    v.section("cloud", cloud, "dense point cloud: map.ply and map.dense.pcd");
    v.section("octomap", octomap, "dense occupancy map: map.bt and map.ot");
  }
};

enum class OctoMapsOf { all, edges, team };

// Files that are written beside each map.mwdb.
struct OutputOptions {
  bool png = true, pgm = true, pcd = true, tum = true, g2o = false, ply = false, octomap = false, report = true;
  OctoMapsOf octomaps_of = OctoMapsOf::all;
  exporters::PictureOptions picture;
  exporters::PointCloudOptions cloud;
  DenseOptions dense;
  template <class Visitor>
  void describe(Visitor& v) {
    v.flag("png", png, "write map.png, and map.color.png with the robots' trajectories");
    v.flag("pgm", pgm, "write map.pgm and map.yaml, the occupancy grid as ROS's map_server and nav2 load it");
    v.flag("pcd", pcd, "write map.pcd, the laser's wall points as a point cloud");
    v.flag(
        "tum", tum,
        "write trajectory.tum of a robot and trajectories/<robot>.tum of a team, in TUM format; and each robot's pose "
        "as it came, robot.tum, with who gave it in robot.sources.csv (run, slam)");
    v.flag("g2o", g2o, "write map.g2o, the pose graph");
    v.flag("ply", ply,
           "write map.ply and map.dense.pcd, the coloured surfaces seen by depth cameras and stereo pairs (slam; the "
           "team's map of run)");
    v.flag("octomap", octomap,
           "write map.bt and map.ot, OctoMaps: occupied, free and unknown space, of what depth cameras and stereo "
           "pairs saw, and of what lasers saw a slab, one cell high, at the laser's height");
    v.choice("octomaps_of", octomaps_of,
             {{"all", OctoMapsOf::all}, {"edges", OctoMapsOf::edges}, {"team", OctoMapsOf::team}},
             "maps of which output.octomap writes OctoMaps (run, merge); all: robots', edges' and the team's; edges: "
             "edges' and the team's; team: the team's alone. Logs with depth are read once more for each of them");
    v.flag("report", report,
           "write report.html, one page that shows the results: maps, pairs of maps, times and options (run, slam, "
           "merge)");
    v.section("picture", picture, "size and resolution of the picture map.color.png");
    v.section("cloud", cloud, "point cloud of walls, map.pcd");
    v.section("dense", dense, "which depths are used for the dense maps of output.ply and output.octomap");
  }
};

struct RunConfiguration {
  std::uint64_t seed = 1;
  std::vector<RobotEntry> robots;
  std::vector<std::string> maps;
  std::vector<EdgeEntry> edges;
  TeamMapOptions team;
  CoordinatorEntry coordinator;
  CloudEntry cloud;
  Mode mode = Mode::offload;
  NetworkOptions network;
  ProcessorOptions processors;
  std::string sensor = "auto";  // one of kSensorChoices
  rawlog::ReadOptions reading;
  laser::LaserOptions laser;
  VisualOptions visual;
  fusion::FusionOptions fusion;
  tiers::ServerOptions server;
  tiers::UplinkOptions uplink;
  rig::RigOptions rig;
  rig::LaserCameraOptions laser_cameras;
  rig::FusedPoseOptions pose;
  fusion::ComposeOptions compose;
  OutputOptions output;
  LiveOptions live;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("seed", seed, 0, 4294967295, "seed of all random numbers of a run; the same seed gives the same bytes");
    v.list("robots", robots, "the robots of the team and their logs");
    v.texts(
        "maps", maps,
        "maps that the run begins with, of sessions before it (run, slam): map stores (.mwdb), journals of camera "
        "map servers (.mwj), folders of results, or the folder of a robot that received the team's map; relative to "
        "this file. The robots' maps join them, in the frame of the first one; empty: none");
    v.list("edges", edges,
           "the edges; robots that name none are assigned to them in turn, by the robots' names. Empty: the edges that "
           "robots name, or a "
           "single one");
    v.section("team", team, "the map that all robots' maps are merged into");
    v.section("coordinator", coordinator,
              "assigns robots to edges, again and again as maps grow and edges and links change");
    v.section("cloud", cloud, "the tier that merges the maps of all edges");
    v.choice("mode", mode, {{"offload", Mode::offload}, {"onboard", Mode::onboard}, {"cloud-only", Mode::cloud_only}},
             "who maps and who merges; offload: edges map what robots sensed, and merge; onboard: robots map, edges "
             "merge; cloud-only: "
             "robots map, the cloud merges alone. The maps are the same but for millimetres");
    v.section("network", network,
              "simulated network links between the tiers, in virtual time: no run waits for them, and summary.json "
              "says when everything "
              "would have arrived");
    v.section("processors", processors, "simulated speed of the tiers' processors, for the same virtual time");
    describe_sensor(v, std::make_index_sequence<kSensorChoices.size()>());
    v.section("reading", reading, "what a log does not say itself");
    v.section("laser", laser, "laser SLAM of one robot");
    v.section("visual", visual, "visual SLAM of one camera");
    v.section("fusion", fusion, "merging the maps of several robots");
    v.section("server", server,
              "the camera map server of each edge, with which cameras exchange maps while they drive");
    v.section("uplink", uplink, "what a camera client sends to its camera map server");
    v.section("rig", rig, "merging the maps of several cameras of one robot");
    v.section("laser_camera_alignment", laser_cameras,
              "aligning a robot's laser map and camera maps in one pose graph (sensor: all)");
    v.section("pose", pose,
              "the robot's pose as it comes, from its laser, its cameras and its wheels (robot.tum): which of them "
              "gives it, and when the next one takes over");
    v.section("compose", compose, "drawing occupancy grids from scans");
    v.section("output", output, "files that are written beside each map.mwdb");
    v.section("live", live, "robots, edges and a cloud that run as programs of their own (serve)");
  }

 private:
  template <class Visitor, std::size_t... I>
  void describe_sensor(Visitor& v, std::index_sequence<I...>) {
    v.choice("sensor", sensor, {{kSensorChoices[I], std::string(kSensorChoices[I])}...}, kSensorChoiceText);
  }
};

// What one of several edges maps of a robot's log: records in [from, until).
struct LogPart {
  RobotId robot;
  std::size_t number = 1, count = 1;  // 1: the first one
  Stamp from = {};                    // set by divide_logs()
  std::optional<Stamp> until = {};    // none: to the end of the log
};
struct PlannedRobot {
  RobotId id;  // id of a part: "alpha.2" is the second part of robot alpha
  TierId edge;
  std::filesystem::path log;
  ChosenSensors sensors = {};         // set by choose_sensors()
  std::optional<Error> trouble = {};  // why none could be chosen
  std::optional<LogPart> part = {};
  std::shared_ptr<const RunConfiguration> configuration = {};  // configuration with the robot's own options; null: none
  const RobotId& robot() const { return part ? part->robot : id; }  // the robot's id in the configuration
};
// The configuration by which a robot maps.
inline const RunConfiguration& configuration_of(const RunConfiguration& all, const PlannedRobot& robot) {
  return robot.configuration ? *robot.configuration : all;
}
struct RunPlan {
  std::vector<PlannedRobot>
      robots;  // by id; parts of a log where several edges map a robot; without a coordinator each has an edge
  std::vector<std::filesystem::path> maps = {};  // maps that the run begins with, by their full paths
  std::vector<TierId> edges;                     // sorted; without a coordinator each has robots
  std::set<std::pair<RobotId, RobotId>>
      refused;                  // pairs never to be matched to each other; parts count each; the lower id first
  NetworkOptions network;       // holds traces by their full paths
  std::filesystem::path model;  // full path of the coordinator's model; may be empty
};

// What the configuration says of a robot; ContractViolation where it lists none of this name.
RobotEntry robot_entry(const RunConfiguration&, const RobotId&);
// Gives starts without a sigma_m the default. To be done once all layers are loaded.
void complete_starts(RunConfiguration&, const Origins&);
// Takes the vocabulary of visual.vocabulary for cameras, camera map servers and merges; the path is the full one then.
// To be done once all layers are loaded. Throws Error: kMissing, and what matching::load_vocabulary() throws.
void read_vocabulary(RunConfiguration&, const Origins&);
// What the configuration says of an edge; the defaults where it lists none of this name.
EdgeEntry edge_entry(const RunConfiguration&, const TierId&);
// Where an edge's programs, and those of its robots, find their broker.
LiveOptions live_at(const RunConfiguration&, const TierId& edge);

// The tier that fuses everything; no edge is called so.
TierId cloud_tier();

// Logs are looked for beside the file that names them, or where the program was started. Throws Error, saying where in
// the file: kBadInput for no robots, two with one id, names that cannot be, an edge that no robot uses, edges that
// cannot hold all robots, a wire between two that are none, a frame of no robot (where the run begins with maps,
// frames are looked for later), several edges of a robot where a coordinator chooses or where robots map themselves,
// robots to be refused that are none or one; kMissing for a robot without a log, and for a log, a map (unless programs
// on other machines have them), a trace or a model that is not there.
enum class LogsAre { here, with_robots };
RunPlan make_plan(const RunConfiguration&, const Origins&, LogsAre logs = LogsAre::here);

// The configuration as it was carried out: robots as they were listed, each with its edge and the full path of its log.
RunConfiguration effective(RunConfiguration, const RunPlan&);

// What a map's folder holds beside map.mwdb. `title` stands above the picture where the options have none.
exporters::MapFolderOptions folder_options(const OutputOptions&, const std::string& title);

// Letters that names cannot have become '-'; shortened; may be empty.
std::string made_valid(std::string name);

// "office east.rawlog.gz" -> "office-east": a name made of what a file is called.
std::string name_of_file(const std::filesystem::path&);

}  // namespace mapweave::runtime
