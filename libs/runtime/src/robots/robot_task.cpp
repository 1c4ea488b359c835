#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/core/stopwatch.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/memory.h>
#include <mapweave/runtime/metrics.h>
#include <mapweave/runtime/robot_task.h>

#include <algorithm>
#include <iterator>

namespace mapweave::runtime {
namespace {

// Reads a task's log; true where an interruption ended it that is to be lived with.
template <class Task>
bool is_cut_short(Task& task, const MappingSettings& settings, bool can_end_early) {
  try {
    task.advance(std::nullopt, settings.give_up);
    return false;
  } catch (const Interrupted&) {
    if (!settings.saves_part || settings.give_up) throw;
    if (!can_end_early)
      throw Interrupted(
          "interrupted before a map was finished; nothing was written (rbpf and icp have a map at their "
          "end alone; laser.engine=graph saves what it has)");
    clear_interrupt();
    return true;
  }
}

// What the robot's sensors said while it drove.
struct Spoken {
  std::vector<rig::SpokenPoses> sensors;
  std::vector<StampedPose> odometry;
};

// The laser, at the edge or on the robot.
void map_by_laser(const PlannedRobot& robot, const MappingSettings& settings, std::optional<LaserOutcome> mapped,
                  RobotResult& result, Spoken& live) {
  if (!mapped) {
    LaserTask task(robot, settings.configuration, settings.keep_going, false, settings.progress);
    result.report.is_cut_short =
        is_cut_short(task, settings, settings.configuration.laser.engine == laser::Engine::graph);
    mapped = task.finish();
  } else {
    result.report.cpu_seconds += mapped->cpu_seconds;
  }
  result.outcome = std::move(mapped->outcome);
  result.work = mapped->work;
  result.work.id = robot.id;
  result.work.edge = robot.edge;
  result.notes = mapped->notes;
  if (!mapped->live.poses.empty()) live.sensors.push_back(std::move(mapped->live));
  live.odometry = std::move(mapped->odometry);
  result.report.scans = mapped->scans;
  result.report.log_seconds = mapped->log_seconds;
}

// Cameras on the robot; with a map of the laser, which is there already, in one graph.
void map_by_cameras(const PlannedRobot& robot, const MappingSettings& settings, std::optional<CamerasOutcome> cameras,
                    RobotResult& result, Spoken& live) {
  const RunConfiguration& configuration = settings.configuration;
  if (result.report.is_cut_short) return;  // what the laser has is saved
  if (cameras) {
    result.report.cpu_seconds += cameras->cpu_seconds;
  } else {
    CameraTask task(robot, configuration, settings.keep_going, settings.progress);
    result.report.is_cut_short = is_cut_short(task, settings, true);
    cameras = task.finish();
  }
  take_cameras(std::move(*cameras), configuration, result, {live.sensors, live.odometry});
}

}  // namespace

void take_cameras(CamerasOutcome cameras, const RunConfiguration& configuration, RobotResult& result, LiveInputs live) {
  const RobotId robot = cameras.robot.id;
  result.cameras = std::move(cameras);
  for (rig::SpokenPoses& camera : result.cameras.live) live.sensors.push_back(std::move(camera));
  if (live.odometry.empty()) live.odometry = std::move(result.cameras.wheels);
  for (const std::string& doubt : result.cameras.doubts)
    if (std::find(result.notes.begin(), result.notes.end(), doubt) == result.notes.end()) result.notes.push_back(doubt);
  tiers::RobotOutcome& outcome = result.outcome;
  outcome.robot = robot;
  if (outcome.map && result.cameras.maps.empty()) {
    log(LogLevel::warning,
        "robot " + robot.str() + " is mapped by its laser alone: " + std::string(result.cameras.trouble->what()));
    return;
  }
  if (!outcome.trouble) outcome.trouble = result.cameras.trouble;
  result.report.log_seconds = std::max(result.report.log_seconds, result.cameras.log_seconds);
  for (const CameraResult& camera : result.cameras.cameras) result.report.cameras.push_back(camera.report);
  if (!result.cameras.maps.empty()) result.report.rig = result.cameras.maps.front().rig;
  std::vector<Map> seen;
  for (const CameraMap& map : result.cameras.maps) seen.push_back(map.map);
  if (outcome.map && !seen.empty()) {
    rig::LaserCameraMap both =
        rig::align_cameras(std::move(*outcome.map), seen, configuration.laser_cameras, configuration.fusion.solve);
    outcome.map = std::move(both.map);
    const auto is_apart = [&](const Map& map) {
      return std::find(both.apart.begin(), both.apart.end(), map.id) != both.apart.end();
    };
    seen.erase(std::remove_if(seen.begin(), seen.end(), [&](const Map& map) { return !is_apart(map); }), seen.end());
    for (std::size_t i = 0; i < seen.size(); ++i) seen[i].id = MapId(robot.str() + "." + std::to_string(i + 1));
    outcome.apart = std::move(seen);
  } else if (!seen.empty()) {
    outcome.map = std::move(seen.front());
    outcome.apart.assign(std::make_move_iterator(seen.begin() + 1), std::make_move_iterator(seen.end()));
  }
}

void fuse_poses(const RobotId& robot, const RunConfiguration& configuration, std::vector<rig::SpokenPoses> sensors,
                const std::vector<StampedPose>& odometry, RobotResult& result) {
  if (!result.outcome.map) return;
  if (sensors.empty()) {
    if (configuration.output.tum && configuration.laser.engine != laser::Engine::graph)
      result.notes.push_back("robot " + robot.str() +
                             ": there is no robot.tum: the laser engines rbpf and icp say where the robot was at their "
                             "end alone (laser.engine=graph says it as it comes)");
    return;
  }
  result.pose = rig::fused_poses(std::move(sensors), odometry, configuration.pose);
  result.report.pose = result.pose.report;
}

RobotResult map_robot(const PlannedRobot& robot, const MappingSettings& settings, MappedTogether mapped) {
  RobotResult result;
  result.report.id = robot.id;
  result.report.edge = robot.edge;
  result.work.id = robot.id;
  result.work.edge = robot.edge;
  const double mapped_before_s =
      (mapped.laser ? mapped.laser->cpu_seconds : 0.0) + (mapped.cameras ? mapped.cameras->cpu_seconds : 0.0);

  const Stopwatch watch;
  const double cpu_before = thread_cpu_seconds();
  Spoken live;
  try {
    result.input = InputFile{robot.log.string(), hash_of_input(robot.log)};
    if (robot.trouble) throw *robot.trouble;
    if (robot.sensors.scans != nullptr) map_by_laser(robot, settings, std::move(mapped.laser), result, live);
    const bool go_on = !result.outcome.trouble || settings.keep_going;
    if (!robot.sensors.cameras.empty() && go_on) {
      const double by_laser_s = thread_cpu_seconds(), shared_s = mapped.cameras ? mapped.cameras->cpu_seconds : 0.0;
      map_by_cameras(robot, settings, std::move(mapped.cameras), result, live);
      result.work.seeing_s = shared_s + thread_cpu_seconds() - by_laser_s;
    }
  } catch (const Error& error) {
    result.outcome = {robot.id, std::nullopt, error};
  }
  fuse_poses(robot.id, settings.configuration, std::move(live.sensors), live.odometry, result);
  return_free_memory();  // of the engine, which has ended
  result.report.wall_seconds = mapped_before_s + watch.seconds();
  result.report.cpu_seconds += thread_cpu_seconds() - cpu_before + result.outcome.helper_cpu_seconds;
  result.report.mapped = result.outcome.map.has_value();
  result.work.log_s = result.report.log_seconds;
  result.report.trouble = result.outcome.trouble;
  return result;
}

}  // namespace mapweave::runtime
