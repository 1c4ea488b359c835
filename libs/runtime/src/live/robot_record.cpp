#include "robot_record.h"

#include "cameras_record.h"
#include "record_json.h"

#include <mapweave/runtime/json_text.h>

#include <algorithm>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::json;
using scheduling::member;
using scheduling::refuse;

constexpr double kMost = 1e15;
constexpr std::size_t kMostBytes = std::size_t{1} << 30;

std::string hex_or_nothing(const RobotRecord& record) { return record.log.empty() ? "" : to_hex(record.log_sha256); }

}  // namespace

std::string encode(const RobotRecord& record) {
  nlohmann::ordered_json json;
  json["robot"] = record.robot.str();
  if (record.trouble) json["trouble"] = json_of(*record.trouble);
  json["scans"] = record.scans;
  json["lost_scans"] = record.lost_scans;
  json["sensed_bytes"] = record.sensed_bytes;
  json["map_bytes"] = record.map_bytes;
  json["log_seconds"] = record.log_s;
  json["mapping_cpu_seconds"] = record.mapping_s;
  json["helper_cpu_seconds"] = record.helper_s;
  json["wall_seconds"] = record.wall_s;
  json["notes"] = record.notes;
  json["log"] = record.log;
  json["log_sha256"] = hex_or_nothing(record);
  json["sensor"] = record.sensor;
  json["live"] = json_of(record.live);
  json["odometry"] = json_of(record.odometry);
  if (record.cameras) json["cameras"] = json_of(*record.cameras);
  if (record.has_laser_map) json["has_laser_map"] = *record.has_laser_map;
  if (record.camera_trouble) json["camera_trouble"] = json_of(*record.camera_trouble);
  return json_text(json, -1);
}

RobotRecord decode_robot_record(std::string_view bytes, const std::string& where) {
  if (bytes.size() > kMostBytes) throw Error(ErrorCode::kCorrupt, "a report of too many bytes", where);
  const Json json = scheduling::parse_json(bytes, where);
  if (!json.is_object()) refuse("an object was expected", where, "", "");
  const auto number = [&](const char* key) {
    return scheduling::number(member(json, key, where, ""), 0.0, kMost, false, where, key);
  };
  const auto count = [&](const char* key) { return static_cast<std::uint64_t>(number(key)); };
  RobotRecord record;
  record.robot = RobotId(scheduling::name(member(json, "robot", where, ""), where, "robot"));
  if (json.contains("trouble")) record.trouble = error_of(json["trouble"], where);
  record.scans = count("scans");
  record.lost_scans = count("lost_scans");
  record.sensed_bytes = count("sensed_bytes");
  record.map_bytes = count("map_bytes");
  record.log_s = number("log_seconds");
  record.mapping_s = number("mapping_cpu_seconds");
  record.helper_s = number("helper_cpu_seconds");
  record.wall_s = number("wall_seconds");
  record.notes = texts_of(member(json, "notes", where, ""), where, "notes");
  record.log = text_of(member(json, "log", where, ""), where, "log");
  if (!record.log.empty())
    record.log_sha256 = hash_of_hex(text_of(member(json, "log_sha256", where, ""), where, "log_sha256"), where);
  record.sensor = scheduling::name(member(json, "sensor", where, ""), where, "sensor");
  record.live = poses_of(member(json, "live", where, ""), where, "live");
  record.odometry = poses_of(member(json, "odometry", where, ""), where, "odometry");
  if (json.contains("cameras")) record.cameras = cameras_of(json["cameras"], where);
  if (json.contains("has_laser_map")) {
    if (!json["has_laser_map"].is_boolean()) refuse("true or false was expected", where, "has_laser_map", "");
    record.has_laser_map = json["has_laser_map"].get<bool>();
  }
  if (json.contains("camera_trouble")) record.camera_trouble = error_of(json["camera_trouble"], where);
  return record;
}

MapId name_of_map(const RobotId& robot, std::size_t number) {
  return MapId(number == 0 ? robot.str() : robot.str() + "." + std::to_string(number));
}

namespace {

// The maps of its cameras, those that came, by the names under which they travelled.
void give_back(std::vector<Map> maps, const PlannedRobot& robot, bool is_one_further, const RunConfiguration& own,
               CamerasOutcome& cameras) {
  std::vector<CameraMap> known;
  for (std::size_t i = 0; i < cameras.maps.size(); ++i) {
    CameraMap& camera = cameras.maps[i];
    const MapId travelled = name_of_map(robot.id, i + (is_one_further ? 1 : 0));
    const auto map =
        std::find_if(maps.begin(), maps.end(), [&](const Map& one) { return one.id == travelled && !one.empty(); });
    if (map == maps.end()) continue;
    map->id = camera.map.id;
    camera.map = std::move(*map);
    camera.trajectory = robot_trajectory_of(camera.map, camera.trajectories, cameras.odometry, own.rig.trajectory);
    known.push_back(std::move(camera));
  }
  cameras.maps = std::move(known);
}

}  // namespace

RobotResult result_of(RobotRecord record, std::vector<Map> maps, const PlannedRobot& robot,
                      const RunConfiguration& configuration) {
  RobotResult result;
  result.report.id = result.work.id = robot.id;
  result.report.edge = result.work.edge = robot.edge;
  result.report.scans = record.scans;
  result.report.wall_seconds = record.wall_s;
  result.report.cpu_seconds = result.work.mapping_s = record.mapping_s + record.helper_s;
  result.work.sensed_bytes = record.sensed_bytes;
  result.work.map_bytes = record.map_bytes;
  result.notes = std::move(record.notes);
  if (!record.log.empty()) result.input = InputFile{record.log, record.log_sha256};
  const RunConfiguration& own = configuration_of(configuration, robot);
  std::vector<rig::SpokenPoses> sensors;
  if (!record.live.empty()) {
    sensors.emplace_back();
    sensors.back().sensor = {record.sensor, true, true, {}};
    for (const StampedPose& pose : record.live) sensors.back().poses.push_back({pose.stamp, 0, pose.map_from_robot});
  }
  const bool has_laser_map = record.has_laser_map.value_or(!record.cameras);
  if (!record.cameras || record.has_laser_map) {
    result.outcome = {robot.id, std::nullopt, record.trouble, record.helper_s};
    result.report.log_seconds = record.log_s;
  }
  if (has_laser_map && !maps.empty() && maps.front().id == name_of_map(robot.id, 0))
    result.outcome.map = std::move(maps.front());
  if (record.cameras) {
    CamerasOutcome& cameras = *record.cameras;
    cameras.robot = robot;
    cameras.trouble = record.has_laser_map ? record.camera_trouble : record.trouble;
    give_back(std::move(maps), robot, has_laser_map, own, cameras);
    result.work.seeing_s = cameras.cpu_seconds;
    take_cameras(std::move(cameras), own, result, {sensors, record.odometry});
  }
  result.work.log_s = result.report.log_seconds;
  result.report.mapped = result.outcome.map.has_value();
  result.report.trouble = result.outcome.trouble;
  fuse_poses(robot.id, own, std::move(sensors), record.odometry, result);
  return result;
}

}  // namespace mapweave::runtime
