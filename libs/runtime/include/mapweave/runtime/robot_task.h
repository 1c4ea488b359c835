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
  rig::FusedTrajectory pose;  // the robot's pose while it drove, by all its sensors
  RobotReport report;
  RobotWork work;
  std::vector<std::string> notes;  // implausible numbers of the log
  std::optional<InputFile> input;  // the log; none where it cannot be read
};

// How a run maps its robots.
struct MappingSettings {
  const RunConfiguration& configuration;
  bool keep_going;
  bool saves_part;                   // an interruption ends the log, as if it were cut short there
  const std::atomic<bool>& give_up;  // becomes true where another robot's trouble ends the run
  Progress& progress;
};
// What was mapped together with others already.
struct MappedTogether {
  std::optional<LaserOutcome> laser;
  std::optional<CamerasOutcome> cameras;
};

// Reads the whole log, or up to trouble, which stands in the outcome; what came before it is mapped with `keep_going`
// only. A log that cannot be read and an engine that cannot start are trouble too. Throws Interrupted alone: after a
// signal, or when `give_up` becomes true. With `saves_part` a signal ends the log where it comes, once there is
// something of it (not with the laser engines rbpf and icp, which have a map at their end alone); the report says so,
// and the signal is forgotten. The plan's sensors are chosen.
RobotResult map_robot(const PlannedRobot&, const MappingSettings&, MappedTogether = {});

// What sensors said while the robot drove, to be added to.
struct LiveInputs {
  std::vector<rig::SpokenPoses>& sensors;
  std::vector<StampedPose>& odometry;
};
// Adds what the robot's cameras left: their maps, in one graph with a map of the laser that is there already.
void take_cameras(CamerasOutcome cameras, const RunConfiguration& configuration, RobotResult& result, LiveInputs live);

// Adds the robot's pose as it came, by what its sensors said while it drove, or a note on why there is none.
void fuse_poses(const RobotId& robot, const RunConfiguration& configuration, std::vector<rig::SpokenPoses> sensors,
                const std::vector<StampedPose>& odometry, RobotResult& result);

}  // namespace mapweave::runtime
