#pragma once
// One robot from its log to its map: the log's reader, the robot's agent and its SLAM instance at the edge, or its
// cameras' clients, wired in one thread.

#include <mapweave/core/progress.h>
#include <mapweave/runtime/camera_task.h>
#include <mapweave/runtime/laser_task.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/report.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/tiers/robot_slam.h>

#include <atomic>
#include <optional>

namespace mapweave::runtime {

struct RobotResult {
  tiers::RobotOutcome outcome;
  CamerasOutcome cameras;  // its maps are those of `outcome`, or in the one graph there with the laser's; empty where
                           // no camera maps
  RobotReport report;
  RobotWork work;
  std::optional<InputFile> input;  // the log; none where it cannot be read
};

// Reads the whole log, or up to trouble, which stands in the outcome; what came before it is mapped with `keep_going`
// only. A log that cannot be read and an engine that cannot start are trouble too. Throws Interrupted alone: after a
// signal, or when `give_up` becomes true. `laser`, `cameras`: where they were mapped together with those of others
// already.
RobotResult map_robot(const PlannedRobot&, const RunConfiguration&, bool keep_going, const std::atomic<bool>& give_up,
                      Progress&, std::optional<LaserOutcome> laser = std::nullopt,
                      std::optional<CamerasOutcome> cameras = std::nullopt);

}  // namespace mapweave::runtime
