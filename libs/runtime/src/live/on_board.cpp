#include "on_board.h"

#include <mapweave/maps/map_update.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/tiers/edge_server.h>

#include <algorithm>
#include <iterator>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kMostBytes = std::size_t{1} << 30;  // of one map or report

void cut(const std::string& bytes, bool is_report, std::vector<MappedPart>& parts) {
  for (std::size_t begin = 0; begin == 0 || begin < bytes.size(); begin += kMostPartBytes)
    parts.push_back({is_report, begin + kMostPartBytes >= bytes.size(), bytes.substr(begin, kMostPartBytes)});
}

}  // namespace

bool maps_on_board(const PlannedRobot& robot, const RunConfiguration& configuration) {
  return !robot.sensors.cameras.empty() || configuration.mode == Mode::onboard;
}

OnBoardMapping::OnBoardMapping(const PlannedRobot& robot, const RunConfiguration& configuration)
    : robot_(robot), silent_(make_silent_progress()) {
  if (robot.trouble) return;
  const RunConfiguration& own = configuration_of(configuration, robot);
  if (robot.sensors.scans != nullptr) laser_.emplace(robot, own, true, false, *silent_);
  if (!robot.sensors.cameras.empty()) cameras_.emplace(robot, own, true, *silent_);
}
OnBoardMapping::~OnBoardMapping() = default;

std::optional<Stamp> OnBoardMapping::next() const {
  const auto scan = laser_ ? laser_->next() : std::nullopt, frame = cameras_ ? cameras_->next() : std::nullopt;
  return scan && frame ? std::min(*scan, *frame) : scan ? scan : frame;
}

void OnBoardMapping::advance(Stamp until, const std::atomic<bool>& give_up) {
  if (laser_) laser_->advance(until, give_up);
  if (cameras_) cameras_->advance(until, give_up);
}

std::uint64_t OnBoardMapping::seen() {
  std::uint64_t seen = laser_ ? laser_->scans() : 0;
  for (const CameraTask::Client& camera : cameras()) seen += camera.report->frames;
  return seen;
}

std::vector<CameraTask::Client> OnBoardMapping::cameras() {
  return cameras_ ? cameras_->clients() : std::vector<CameraTask::Client>{};
}

void OnBoardMapping::add_laser(RobotRecord& record, std::vector<Map>& maps) {
  LaserOutcome outcome = laser_->finish();
  record.sensor = std::string(robot_.sensors.scans->name);
  record.trouble = std::move(outcome.outcome.trouble);
  record.scans = outcome.scans;
  record.log_s = outcome.log_seconds;
  record.helper_s = outcome.outcome.helper_cpu_seconds;
  record.mapping_s = std::max(0.0, outcome.work.mapping_s - record.helper_s);
  record.notes = std::move(outcome.notes);
  for (const rig::SensorPose& pose : outcome.live.poses) record.live.push_back({pose.stamp, pose.map_from_robot});
  record.odometry = std::move(outcome.odometry);
  if (cameras_) record.has_laser_map = outcome.outcome.map.has_value();
  if (outcome.outcome.map) maps.push_back(std::move(*outcome.outcome.map));
}

void OnBoardMapping::add_cameras(RobotRecord& record, std::vector<Map>& maps) {
  CamerasOutcome outcome = cameras_->finish();
  (record.has_laser_map ? record.camera_trouble : record.trouble) = std::exchange(outcome.trouble, std::nullopt);
  if (!laser_) record.sensor = "camera";
  if (!laser_) record.log_s = outcome.log_seconds;
  for (CameraMap& map : outcome.maps) {
    Map by_id;
    by_id.id = map.map.id;
    map.map.id = name_of_map(robot_.id, maps.size());
    maps.push_back(std::exchange(map.map, std::move(by_id)));
  }
  record.cameras = std::move(outcome);
}

std::vector<Sensed> OnBoardMapping::finish(bool was_asked_to_end, std::vector<std::string> notes) {
  RobotRecord record;
  std::vector<Map> maps;
  if (laser_) add_laser(record, maps);
  if (cameras_) add_cameras(record, maps);
  if (record.sensor.empty()) record.sensor = "laser";
  record.robot = robot_.id;
  if (robot_.trouble) record.trouble = robot_.trouble;
  trouble_ = record.trouble ? record.trouble : record.camera_trouble;
  record.wall_s = watch_.seconds();
  record.notes.insert(record.notes.end(), std::make_move_iterator(notes.begin()), std::make_move_iterator(notes.end()));
  if (was_asked_to_end) record.notes.push_back("robot " + robot_.id.str() + ": its recording was ended on request");
  try {
    record.log_sha256 = hash_of_input(robot_.log);
    record.log = robot_.log.string();
  } catch (const Error&) {  // it cannot be read: that is its trouble already
  }
  std::vector<MappedPart> parts;
  for (const Map& map : maps) cut(tiers::first_update(map, robot_.edge), false, parts);
  cut(encode(record), true, parts);
  std::vector<Sensed> messages;
  const auto say = [&](decltype(Sensed::body) body) {
    Sensed& message = messages.emplace_back();
    message.robot = robot_.id;
    message.sequence = messages.size();
    message.body = std::move(body);
  };
  for (MappedPart& part : parts) say(std::move(part));
  say(StreamEnd{});
  return messages;
}

void OnBoardParts::add(MappedPart part, const RobotId& robot) {
  const std::string where = "what robot " + robot.str() + " mapped";
  if (bytes_.size() + part.bytes.size() > kMostBytes)
    throw Error(ErrorCode::kCorrupt, "a map of more than " + std::to_string(kMostBytes) + " bytes", where);
  bytes_ += part.bytes;
  if (!part.ends) return;
  const std::string bytes = std::exchange(bytes_, {});
  if (part.is_report) {
    RobotRecord report = decode_robot_record(bytes, where);
    if (report.robot != robot)
      throw Error(ErrorCode::kBadInput, "its report is of robot '" + report.robot.str() + "'", where);
    record = std::move(report);
    return;
  }
  const MapUpdate update = decode_map_update(bytes, where);
  const MapId expected = name_of_map(robot, maps.size());
  if (update.origin.map != expected)
    throw Error(ErrorCode::kBadInput,
                "map '" + update.origin.map.str() + "' came where '" + expected.str() + "' was due", where);
  Map map;
  map.id = update.origin.map;
  maps.push_back(updated(std::move(map), update));
}

}  // namespace mapweave::runtime
