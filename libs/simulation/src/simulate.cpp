#include <mapweave/simulation/simulate.h>

#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/rawlog/rawlog_writer.h>
#include <mapweave/simulation/observations.h>
#include <mapweave/simulation/world.h>

#include <array>
#include <cinttypes>
#include <cmath>
#include <cstdio>

namespace mapweave::simulation {
namespace {

std::string truth_line(const SimulatedStep& step) {
  const Pose2& pose = step.world_from_robot;
  std::array<char, 160> line;
  const int length = std::snprintf(line.data(), line.size(), "%" PRId64 ".%06" PRId64 " %.6f %.6f 0.000000 0.000000 0.000000 %.6f %.6f\n",
                                   step.stamp.ns / 1'000'000'000, step.stamp.ns % 1'000'000'000 / 1000, pose.x, pose.y,
                                   std::sin(0.5 * pose.phi), std::cos(0.5 * pose.phi));
  return {line.data(), static_cast<std::size_t>(length)};
}

SimulatedLog write_robot(const World& world, std::size_t robot, const std::filesystem::path& folder, Progress& progress) {
  const std::string name = world.robot_id(robot).str();
  const int task = progress.begin("simulate " + name, world.scan_count(robot), "scans");
  SimulatedLog log{name, 0, world.trajectory(robot).length_m(), world.trajectory(robot).duration_s()};
  std::string truth;
  rawlog::RawlogWriter writer(folder / (name + ".rawlog"));
  Recording recording(world, robot);
  while (const auto step = recording.next()) {
    writer.add(*odometry_observation(*step));
    if (step->ranges.empty()) continue;
    writer.add(*scan_observation(*step, world.options().laser));
    truth += truth_line(*step);
    ++log.scans;
    if (log.scans % 64 == 0) {
      throw_if_interrupted();
      progress.advance(task, log.scans);
    }
  }
  writer.close();
  write_file(folder / (name + ".truth.tum"), truth);
  progress.advance(task, log.scans);
  progress.end(task);
  return log;
}

std::string run_configuration(const WorldOptions& options) {
  std::string text = "# A simulated world, seed " + std::to_string(options.seed) + ": mapweave run run.yaml --out DIR\nrobots:\n";
  int turn = 0;
  for (const RobotOptions& robot : options.robots) {
    const std::string edge = robot.edge.empty() ? "edge" + std::to_string(turn++ % options.edges) : robot.edge;
    text += "  - {id: \"" + robot.id + "\", log: \"" + robot.id + ".rawlog\", edge: \"" + edge + "\"}\n";
  }
  return text;
}

}  // namespace

std::vector<SimulatedLog> simulate(const WorldOptions& options, const std::filesystem::path& folder, WorkerPool& pool, Progress& progress) {
  const World world(options, pool);
  auto logs = pool.map(world.robot_count(), [&](std::size_t robot) { return write_robot(world, robot, folder, progress); });
  write_file(folder / "run.yaml", run_configuration(world.options()));
  return logs;
}

}  // namespace mapweave::simulation
