#include "cameras_record.h"

#include "record_json.h"

#include <mapweave/core/hash.h>

#include <algorithm>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::json;
using scheduling::member;
using scheduling::refuse;

const std::string kKey = "cameras";

// The numbers of a report, for who writes them and who reads them.
template <class Report, class Visit>
void visit_numbers(Report& report, const Visit& visit) {
  visit("frames", report.frames);
  visit("tracked", report.tracked);
  visit("lost", report.lost);
  visit("keyframes", report.keyframes);
  visit("landmarks", report.landmarks);
  visit("sessions", report.sessions);
  visit("longest_loss_s", report.longest_loss_s);
  visit("sent_bytes", report.sent_bytes);
  visit("received_bytes", report.received_bytes);
  visit("passed_on_bytes", report.passed_on_bytes);
  visit("borrowed", report.borrowed);
  visit("forgotten", report.forgotten);
  visit("kept", report.kept);
  visit("shared_keyframes", report.shared_keyframes);
  visit("dropped_shared", report.dropped_shared);
  visit("found_by_shared", report.found_by_shared);
  visit("loops_on_shared", report.loops_on_shared);
  visit("tracking_mean_ms", report.tracking_mean_ms);
  visit("tracking_p99_ms", report.tracking_p99_ms);
  visit("keyframe_mean_ms", report.keyframe_mean_ms);
  visit("packing_mean_ms", report.packing_mean_ms);
  visit("readout_s", report.readout_s);
  visit("inverse_depth_offset", report.inverse_depth_offset);
}

void take(const Json& json, const char* name, double& number, const std::string& where) {
  number = number_of(member(json, name, where, kKey), where, name);
}
void take(const Json& json, const char* name, std::uint64_t& number, const std::string& where) {
  const std::int64_t value = whole_number_of(member(json, name, where, kKey), where, name);
  if (value < 0) refuse("a count is not negative", where, name, "");
  number = static_cast<std::uint64_t>(value);
}

Json report_json(const CameraReport& report) {
  Json json = {{"label", report.label}, {"kind", report.kind}, {"loops", Json::array()}, {"traffic", Json::array()}};
  visit_numbers(report, [&](const char* name, const auto& number) { json[name] = number; });
  for (const CameraReport::Loop& loop : report.loops) json["loops"].push_back({loop.found_s, loop.applied_s});
  for (const CameraReport::Traffic& one : report.traffic)
    json["traffic"].push_back({one.second, one.sent_bytes, one.received_bytes});
  return json;
}

const Json& list_of(const Json& json, const char* name, std::size_t most, const std::string& where) {
  const Json& list = runtime::list_of(json, where, name);
  if (list.size() != most) refuse("a list of " + std::to_string(most) + " was expected", where, name, "");
  return list;
}

CameraReport report_from(const Json& json, const std::string& where) {
  CameraReport report;
  report.label = text_of(member(json, "label", where, kKey), where, "label");
  report.kind = text_of(member(json, "kind", where, kKey), where, "kind");
  visit_numbers(report, [&](const char* name, auto& number) { take(json, name, number, where); });
  for (const Json& loop : runtime::list_of(member(json, "loops", where, kKey), where, "loops")) {
    list_of(loop, "loops", 2, where);
    report.loops.push_back({number_of(loop[0], where, "loops"), number_of(loop[1], where, "loops")});
  }
  for (const Json& one : runtime::list_of(member(json, "traffic", where, kKey), where, "traffic")) {
    list_of(one, "traffic", 3, where);
    const auto count = [&](std::size_t i) {
      return static_cast<std::uint64_t>(std::max<std::int64_t>(0, whole_number_of(one[i], where, "traffic")));
    };
    report.traffic.push_back({count(0), count(1), count(2)});
  }
  return report;
}

std::string hex_of(const std::vector<std::uint8_t>& bytes) {
  return to_hex(std::string_view(reinterpret_cast<const char*>(bytes.data()), bytes.size()));
}

std::vector<std::uint8_t> bytes_of(const std::string& hex, const std::string& where) {
  const auto digit = [&](char letter) {
    if (letter >= '0' && letter <= '9') return letter - '0';
    if (letter < 'a' || letter > 'f') refuse("a picture that is none", where, "grey", "");
    return letter - 'a' + 10;
  };
  std::vector<std::uint8_t> bytes(hex.size() / 2);
  for (std::size_t i = 0; i < bytes.size(); ++i)
    bytes[i] = static_cast<std::uint8_t>(16 * digit(hex[2 * i]) + digit(hex[2 * i + 1]));
  return bytes;
}

Json frame_json(const exporters::SheetFrame& frame) {
  Json tracks = Json::array();
  for (const exporters::SheetTrack& track : frame.tracks) {
    Json pixels = Json::array();
    for (const auto& [x, y] : track.pixels) pixels.push_back({x, y});
    tracks.push_back({{"depth_m", track.depth_m}, {"pixels", std::move(pixels)}});
  }
  return {{"width", frame.width},
          {"height", frame.height},
          {"caption", frame.caption},
          {"grey", hex_of(frame.grey)},
          {"tracks", std::move(tracks)}};
}

exporters::SheetFrame frame_from(const Json& json, const std::string& where) {
  constexpr double kWidest = 10000.0;
  exporters::SheetFrame frame;
  const auto size = [&](const char* name) {
    return static_cast<int>(scheduling::number(member(json, name, where, kKey), 1.0, kWidest, false, where, name));
  };
  frame.width = size("width");
  frame.height = size("height");
  frame.caption = text_of(member(json, "caption", where, kKey), where, "caption");
  frame.grey = bytes_of(text_of(member(json, "grey", where, kKey), where, "grey"), where);
  if (frame.grey.size() != static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height))
    refuse("a picture lacks pixels, or has too many", where, "grey", "");
  for (const Json& one : runtime::list_of(member(json, "tracks", where, kKey), where, "tracks")) {
    exporters::SheetTrack& track = frame.tracks.emplace_back();
    track.depth_m = static_cast<float>(number_of(member(one, "depth_m", where, kKey), where, "depth_m"));
    for (const Json& pixel : runtime::list_of(member(one, "pixels", where, kKey), where, "pixels")) {
      list_of(pixel, "pixels", 2, where);
      track.pixels.emplace_back(static_cast<float>(number_of(pixel[0], where, "pixels")),
                                static_cast<float>(number_of(pixel[1], where, "pixels")));
    }
  }
  return frame;
}

Json camera_json(const CameraResult& camera) {
  Json json = {{"report", report_json(camera.report)}, {"notes", camera.notes}, {"sheet", Json::array()}};
  json["chosen"] = {{"label", camera.chosen.label}, {"kind", std::string(camera.chosen.kind->name)}};
  for (const exporters::SheetFrame& frame : camera.sheet) json["sheet"].push_back(frame_json(frame));
  return json;
}

CameraResult camera_from(const Json& json, const std::string& where) {
  CameraResult camera;
  camera.report = report_from(member(json, "report", where, kKey), where);
  camera.notes = texts_of(member(json, "notes", where, kKey), where, "notes");
  const Json& chosen = member(json, "chosen", where, kKey);
  camera.chosen.label = text_of(member(chosen, "label", where, kKey), where, "label");
  camera.chosen.kind = sensor_kind(text_of(member(chosen, "kind", where, kKey), where, "kind"));
  if (camera.chosen.kind == nullptr || camera.chosen.kind->task != SensorTask::frames)
    refuse("this is no kind of camera", where, "kind", "");
  for (const Json& frame : runtime::list_of(member(json, "sheet", where, kKey), where, "sheet"))
    camera.sheet.push_back(frame_from(frame, where));
  return camera;
}

Json map_json(const CameraMap& map) {
  Json trajectories = Json::array();
  for (const FrameTrajectory& one : map.trajectories)
    trajectories.push_back({{"label", one.label},
                            {"robot_from_optical", json_of(one.robot_from_optical)},
                            {"frames", json_of(one.frames)}});
  return {{"id", map.map.id.str()},
          {"trajectories", std::move(trajectories)},
          {"rig",
           {{"cameras", map.rig.cameras},
            {"constraints", map.rig.constraints},
            {"apart_before_m", map.rig.apart_before_m},
            {"apart_after_m", map.rig.apart_after_m},
            {"optimised", map.rig.optimised}}}};
}

CameraMap map_from(const Json& json, const std::string& where) {
  CameraMap map;
  map.map.id = MapId(scheduling::name(member(json, "id", where, kKey), where, "id"));
  for (const Json& one : runtime::list_of(member(json, "trajectories", where, kKey), where, "trajectories"))
    map.trajectories.push_back({text_of(member(one, "label", where, kKey), where, "label"),
                                poses_of(member(one, "frames", where, kKey), where, "frames"),
                                pose_of(member(one, "robot_from_optical", where, kKey), where, "robot_from_optical")});
  if (map.trajectories.empty()) refuse("a map of no camera", where, "trajectories", "");
  const Json& rig = member(json, "rig", where, kKey);
  map.rig.cameras = texts_of(member(rig, "cameras", where, kKey), where, "cameras");
  take(rig, "constraints", map.rig.constraints, where);
  take(rig, "apart_before_m", map.rig.apart_before_m, where);
  take(rig, "apart_after_m", map.rig.apart_after_m, where);
  map.rig.optimised = member(rig, "optimised", where, kKey) == true;
  return map;
}

Json spoken_json(const rig::SpokenPoses& spoken) {
  Json poses = Json::array();
  for (const rig::SensorPose& pose : spoken.poses)
    poses.push_back({pose.stamp.ns, pose.session, json_of(pose.map_from_robot)});
  const rig::PoseSensor& sensor = spoken.sensor;
  return {{"name", sensor.name},
          {"is_laser", sensor.is_laser},
          {"is_metric", sensor.is_metric},
          {"robot_from_sensor", json_of(sensor.robot_from_sensor)},
          {"poses", std::move(poses)}};
}

rig::SpokenPoses spoken_from(const Json& json, const std::string& where) {
  constexpr std::int64_t kMostSessions = 1 << 30;
  rig::SpokenPoses spoken;
  spoken.sensor = {text_of(member(json, "name", where, kKey), where, "name"),
                   member(json, "is_laser", where, kKey) == true, member(json, "is_metric", where, kKey) == true,
                   pose_of(member(json, "robot_from_sensor", where, kKey), where, "robot_from_sensor")};
  for (const Json& one : runtime::list_of(member(json, "poses", where, kKey), where, "poses")) {
    list_of(one, "poses", 3, where);
    const std::int64_t session = whole_number_of(one[1], where, "poses");
    if (session < -kMostSessions || session > kMostSessions) refuse("a session that is none", where, "poses", "");
    spoken.poses.push_back(
        {{whole_number_of(one[0], where, "poses")}, static_cast<int>(session), pose_of(one[2], where, "poses")});
    if (spoken.poses.size() > 1 && spoken.poses.back().stamp < spoken.poses[spoken.poses.size() - 2].stamp)
      refuse("stamps run backwards", where, "poses", "");
  }
  return spoken;
}

}  // namespace

Json json_of(const CamerasOutcome& cameras) {
  Json json = {{"notes", cameras.notes},
               {"doubts", cameras.doubts},
               {"odometry", json_of(cameras.odometry)},
               {"wheels", json_of(cameras.wheels)},
               {"log_seconds", cameras.log_seconds},
               {"cpu_seconds", cameras.cpu_seconds}};
  json["cameras"] = json["maps"] = json["live"] = Json::array();
  for (const CameraResult& camera : cameras.cameras) json["cameras"].push_back(camera_json(camera));
  for (const CameraMap& map : cameras.maps) json["maps"].push_back(map_json(map));
  for (const rig::SpokenPoses& spoken : cameras.live) json["live"].push_back(spoken_json(spoken));
  return json;
}

CamerasOutcome cameras_of(const Json& json, const std::string& where) {
  CamerasOutcome cameras;
  if (!json.is_object()) refuse("an object was expected", where, kKey, "");
  cameras.notes = texts_of(member(json, "notes", where, kKey), where, "notes");
  cameras.doubts = texts_of(member(json, "doubts", where, kKey), where, "doubts");
  cameras.odometry = poses_of(member(json, "odometry", where, kKey), where, "odometry");
  cameras.wheels = poses_of(member(json, "wheels", where, kKey), where, "wheels");
  take(json, "log_seconds", cameras.log_seconds, where);
  take(json, "cpu_seconds", cameras.cpu_seconds, where);
  for (const Json& one : runtime::list_of(member(json, "cameras", where, kKey), where, "cameras"))
    cameras.cameras.push_back(camera_from(one, where));
  for (const Json& one : runtime::list_of(member(json, "maps", where, kKey), where, "maps"))
    cameras.maps.push_back(map_from(one, where));
  for (const Json& one : runtime::list_of(member(json, "live", where, kKey), where, "live"))
    cameras.live.push_back(spoken_from(one, where));
  return cameras;
}

}  // namespace mapweave::runtime
