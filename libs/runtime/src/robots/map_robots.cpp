#include "map_robots.h"

#include "plan/log_parts.h"
#include "plan/team_options.h"
#include "shared_cameras.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/runtime/sensor_choice.h>

namespace mapweave::runtime {
namespace {

// Bad input is somebody's to mend before half a team's map looks like a whole one; a helper that died is not.
bool ends_the_run(const RobotResult& robot, bool keep_going) {
  const auto& trouble = robot.outcome.trouble;
  return trouble && !keep_going && trouble->code() != ErrorCode::kHelperFailed && !robot.report.is_cut_short;
}

}  // namespace

std::vector<std::optional<RobotResult>> map_robots(const RunConfiguration& configuration, RunPlan& plan,
                                                   const RobotsAround& around, const EarlyEnds& ends, WorkerPool& pool,
                                                   Progress& progress) {
  const bool keep_going = ends.keep_going;
  std::atomic<bool> give_up{false};
  std::map<RobotId, CamerasOutcome> shared;
  std::map<RobotId, LaserOutcome> lasers;
  const std::vector<Map> no_maps;
  try {
    choose_sensors(plan, configuration, pool);
    if (around.starts != nullptr) expect_same_senses(*around.starts, plan);
    divide_logs(plan, configuration, pool);
    if (around.coordinated != nullptr || around.rounds != nullptr) {
      LasersInStep in_step(configuration, plan, keep_going, around.coordinated != nullptr, progress);
      lasers = map_in_step(in_step, around.coordinated, around.rounds, pool);
    }
    expect_agreement(configuration, plan);
    if (configuration.server.share != tiers::Sharing::none)
      shared = map_shared_cameras(configuration, plan, around.starts != nullptr ? around.starts->maps : no_maps,
                                  keep_going, pool, progress);
  } catch (const Interrupted&) {
    return std::vector<std::optional<RobotResult>>(plan.robots.size());
  }
  const auto expect_sound = [&](const std::vector<std::optional<RobotResult>>& robots) {
    for (const auto& robot : robots)
      if (robot && ends_the_run(*robot, keep_going)) throw *robot->outcome.trouble;
  };
  if (around.cluster != nullptr) {
    auto robots = map_on_cluster(configuration, plan, *around.cluster, progress);
    expect_sound(robots);
    return robots;
  }
  auto robots = pool.map(plan.robots.size(), [&](std::size_t i) -> std::optional<RobotResult> {
    try {
      const auto cameras = shared.find(plan.robots[i].id);
      const auto laser = lasers.find(plan.robots[i].id);
      MappedTogether mapped;
      if (laser != lasers.end()) mapped.laser = std::move(laser->second);
      if (cameras != shared.end()) mapped.cameras = std::move(cameras->second);
      RobotResult result =
          map_robot(plan.robots[i],
                    {configuration_of(configuration, plan.robots[i]), keep_going, ends.saves_part, give_up, progress},
                    std::move(mapped));
      if (ends_the_run(result, keep_going)) give_up = true;
      return result;
    } catch (const Interrupted&) {
      if (ends.saves_part) throw;
      return std::nullopt;
    }
  });
  expect_sound(robots);
  return robots;
}

}  // namespace mapweave::runtime
