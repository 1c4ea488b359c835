#include "export_request.h"

#include <mapweave/core/error.h>
#include <mapweave/exporters/session_trajectories.h>
#include <mapweave/runtime/stored_depth.h>

#include <algorithm>

namespace mapweave::app {
namespace {

template <class Kind>
bool holds_any(const Map& map) {
  return std::any_of(map.nodes.begin(), map.nodes.end(), [](const auto& entry) {
    return entry.second.payload != nullptr && std::holds_alternative<Kind>(*entry.second.payload);
  });
}

std::string text_of(const std::vector<RobotId>& robots) {
  std::string text;
  for (const RobotId& robot : robots) text += (text.empty() ? "" : ", ") + robot.str();
  return text;
}

void expect_logs(const ExportRequest& request, const Map& map) {
  if (!request.ply && has_walls(map)) return;
  const std::vector<RobotId> robots = runtime::robots_with_depth(map);
  if (robots.empty())
    throw Error(ErrorCode::kBadInput, "no depth camera and no stereo pair left keyframes in map '" + map.id.str() + "'",
                request.ply ? "--ply" : "--octomap", "map with one: slam LOG --sensor rgbd or stereo");
  for (const RobotId& robot : without_log(request, map))
    throw Error(ErrorCode::kMissing,
                "depth is in the robots' logs, and that of robot '" + robot.str() +
                    "' is not known: no config.yaml beside the map names one that is still there",
                request.ply ? "--ply" : "--octomap", "name it: --log " + robot.str() + "=PATH");
}

}  // namespace

std::vector<RobotId> without_log(const ExportRequest& request, const Map& map) {
  std::vector<RobotId> robots = runtime::robots_with_depth(map);
  robots.erase(std::remove_if(robots.begin(), robots.end(),
                              [&](const RobotId& robot) { return request.logs.count(robot) != 0; }),
               robots.end());
  return robots;
}

ExportRequest request_of(const exporters::MapFolderFiles& flags, bool ply, bool octomap,
                         const runtime::OutputOptions& output) {
  ExportRequest request{flags, ply || output.ply, octomap || output.octomap, true, {}};
  request.files.g2o = flags.g2o || output.g2o;
  if (flags.png || flags.pgm || flags.pcd || flags.tum || flags.g2o || ply || octomap) return request;
  request.is_explicit = false;
  request.files.png = output.png;
  request.files.pgm = output.pgm;
  request.files.pcd = output.pcd;
  request.files.tum = output.tum;
  return request;
}

bool has_walls(const Map& map) { return holds_any<PackedScan>(map) || holds_any<OccupancyGrid>(map); }

ExportRequest possible(ExportRequest request, const Map& map) {
  const bool can_draw = has_walls(map);
  const auto leave_out = [&](bool& file, bool can, const char* flag, const char* needs) {
    if (file && !can && request.is_explicit)
      throw Error(ErrorCode::kBadInput, std::string("needs ") + needs + ", and map '" + map.id.str() + "' has none",
                  flag, "leave the flag out");
    file = file && can;
  };
  exporters::MapFolderFiles& files = request.files;
  leave_out(files.png, can_draw || !map.landmarks.empty(), "--png", "a laser's scans, a grid or cameras' landmarks");
  leave_out(files.pgm, can_draw, "--pgm", "a laser's scans or a grid (of cameras' landmarks --png draws a picture)");
  leave_out(files.pcd, can_draw || !map.landmarks.empty(), "--pcd", "a laser's scans, a grid or cameras' landmarks");
  leave_out(files.tum, !exporters::session_trajectories(map).empty(), "--tum", "poses of robots");
  leave_out(files.g2o, !map.nodes.empty(), "--g2o", "nodes");
  if (request.wants_depth()) expect_logs(request, map);
  if (!files.png && !files.pgm && !files.pcd && !files.tum && !files.g2o && !request.wants_depth())
    throw Error(ErrorCode::kBadInput, "there is nothing to write of map '" + map.id.str() + "'", {},
                "choose what to write: --png, --pgm, --pcd, --tum, --g2o, --ply, --octomap");
  return request;
}

Map part_of_robot(const Map& map, const std::string& robot) {
  const std::vector<RobotId> robots = map.robots();
  if (std::none_of(robots.begin(), robots.end(), [&](const RobotId& id) { return id.str() == robot; }))
    throw Error(ErrorCode::kUsage, "map '" + map.id.str() + "' has no robot '" + robot + "'", "--robot",
                "it has: " + text_of(robots));
  const auto is_its = [&](const SessionId& session) { return session.client.robot.str() == robot; };
  Map part;
  part.id = MapId(robot);
  for (const auto& [id, node] : map.nodes)
    if (is_its(id.session)) part.nodes.set(id, node);
  for (const auto& [id, submap] : map.submaps)
    if (is_its(id.session)) part.submaps.set(id, submap);
  for (const auto& [id, constraint] : map.constraints)
    if (part.nodes.find(id.from) != nullptr && part.nodes.find(id.to) != nullptr) part.constraints.set(id, constraint);
  for (const auto& [id, shared] : map.landmarks) {
    Landmark landmark = shared;
    landmark.seen.erase(
        std::remove_if(landmark.seen.begin(), landmark.seen.end(),
                       [&](const LandmarkSighting& sighting) { return part.nodes.find(sighting.node) == nullptr; }),
        landmark.seen.end());
    if (landmark.seen.empty()) continue;
    if (part.nodes.find(landmark.anchor) == nullptr) {  // another robot's, which this one saw
      const Eigen::Vector3d point =
          transformed(landmark.point_in_anchor(), map.nodes.find(landmark.anchor)->map_from_node);
      landmark.anchor = landmark.seen.front().node;
      landmark.point_units =
          landmark_units(transformed(point, inverse(part.nodes.find(landmark.anchor)->map_from_node)));
    }
    part.landmarks.set(id, landmark);
  }
  return part;
}

std::map<RobotId, std::filesystem::path> given_logs(const std::vector<std::string>& texts,
                                                    const std::vector<RobotId>& robots) {
  std::map<RobotId, std::filesystem::path> logs;
  for (const std::string& text : texts) {
    const auto named = std::find_if(robots.begin(), robots.end(), [&](const RobotId& robot) {
      return text.compare(0, robot.str().size() + 1, robot.str() + "=") == 0;
    });
    if (named == robots.end() && robots.size() != 1)
      throw Error(ErrorCode::kUsage, "'" + text + "' names none of the robots with depth: " + text_of(robots), "--log",
                  "write ROBOT=PATH");
    const RobotId robot = named == robots.end() ? robots.front() : *named;
    const std::filesystem::path log = named == robots.end() ? text : text.substr(robot.str().size() + 1);
    std::error_code ignored;
    if (!std::filesystem::exists(log, ignored))
      throw Error(ErrorCode::kMissing, "there is no log", log.string(), "check the path that --log names");
    logs[robot] = log;
  }
  return logs;
}

}  // namespace mapweave::app
