// mapweave export: a map -> pictures, grids, clouds, trajectories.

#include "configuration.h"
#include "export_request.h"
#include "output_file.h"
#include "recording_files.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/log.h>
#include <mapweave/exporters/ros_recording.h>
#include <mapweave/exporters/trajectory_files.h>
#include <mapweave/fusion/compose_grid.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/map_input.h>
#include <mapweave/runtime/map_names.h>
#include <mapweave/runtime/map_slabs.h>
#include <mapweave/runtime/stored_depth.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <memory>
#include <optional>
#include <set>

namespace mapweave::app {
namespace {

struct Arguments {
  std::filesystem::path map;
  std::string robot;
  std::vector<std::string> logs;
  exporters::MapFolderFiles files{false, false, false, false, false, false};
  bool ply = false, octomap = false;
  RecordingFiles recordings;
  WritingFlags flags;
  bool wants_folder() const { return !flags.out.empty(); }
};

// One map of what is exported, and what is to be written of it.
struct Exported {
  Map map;
  ExportRequest request;
  OccupancyGrid grid;  // composed, where it is asked for
  std::vector<exporters::MapSlab> slabs = {};
  MapIdentity identity = {};  // of the whole map
};

// Poses of optical frames at keyframes, by the name of their file.
std::map<std::string, std::vector<StampedPose>> optical_trajectories(const Map& map) {
  std::map<ClientId, std::vector<StampedPose>> cameras;
  std::map<RobotId, std::set<SensorId>> cameras_of;
  for (const auto& [id, node] : map.nodes)
    if (const KeyframeFeatures* keyframe = keyframe_of(node)) {
      cameras[id.session.client].push_back(
          {node.stamp, compose(node.map_from_node, keyframe->geometry->robot_from_camera)});
      cameras_of[id.session.client.robot].insert(id.session.client.sensor);
    }
  std::map<std::string, std::vector<StampedPose>> files;
  for (auto& [camera, poses] : cameras) {
    const std::string robot = camera.robot.str();
    if (cameras.size() == 1)
      files["trajectory.optical.tum"] = std::move(poses);
    else if (cameras_of[camera.robot].size() == 1)
      files["trajectories/optical/" + robot + ".tum"] = std::move(poses);
    else
      files["trajectories/optical/" + robot + "." + camera.sensor.str() + ".tum"] = std::move(poses);
  }
  return files;
}

std::vector<std::string> write(const std::filesystem::path& folder, const Exported& exported,
                               const runtime::RunConfiguration& configuration) {
  exporters::MapFolderOptions options = runtime::folder_options(configuration.output, "map " + exported.map.id.str());
  options.files = exported.request.files;
  options.identity = exported.identity;
  std::vector<std::string> written;
  for (const auto& file : exporters::write_map_folder(folder, exported.map, exported.grid, options))
    written.push_back(file.string());
  if (exported.request.files.tum)
    for (const auto& [name, poses] : optical_trajectories(exported.map)) {
      std::filesystem::create_directories((folder / name).parent_path());
      write_file(folder / name, exporters::tum_text(poses));
      written.push_back(name);
    }
  if (!exported.request.wants_depth()) return written;
  const std::string map = "map " + exported.map.id.str();
  for (const RobotId& robot : without_log(exported.request, exported.map))
    log(LogLevel::warning, map + ": the OctoMap holds none of the depth that robot " + robot.str() +
                               "'s cameras saw: its log is not known (--log " + robot.str() + "=PATH)");
  runtime::RunConfiguration depth = configuration;
  depth.output.ply = exported.request.ply;
  depth.output.octomap = exported.request.octomap;
  for (const std::string& note : runtime::write_stored_depth(folder, exported.map, exported.request.logs,
                                                             exported.slabs, depth, *make_terminal_progress()))
    log(LogLevel::warning, map + ": " + note);
  if (exported.request.ply) written.insert(written.end(), {"map.ply", "map.dense.pcd"});
  if (exported.request.octomap) written.insert(written.end(), {"map.bt", "map.ot"});
  return written;
}

// All that can fail for want of something in the maps.
std::vector<Exported> prepared(const Arguments& arguments, const std::vector<Map>& maps,
                               const std::filesystem::path& file, const runtime::RunConfiguration& configuration) {
  std::vector<Exported> result;
  WorkerPool pool(threads_of(arguments.flags));
  const auto holds_robot = [&](const Map& map) {
    const std::vector<RobotId> robots = map.robots();
    return std::any_of(robots.begin(), robots.end(), [&](const RobotId& id) { return id.str() == arguments.robot; });
  };
  const bool is_found = std::any_of(maps.begin(), maps.end(), holds_robot);
  for (const Map& whole : maps) {
    if (!arguments.robot.empty() && is_found && !holds_robot(whole)) continue;
    Exported one{arguments.robot.empty() ? whole : part_of_robot(whole, arguments.robot), {}, {}};
    if (arguments.recordings.any() && has_walls(one.map))
      one.grid = fusion::compose_grid(one.map, configuration.compose, pool);
    if (!arguments.wants_folder()) {
      result.push_back(std::move(one));
      continue;
    }
    ExportRequest request = request_of(arguments.files, arguments.ply, arguments.octomap, configuration.output);
    if (request.wants_depth()) {
      request.logs = given_logs(arguments.logs, runtime::robots_with_depth(one.map));
      request.logs.merge(runtime::logs_of_results(file));
    }
    one.request = possible(request, one.map);
    const exporters::MapFolderFiles& files = one.request.files;
    if ((files.png || files.pgm) && one.grid.empty() && has_walls(one.map))
      one.grid = fusion::compose_grid(one.map, configuration.compose, pool);
    if (one.request.octomap) one.slabs = runtime::slabs_of(one.map, one.grid, configuration, pool);
    if (one.grid.empty() && (files.pgm || (files.png && one.map.landmarks.empty())) && one.request.is_explicit)
      throw Error(ErrorCode::kBadInput, "map '" + one.map.id.str() + "' cannot be drawn: its scans saw nothing",
                  files.pgm ? "--pgm" : "--png", "leave the flag out");
    result.push_back(std::move(one));
  }
  return result;
}

void expect_somewhere_to_write(const Arguments& arguments) {
  if (arguments.wants_folder()) return;
  const exporters::MapFolderFiles& files = arguments.files;
  const bool wants_files =
      files.png || files.pgm || files.pcd || files.tum || files.g2o || arguments.ply || arguments.octomap;
  if (wants_files || !arguments.recordings.any())
    throw Error(ErrorCode::kUsage, "a folder for the files is missing", "--out",
                "name one: --out DIR (--bag FILE and --mcap FILE alone need none)");
}

// The folder of results, without recordings. Returns its files' names.
std::vector<std::string> write_folder(OutputFolder& folder, const Arguments& arguments,
                                      const std::vector<Exported>& all, const runtime::MapInput& input,
                                      runtime::RunConfiguration configuration) {
  std::vector<std::string> written;
  for (const Exported& one : all) {
    const std::filesystem::path below = all.size() == 1 ? "" : one.map.id.str();
    for (const std::string& file : write(folder.staging() / below, one, configuration))
      written.push_back((below / file).string());
  }
  const ExportRequest asked = request_of(arguments.files, arguments.ply, arguments.octomap, configuration.output);
  auto& output = configuration.output;
  output.png = asked.files.png;
  output.pgm = asked.files.pgm;
  output.pcd = asked.files.pcd;
  output.tum = asked.files.tum;
  output.g2o = asked.files.g2o;
  output.ply = asked.ply;
  output.octomap = asked.octomap;
  write_file(folder.staging() / "config.yaml", to_yaml(configuration));
  std::vector<runtime::InputFile> read;
  for (const std::filesystem::path& file : input.files) read.push_back({file.string(), hash_of_file(file)});
  const auto manifest = runtime::manifest_json("export", configuration.seed, read, folder.staging());
  write_file(folder.staging() / "manifest.json", runtime::json_text(manifest) + "\n");
  return written;
}

std::vector<RecordingBytes> recordings_of(const std::vector<Exported>& all, const Arguments& arguments,
                                          const runtime::RunConfiguration& configuration) {
  std::vector<exporters::RecordedMap> maps;
  for (const Exported& one : all)
    maps.push_back({&one.map, &one.grid,
                    arguments.recordings.any()
                        ? exporters::map_cloud(one.map, runtime::folder_options(configuration.output, "").cloud)
                        : std::vector<exporters::ColouredPoint>()});
  return recordings_of(maps, arguments.recordings);
}

ExitCode export_map(const Arguments& arguments) {
  expect_somewhere_to_write(arguments);
  const runtime::RunConfiguration configuration = load_configuration({}, {}, arguments.flags).configuration;
  const runtime::MapInput input = runtime::read_map_input(arguments.map, MapId(runtime::name_of_file(arguments.map)));
  expect_free(arguments.recordings, input.files, arguments.flags.force);

  std::optional<OutputFolder> folder;
  if (arguments.wants_folder()) {
    expect_outside(arguments.flags.out, {arguments.map});
    folder.emplace(arguments.flags.out, arguments.flags.force);
  }
  std::vector<Exported> all = prepared(arguments, input.maps, input.files.front(), configuration);
  if (all.size() == 1 && arguments.robot.empty()) all.front().identity = input.identity;
  const std::vector<RecordingBytes> recordings = recordings_of(all, arguments, configuration);
  std::vector<std::string> written, shown;
  if (folder) {
    written = write_folder(*folder, arguments, all, input, configuration);
    folder->commit();
    for (const std::string& file : written) shown.push_back((folder->goal() / file).string());
  }
  for (const RecordingBytes& recording : recordings) {
    write_output({recording.path, input.files, recording.ending}, recording.bytes);
    written.push_back(recording.path.string());
    shown.push_back(recording.path.string());
  }

  if (arguments.flags.json) std::printf("%s\n", runtime::json_text(written).c_str());
  for (const std::string& file : shown)
    if (!arguments.flags.json) std::printf("%s\n", file.c_str());
  return ExitCode::done;
}

}  // namespace

Action set_up_export(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("MAP", arguments->map,
                  "a map of mapweave (.mwdb), a folder that holds one, a live camera map server's journal (.mwj), or a "
                  "map_server grid (.yaml); without one of the flags below what output.* switches on is written, as "
                  "far as the map can give it")
      ->required();
  verb.add_flag("--png", arguments->files.png,
                "map.png, and map.color.png with the robots' trajectories; of cameras alone the landmarks from above");
  verb.add_flag("--pgm", arguments->files.pgm, "map.pgm and map.yaml, as map_server and nav2 load them");
  verb.add_flag("--pcd", arguments->files.pcd, "map.pcd, the points of the walls, and landmarks");
  verb.add_flag("--tum", arguments->files.tum,
                "trajectory.tum, of several robots trajectories/ROBOT.tum; of cameras their optical frames' as well");
  verb.add_flag("--g2o", arguments->files.g2o, "map.g2o, the pose graph; of cameras with landmarks and sightings");
  verb.add_flag("--ply", arguments->ply,
                "map.ply and map.dense.pcd, the surfaces that depth cameras saw; needs the log");
  verb.add_flag("--octomap", arguments->octomap,
                "map.bt and map.ot, OctoMaps: of lasers and grids a slab, of depth cameras the same as --ply, which "
                "needs the log");
  verb.add_option(
          "--bag", arguments->recordings.bag,
          "a bag of ROS 1 with the grid, the points of the walls, each robot's path and poses (tf), for RViz and "
          "Foxglove; alone it needs no --out")
      ->type_name("FILE");
  verb.add_option("--mcap", arguments->recordings.mcap,
                  "the same as an MCAP file of ROS 2, for RViz, Foxglove and Lichtblick")
      ->type_name("FILE");
  verb.add_option("--log", arguments->logs,
                  "where a robot's log is, for --ply and --octomap; without it: as config.yaml beside the map says")
      ->type_name("[ROBOT=]PATH")
      ->allow_extra_args(false);
  verb.add_option("--robot", arguments->robot, "one robot of a team, in the team's frame")->type_name("NAME");
  add_writing_flags(verb, arguments->flags);
  verb.get_option("--out")->required(false);
  return [arguments] { return export_map(*arguments); };
}

}  // namespace mapweave::app
