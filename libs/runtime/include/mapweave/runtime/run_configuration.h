#pragma once
// What `run` does, as a configuration file says it; `slam` and `merge` read the same keys.

#include <mapweave/core/ids.h>
#include <mapweave/core/options.h>
#include <mapweave/exporters/depth_cloud.h>
#include <mapweave/exporters/map_folder.h>
#include <mapweave/exporters/octo_map.h>
#include <mapweave/rig/laser_camera_alignment.h>
#include <mapweave/fusion/compose_grid.h>
#include <mapweave/fusion/fusion_options.h>
#include <mapweave/rig/rig.h>
#include <mapweave/laser/engines.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/runtime/timeline.h>
#include <mapweave/tiers/camera_agent.h>
#include <mapweave/tiers/visual_server.h>
#include <mapweave/visual/client_options.h>

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::runtime {

struct RoutePoint {
  double x_m = 0.0, y_m = 0.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("x_m", x_m, -1e6, 1e6, "in a frame that all robots share");
    v.number("y_m", y_m, -1e6, 1e6, "in a frame that all robots share");
  }
};

// Where a robot was when its log began, in a frame that all robots share.
struct StartPose {
  double x_m = 0.0, y_m = 0.0, yaw_rad = 0.0, sigma_m = 0.0, sigma_rad = 0.1;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("x_m", x_m, -1e6, 1e6, "in a frame that all robots share");
    v.number("y_m", y_m, -1e6, 1e6, "in a frame that all robots share");
    v.number("yaw_rad", yaw_rad, -7.0, 7.0, "heading in this frame, counter-clockwise from its x axis");
    v.non_negative("sigma_m", sigma_m, "standard deviation of the position; 0: the start is not known");
    v.positive("sigma_rad", sigma_rad, "standard deviation of the heading");
  }
};

struct RobotEntry {
  std::string id, log, edge;
  double from_s = 0.0;
  std::vector<RoutePoint> route = {};
  StartPose start = {};
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("id", id, "the robot's name; empty: its log's file name");
    v.text("log", log, "its log, or a folder of pictures; relative to this file");
    v.text("edge", edge, "the edge that maps it, with a coordinator at first; empty: as the coordinator decides, else the edges in turn");
    v.non_negative("from_s", from_s, "it begins then, in seconds since the team did (with a coordinator)");
    v.list("route", route, "the way that it is going to drive, for the coordinator to know before there is a map");
    v.section("start", start, "where it began, if that is known: a prior for merging its map, which walls may contradict");
  }
};

// Which of a robot's sensors are mapped.
enum class SensorChoice { automatic, laser, mono, stereo, rgbd, cameras, all };

struct VisualOptions {
  std::string label;
  visual::ClientOptions client;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("label", label, "the camera to map with where a robot has several; empty: all of them, each on its own");
    client.describe(v);
  }
};

struct EdgeEntry {
  std::string id;
  double speed = 1.0, from_s = 0.0, until_s = 0.0;
  int capacity = 0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("id", id, "the edge's name");
    v.positive("speed", speed, "of its processor, relative to processors.edge");
    v.integer("capacity", capacity, 0, 1000000, "most robots; 0: any number");
    v.non_negative("from_s", from_s, "it is there from then on, in seconds since the team began (with a coordinator)");
    v.non_negative("until_s", until_s, "it goes then, with all that it holds; 0: it stays (with a coordinator)");
  }
};

// Which robot to which edge, in `run`.
enum class Coordination { none, standard, recslam, greedy, random, metis, exact };

struct CoordinatorEntry {
  Coordination method = Coordination::none;
  std::string at, model;
  double overlap_period_s = 10.0, hysteresis = 0.1, route_range_m = 6.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice("method", method,
             {{"none", Coordination::none},
              {"default", Coordination::standard},
              {"recslam", Coordination::recslam},
              {"greedy", Coordination::greedy},
              {"random", Coordination::random},
              {"metis", Coordination::metis},
              {"exact", Coordination::exact}},
             "how robots are grouped (mapweave plan); none: edges are as robots name them, or in turn");
    v.text("at", at, "the edge that coordinates, as it is told of it: summaries take no time on wires; empty: the cloud");
    v.text("model", model, "a latency model as mapweave profile writes it; relative to this file; empty: the program's own");
    v.positive("overlap_period_s", overlap_period_s, "of data, from one look at what maps share to the next");
    v.fraction("hysteresis", hysteresis, "robots are moved where that saves more than this share of the expected time");
    v.positive("route_range_m", route_range_m, "how far robots see to both sides of an announced way");
  }
};

// What depth cameras and stereo pairs saw between their landmarks: a second way through the logs.
struct DenseOptions {
  int every_frames = 0;
  int step_px = 2;
  double most_error_m = 0.1;
  exporters::DepthCloudOptions cloud;
  exporters::OctoMapOptions octomap;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("every_frames", every_frames, 0, 1000000, "the depth of each so-manieth frame is taken; 0: of keyframes");
    v.integer("step_px", step_px, 1, 64, "from one pixel that is taken to the next");
    v.positive("most_error_m", most_error_m, "depths whose deviation is larger, for they are far, are left out");
    v.section("cloud", cloud, "how map.ply and map.dense.pcd are made");
    v.section("octomap", octomap, "how map.bt and map.ot are made");
  }
};

// Beside each map.mwdb.
struct OutputOptions {
  bool png = true, pgm = true, pcd = true, tum = true, g2o = false, ply = false, octomap = false;
  exporters::PictureOptions picture;
  exporters::PointCloudOptions cloud;
  DenseOptions dense;
  template <class Visitor>
  void describe(Visitor& v) {
    v.flag("png", png, "map.png, and map.color.png with the robots' ways");
    v.flag("pgm", pgm, "map.pgm and map.yaml, as map_server and nav2 load them");
    v.flag("pcd", pcd, "map.pcd, the points of the walls");
    v.flag("tum", tum, "trajectory.tum, and trajectories/<robot>.tum of a team");
    v.flag("g2o", g2o, "map.g2o, the pose graph");
    v.flag("ply", ply, "map.ply and map.dense.pcd, the coloured surfaces that depth cameras and stereo pairs saw (slam; team of run)");
    v.flag("octomap", octomap, "map.bt and map.ot, what they saw as OctoMap's trees: occupied, free, unknown");
    v.section("picture", picture, "how map.color.png is drawn");
    v.section("cloud", cloud, "how map.pcd is made");
    v.section("dense", dense, "what is taken of depth cameras and stereo pairs for ply and octomap");
  }
};

struct RunConfiguration {
  std::uint64_t seed = 1;
  std::vector<RobotEntry> robots;
  std::vector<EdgeEntry> edges;
  CoordinatorEntry coordinator;
  CloudEntry cloud;
  Mode mode = Mode::offload;
  NetworkOptions network;
  ProcessorOptions processors;
  SensorChoice sensor = SensorChoice::automatic;
  rawlog::ReadOptions reading;
  laser::LaserOptions laser;
  VisualOptions visual;
  fusion::FusionOptions fusion;
  tiers::ServerOptions server;
  tiers::UplinkOptions uplink;
  rig::RigOptions rig;
  rig::LaserCameraOptions bind;
  fusion::ComposeOptions compose;
  OutputOptions output;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("seed", seed, 0, 4294967295, "of everything random; the same seed gives the same bytes");
    v.list("robots", robots, "who recorded what");
    v.list("edges", edges,
           "edges that robots without one are given to in turn, by the robots' names; empty: those that robots name, or one");
    v.section("coordinator", coordinator, "which robot to which edge, as maps grow and edges and wires change");
    v.section("cloud", cloud, "the tier that joins everything");
    v.choice(
        "mode", mode, {{"offload", Mode::offload}, {"onboard", Mode::onboard}, {"cloud-only", Mode::cloud_only}},
        "who maps and joins; offload: edges map what robots sensed, and join; onboard: robots map, edges join; cloud-only: robots map, "
        "the cloud joins alone. The maps are the same");
    v.section("network", network,
              "wires between tiers, in virtual time: no run waits for them, but summary.json tells when all would be there");
    v.section("processors", processors, "how fast the tiers compute, for the same account");
    v.choice("sensor", sensor,
             {{"auto", SensorChoice::automatic},
              {"laser", SensorChoice::laser},
              {"mono", SensorChoice::mono},
              {"stereo", SensorChoice::stereo},
              {"rgbd", SensorChoice::rgbd},
              {"cameras", SensorChoice::cameras},
              {"all", SensorChoice::all}},
             "what robots map with; auto: the laser where a log has one, else its cameras; cameras: with all that each of them gives; all: "
             "laser "
             "and cameras, in one graph");
    v.section("reading", reading, "what logs do not say themselves");
    v.section("laser", laser, "one robot's grid SLAM");
    v.section("visual", visual, "one camera's SLAM");
    v.section("fusion", fusion, "how maps are joined");
    v.section("server", server, "the edges' map servers, which cameras tell what they see while they see it");
    v.section("uplink", uplink, "from a camera's client to its edge's map server");
    v.section("rig", rig, "how several cameras of one robot share one map");
    v.section("bind", bind, "how a robot's laser and cameras are tied in one graph (sensor: all)");
    v.section("compose", compose, "how grids are drawn");
    v.section("output", output, "what is written beside each map.mwdb");
  }
};

struct PlannedRobot {
  RobotId id;
  TierId edge;
  std::filesystem::path log;
};
struct RunPlan {
  std::vector<PlannedRobot> robots;  // by id; without a coordinator each has an edge
  std::vector<TierId> edges;         // sorted; without a coordinator each has robots
  NetworkOptions network;            // traces by their full paths
  std::filesystem::path model;       // the coordinator's, in full; may be empty
};

// What the configuration says of a robot; ContractViolation where it lists none of this name.
RobotEntry robot_entry(const RunConfiguration&, const RobotId&);
// What the configuration says of an edge; the defaults where it lists none of this name.
EdgeEntry edge_entry(const RunConfiguration&, const TierId&);

// The tier that fuses everything; no edge is called so.
TierId cloud_tier();

// Logs are looked for beside the file that names them, or where the program was started. Throws Error, saying where in the file: kBadInput
// for no robots, two with one id, names that cannot be, an edge that no robot uses, edges that cannot hold all robots, a wire between two
// that are none; kMissing for a robot without a log, a log, a trace or a model that is not there.
RunPlan make_plan(const RunConfiguration&, const Origins&);

// The configuration as it was carried out: robots by id, each with its edge and the full path of its log.
RunConfiguration effective(RunConfiguration, const RunPlan&);

// What a map's folder holds beside map.mwdb. `title` stands above the picture where the options have none.
exporters::MapFolderOptions folder_options(const OutputOptions&, const std::string& title);

// Letters that names cannot have become '-'; shortened; may be empty.
std::string made_valid(std::string name);

// "office east.rawlog.gz" -> "office-east": a name made of what a file is called.
std::string name_of_file(const std::filesystem::path&);

}  // namespace mapweave::runtime
