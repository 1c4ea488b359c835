#include "robot_record.h"

#include <mapweave/runtime/json_text.h>
#include <mapweave/scheduling/json_fields.h>

#include <cmath>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::json;
using scheduling::member;
using scheduling::refuse;

constexpr double kMost = 1e15;
constexpr std::size_t kMostBytes = std::size_t{1} << 30;
constexpr std::size_t kPoseNumbers = 8;  // stamp in nanoseconds, t, q as x, y, z, w

Json json_of(const std::vector<StampedPose>& poses) {
  Json list = Json::array();
  for (const StampedPose& pose : poses) {
    const Pose3& p = pose.map_from_robot;
    list.push_back({pose.stamp.ns, p.t.x(), p.t.y(), p.t.z(), p.q.x(), p.q.y(), p.q.z(), p.q.w()});
  }
  return list;
}

std::vector<StampedPose> poses_of(const Json& list, const std::string& where, const std::string& key) {
  constexpr double kUnit = 1e-6;
  if (!list.is_array()) refuse("a list of poses was expected", where, key, "");
  std::vector<StampedPose> poses;
  poses.reserve(list.size());
  for (const Json& one : list) {
    if (!one.is_array() || one.size() != kPoseNumbers || !one[0].is_number_integer())
      refuse("a pose is a stamp and seven numbers", where, key, "");
    double numbers[kPoseNumbers] = {};
    for (std::size_t i = 1; i < kPoseNumbers; ++i)
      numbers[i] = scheduling::number(one[i], -kMost, kMost, false, where, key);
    StampedPose pose;
    pose.stamp.ns = one[0].get<std::int64_t>();
    pose.map_from_robot.t = {numbers[1], numbers[2], numbers[3]};
    pose.map_from_robot.q = Eigen::Quaterniond(numbers[7], numbers[4], numbers[5], numbers[6]);
    if (std::abs(pose.map_from_robot.q.norm() - 1.0) > kUnit) refuse("a rotation that is none", where, key, "");
    if (!poses.empty() && pose.stamp < poses.back().stamp) refuse("stamps run backwards", where, key, "");
    poses.push_back(pose);
  }
  return poses;
}

std::string text_of(const Json& value, const std::string& where, const std::string& key) {
  if (!value.is_string()) refuse("a text was expected", where, key, "");
  return value.get<std::string>();
}

Json json_of(const Error& error) {
  return {{"code", static_cast<int>(error.code())},
          {"problem", error.problem()},
          {"where", error.where()},
          {"remedy", error.remedy()}};
}

Error error_of(const Json& json, const std::string& where) {
  const std::string key = "trouble";
  if (!json.is_object()) refuse("an object was expected", where, key, "");
  const double code = scheduling::number(member(json, "code", where, key), 0.0,
                                         static_cast<double>(ErrorCode::kInternal), false, where, key + ".code");
  return Error(static_cast<ErrorCode>(static_cast<int>(code)), text_of(member(json, "problem", where, key), where, key),
               text_of(member(json, "where", where, key), where, key),
               text_of(member(json, "remedy", where, key), where, key));
}

std::string hex_or_nothing(const RobotRecord& record) { return record.log.empty() ? "" : to_hex(record.log_sha256); }

Hash hash_of_hex(const std::string& hex, const std::string& where) {
  Hash hash;
  const std::string digits = "0123456789abcdef";
  if (hex.size() != 2 * hash.bytes.size() || hex.find_first_not_of(digits) != std::string::npos)
    refuse("a checksum was expected", where, "log_sha256", "");
  for (std::size_t i = 0; i < hash.bytes.size(); ++i)
    hash.bytes[i] = static_cast<std::uint8_t>(16 * digits.find(hex[2 * i]) + digits.find(hex[2 * i + 1]));
  return hash;
}

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
  const Json& notes = member(json, "notes", where, "");
  if (!notes.is_array()) refuse("a list was expected", where, "notes", "");
  for (const Json& note : notes) record.notes.push_back(text_of(note, where, "notes"));
  record.log = text_of(member(json, "log", where, ""), where, "log");
  if (!record.log.empty())
    record.log_sha256 = hash_of_hex(text_of(member(json, "log_sha256", where, ""), where, "log_sha256"), where);
  record.sensor = scheduling::name(member(json, "sensor", where, ""), where, "sensor");
  record.live = poses_of(member(json, "live", where, ""), where, "live");
  record.odometry = poses_of(member(json, "odometry", where, ""), where, "odometry");
  return record;
}

RobotResult result_of(RobotRecord record, std::optional<Map> map, const PlannedRobot& robot,
                      const RunConfiguration& configuration) {
  RobotResult result;
  result.outcome = {robot.id, std::move(map), record.trouble, record.helper_s};
  result.report.id = result.work.id = robot.id;
  result.report.edge = result.work.edge = robot.edge;
  result.report.scans = record.scans;
  result.report.log_seconds = result.work.log_s = record.log_s;
  result.report.wall_seconds = record.wall_s;
  result.report.cpu_seconds = result.work.mapping_s = record.mapping_s + record.helper_s;
  result.report.mapped = result.outcome.map.has_value();
  result.report.trouble = record.trouble;
  result.work.sensed_bytes = record.sensed_bytes;
  result.work.map_bytes = record.map_bytes;
  result.notes = std::move(record.notes);
  if (!record.log.empty()) result.input = InputFile{record.log, record.log_sha256};
  std::vector<rig::SpokenPoses> sensors;
  if (!record.live.empty()) {
    sensors.emplace_back();
    sensors.back().sensor = {record.sensor, true, true, {}};
    for (const StampedPose& pose : record.live) sensors.back().poses.push_back({pose.stamp, 0, pose.map_from_robot});
  }
  fuse_poses(robot.id, configuration_of(configuration, robot), std::move(sensors), record.odometry, result);
  return result;
}

}  // namespace mapweave::runtime
