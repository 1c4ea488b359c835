#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/core/stopwatch.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/memory.h>
#include <mapweave/runtime/metrics.h>
#include <mapweave/runtime/robot_task.h>
#include <mapweave/tiers/robot_agent.h>

#include <algorithm>
#include <iterator>

namespace mapweave::runtime {
namespace {

// From the agent to the instance: as bytes where they are not in one place. Counts what it costs.
class Wire {
 public:
  Wire(tiers::RobotSlam& slam, bool is_remote, RobotWork& work) : slam_(slam), is_remote_(is_remote), work_(work) {}

  // What the agent packs, if anything.
  template <class Pack>
  std::optional<tiers::RobotOutcome> carry(Pack&& pack) {
    const double before_s = thread_cpu_seconds();
    std::optional<Sensed> sensed = pack();
    std::string bytes;
    if (sensed && is_remote_) bytes = encode(*sensed);
    const double packed_s = thread_cpu_seconds();
    (is_remote_ ? work_.packing_s : work_.mapping_s) += packed_s - before_s;
    work_.sensed_bytes += bytes.size();
    if (!sensed) return std::nullopt;
    auto outcome = slam_.step(is_remote_ ? decode_sensed(bytes, "what the robot sensed") : std::move(*sensed));
    work_.mapping_s += thread_cpu_seconds() - packed_s;
    return outcome;
  }

 private:
  tiers::RobotSlam& slam_;
  bool is_remote_;
  RobotWork& work_;
};

// Feeds the log to the agent and its messages to the instance; answers the instance's last word where it has one before the log's end.
std::optional<tiers::RobotOutcome> replay(const PlannedRobot& robot, const rawlog::ReadOptions& reading, tiers::RobotAgent& agent,
                                          Wire& wire, const std::atomic<bool>& give_up, Progress& progress) {
  constexpr std::uint64_t kKilobyte = 1000;
  const auto log = rawlog::open_log(robot.log, reading);
  ProgressTask task(progress, "robot " + robot.id.str(), log->bytes_total() / kKilobyte, "kB");
  while (const auto record = log->next()) {
    throw_if_interrupted();
    if (give_up) throw Error(ErrorCode::kInterrupted, "given up, because another robot failed", "robot " + robot.id.str());
    if (auto outcome = wire.carry([&] { return agent.step(*record); })) return outcome;
    task.advance(log->bytes_read() / kKilobyte);
  }
  return std::nullopt;
}

tiers::RobotOutcome outcome_of(const PlannedRobot& robot, const rawlog::ReadOptions& reading, tiers::RobotAgent& agent, Wire& wire,
                               bool keep_going, const std::atomic<bool>& give_up, Progress& progress) {
  std::optional<Error> trouble;
  try {
    if (auto outcome = replay(robot, reading, agent, wire, give_up, progress)) return std::move(*outcome);
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted) throw;
    if (!keep_going) return {robot.id, std::nullopt, error};
    trouble = error;
  }
  progress.say("robot " + robot.id.str() + ": " + std::to_string(agent.scans()) + " scans read; now the end of the mapping");
  return *wire.carry([&] { return std::optional(agent.end(std::move(trouble))); });
}

// The laser, at the edge or on the robot.
void map_by_laser(const PlannedRobot& robot, const RunConfiguration& configuration, bool keep_going, const std::atomic<bool>& give_up,
                  Progress& progress, RobotResult& result) {
  tiers::RobotAgent agent(robot.id, configuration.laser.scan, robot.log.string());
  try {
    tiers::RobotSlam slam(robot.id, laser::make_laser_mapper({robot.id, SensorId("laser")}, configuration.laser, configuration.seed));
    Wire wire(slam, configuration.mode == Mode::offload, result.work);
    result.outcome = outcome_of(robot, configuration.reading, agent, wire, keep_going, give_up, progress);
    result.work.mapping_s += result.outcome.helper_cpu_seconds;
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted) throw;
    result.outcome = {robot.id, std::nullopt, error};
  }
  result.report.scans = agent.scans();
  result.report.log_seconds = agent.seconds();
  for (const auto& [label, count] : agent.packer().ignored_lasers())
    log(LogLevel::info, "robot " + robot.id.str() + ": " + std::to_string(count) + " scans of laser '" + label + "' are not used; '" +
                            agent.packer().label() + "' is (choose with --set laser.scan.label=...)");
  if (agent.packer().unusable() > 0)
    log(LogLevel::warning,
        "robot " + robot.id.str() + ": " + std::to_string(agent.packer().unusable()) + " records made no sense and were left out");
}

// Cameras on the robot; with a map of the laser, which is there already, in one graph.
void map_by_cameras(const PlannedRobot& robot, const ChosenSensors& chosen, const RunConfiguration& configuration, bool keep_going,
                    const std::atomic<bool>& give_up, Progress& progress, std::optional<CamerasOutcome> cameras, RobotResult& result) {
  if (cameras) {
    result.report.cpu_seconds += cameras->cpu_seconds;
    result.cameras = std::move(*cameras);
  } else {
    CameraTask task(robot, chosen, configuration, keep_going, progress);
    task.advance(std::nullopt, give_up);
    result.cameras = task.finish();
  }
  tiers::RobotOutcome& outcome = result.outcome;
  outcome.robot = robot.id;
  if (outcome.map && result.cameras.maps.empty()) {
    log(LogLevel::warning, "robot " + robot.id.str() + " is mapped by its laser alone: " + std::string(result.cameras.trouble->what()));
    return;
  }
  if (!outcome.trouble) outcome.trouble = result.cameras.trouble;
  result.report.log_seconds = std::max(result.report.log_seconds, result.cameras.log_seconds);
  for (const CameraResult& camera : result.cameras.cameras) result.report.cameras.push_back(camera.report);
  if (!result.cameras.maps.empty()) result.report.rig = result.cameras.maps.front().rig;
  std::vector<Map> seen;
  for (const CameraMap& map : result.cameras.maps) seen.push_back(map.map);
  if (outcome.map && !seen.empty()) {
    fusion::BoundMap both = fusion::bound(std::move(*outcome.map), seen, configuration.bind, configuration.fusion.solve);
    outcome.map = std::move(both.map);
    const auto is_apart = [&](const Map& map) { return std::find(both.apart.begin(), both.apart.end(), map.id) != both.apart.end(); };
    seen.erase(std::remove_if(seen.begin(), seen.end(), [&](const Map& map) { return !is_apart(map); }), seen.end());
    for (std::size_t i = 0; i < seen.size(); ++i) seen[i].id = MapId(robot.id.str() + "." + std::to_string(i + 1));
    outcome.apart = std::move(seen);
  } else if (!seen.empty()) {
    outcome.map = std::move(seen.front());
    outcome.apart.assign(std::make_move_iterator(seen.begin() + 1), std::make_move_iterator(seen.end()));
  }
}

}  // namespace

RobotResult map_robot(const PlannedRobot& robot, const RunConfiguration& configuration, bool keep_going, const std::atomic<bool>& give_up,
                      Progress& progress, std::optional<CamerasOutcome> cameras) {
  RobotResult result;
  result.report.id = robot.id;
  result.report.edge = robot.edge;
  result.work.id = robot.id, result.work.edge = robot.edge;

  const Stopwatch watch;
  const double cpu_before = thread_cpu_seconds();
  try {
    result.input = InputFile{robot.log.string(), hash_of_input(robot.log)};
    const ChosenSensors chosen = choose_sensors(robot.log, configuration);
    if (chosen.laser) map_by_laser(robot, configuration, keep_going, give_up, progress, result);
    const bool go_on = !result.outcome.trouble || keep_going;
    if (!chosen.cameras.empty() && go_on) {
      const double by_laser_s = thread_cpu_seconds(), shared_s = cameras ? cameras->cpu_seconds : 0.0;
      map_by_cameras(robot, chosen, configuration, keep_going, give_up, progress, std::move(cameras), result);
      result.work.seeing_s = shared_s + thread_cpu_seconds() - by_laser_s;
    }
  } catch (const Error& error) {
    if (error.code() == ErrorCode::kInterrupted) throw;
    result.outcome = {robot.id, std::nullopt, error};
  }
  return_free_memory();  // of the engine, which has ended
  result.report.wall_seconds = watch.seconds();
  result.report.cpu_seconds += thread_cpu_seconds() - cpu_before + result.outcome.helper_cpu_seconds;
  result.report.mapped = result.outcome.map.has_value();
  result.work.log_s = result.report.log_seconds;
  result.report.trouble = result.outcome.trouble;
  return result;
}

}  // namespace mapweave::runtime
