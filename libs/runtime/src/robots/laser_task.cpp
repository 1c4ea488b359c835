#include <mapweave/core/format.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/fusion/visit_audit.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/runtime/laser_task.h>
#include <mapweave/runtime/metrics.h>
#include <mapweave/tiers/robot_agent.h>

#include "plan/log_parts.h"
#include "robot_log.h"

#include <string>
#include <utility>
#include <vector>

namespace mapweave::runtime {

struct LaserTask::State {
  PlannedRobot robot;
  const RunConfiguration& configuration;
  Progress& progress;
  bool keep_going, is_remote, may_move;
  tiers::RobotAgent agent;
  std::optional<tiers::RobotSlam> slam;
  RobotLog log;
  std::vector<std::string> sensed;  // kept for another edge
  RobotWork work;
  rig::SpokenPoses live;
  std::vector<StampedPose> odometry;
  std::optional<tiers::RobotOutcome> outcome;

  State(const PlannedRobot& planned, const RunConfiguration& options, Progress& shown, bool lives_with_trouble,
        bool moves)
      : robot(planned),
        configuration(options),
        progress(shown),
        keep_going(lives_with_trouble),
        is_remote(options.mode == Mode::offload),
        may_move(moves && is_remote),
        agent(planned.id, laser::scan_input_of(options.laser), planned.log.string()),
        log(planned) {
    live.sensor = {std::string(planned.sensors.scans->name), true, true, {}};
  }

  void begin_mapping() {
    slam.emplace(robot.id, laser::make_laser_mapper({robot.robot(), SensorId(std::string(robot.sensors.scans->name))},
                                                    configuration.laser, configuration.seed));
  }

  // From the agent to the instance what it packs, if anything: as bytes where they are not in one place. Counts what
  // that costs.
  template <class Pack>
  void carry(Pack&& pack) {
    const double before_s = thread_cpu_seconds();
    std::optional<Sensed> message = pack();
    std::string bytes;
    if (message && is_remote) bytes = encode(*message);
    const double packed_s = thread_cpu_seconds();
    (is_remote ? work.packing_s : work.mapping_s) += packed_s - before_s;
    work.sensed_bytes += bytes.size();
    if (!message) return;
    log.units.look_at(*message);
    if (const auto* wheels = std::get_if<Pose3>(&message->body)) odometry.push_back({message->stamp, *wheels});
    const double looked_s = thread_cpu_seconds();
    auto ended = slam->step(is_remote ? decode_sensed(bytes, "what the robot sensed") : std::move(*message));
    work.mapping_s += thread_cpu_seconds() - looked_s;
    for (const laser::LivePose& pose : slam->take_live_poses())
      if (pose.is_matched) live.poses.push_back({pose.stamp, 0, pose.map_from_robot});
    if (may_move) sensed.push_back(std::move(bytes));
    if (ended) {
      outcome = std::move(*ended);
      log.next.reset();
    }
  }
};

LaserTask::LaserTask(const PlannedRobot& robot, const RunConfiguration& configuration, bool keep_going, bool may_move,
                     Progress& progress)
    : state_(new State(robot, configuration, progress, keep_going, may_move)) {
  state_->log.guarded([&] {
    state_->begin_mapping();
    auto log = rawlog::open_log(robot.log, configuration.reading);
    if (robot.part) log = part_of(std::move(log), *robot.part);
    if (const auto as_scans = robot.sensors.scans->as_scans) log = as_scans(std::move(log));
    state_->log.begin(std::move(log), progress);
  });
}
LaserTask::~LaserTask() = default;
LaserTask::LaserTask(LaserTask&&) noexcept = default;

std::optional<Stamp> LaserTask::next() const {
  return state_->log.next ? std::optional(state_->log.next->stamp) : std::nullopt;
}
const std::optional<Error>& LaserTask::trouble() const { return state_->log.trouble; }
std::uint64_t LaserTask::scans() const { return state_->agent.scans(); }
std::uint64_t LaserTask::sensed_bytes() const { return state_->work.sensed_bytes; }

void LaserTask::advance(std::optional<Stamp> until, const std::atomic<bool>& give_up) {
  State& state = *state_;
  state.log.guarded([&] {
    state.log.advance(until, give_up, [&](const rawlog::Record& record) {
      state.carry([&] { return state.agent.step(record); });
      return !state.outcome;
    });
  });
}

void LaserTask::move() {
  State& state = *state_;
  if (!state.may_move || state.sensed.empty() || state.outcome) return;
  state.log.guarded([&] {
    const double before_s = thread_cpu_seconds();
    state.begin_mapping();
    for (const std::string& bytes : state.sensed) {
      state.work.repeated_bytes += bytes.size();
      if (auto ended = state.slam->step(decode_sensed(bytes, "what the robot sensed"))) {
        state.outcome = std::move(*ended);
        state.log.next.reset();
      }
    }
    state.slam->take_live_poses();  // they were said before
    state.work.repeated_s += thread_cpu_seconds() - before_s;
  });
}

Map LaserTask::map_so_far() { return state_->slam && !state_->outcome ? state_->slam->map_so_far() : Map(); }

namespace {

std::string note_on_walls(const RobotId& robot, const fusion::DoubledWalls& walls) {
  return format(
      "robot %s: %.0f m of the walls of its own map stand double, most of them around (%.0f, %.0f): what it saw "
      "from %.0f s and from %.0f s on does not agree; look at the map there before you rely on it",
      robot.str().c_str(), walls.length_m, walls.x_m, walls.y_m, walls.first.seconds(), walls.then.seconds());
}

}  // namespace

LaserOutcome LaserTask::finish() {
  State& state = *state_;
  state.log.close();
  LaserOutcome result;
  if (!state.slam || (state.log.trouble && !state.keep_going)) {
    state.outcome = {state.robot.id, std::nullopt, state.log.trouble};
  } else if (!state.outcome) {
    state.progress.say("robot " + state.robot.id.str() + ": " + std::to_string(state.agent.scans()) +
                       " scans read; now the end of the mapping");
    std::optional<Error> trouble = std::exchange(state.log.trouble, std::nullopt);
    state.log.guarded([&] { state.carry([&] { return std::optional(state.agent.end(std::move(trouble))); }); });
    if (!state.outcome) state.outcome = {state.robot.id, std::nullopt, state.log.trouble};
  }
  result.outcome = std::move(*state.outcome);
  if (result.outcome.map && state.robot.part) result.outcome.map->id = MapId(state.robot.id.str());
  result.work = state.work;
  result.work.mapping_s += result.outcome.helper_cpu_seconds;
  result.scans = state.agent.scans();
  result.log_seconds = state.agent.seconds();
  result.cpu_seconds = state.log.cpu_seconds;
  result.live = std::move(state.live);
  result.odometry = std::move(state.odometry);
  result.notes = state.log.units.notes();
  for (const std::string& note : result.outcome.notes)
    result.notes.push_back("robot " + state.robot.id.str() + ": " + note);
  if (result.outcome.map)
    if (const auto walls = fusion::audit_visits(*result.outcome.map))
      result.notes.push_back(note_on_walls(state.robot.id, *walls));
  if (const auto note = note_on_packing(state.robot.id, state.agent.packer(), state.configuration.laser))
    result.notes.push_back(*note);
  return result;
}

}  // namespace mapweave::runtime
