#pragma once
// All robots of a run from their logs to their maps, each a task of the worker pool.

#include "coordinated_robots.h"
#include "plan/start_maps.h"
#include "team/fusion_rounds.h"

#include <mapweave/runtime/cluster.h>
#include <mapweave/runtime/robot_task.h>

#include <optional>
#include <vector>

namespace mapweave::runtime {

// What may end a robot's log early.
struct EarlyEnds {
  bool keep_going = false;  // trouble with it, which is lived with
  bool saves_part = false;  // an interruption (map_robot); of one robot alone, not of cameras that share while they map
};

// What is there beside the robots; each may be null. The first two look at lasers' maps while they grow: robots are
// driven together then.
struct RobotsAround {
  CoordinatedRobots* coordinated = nullptr;
  FusionRounds* rounds = nullptr;
  const StartMaps* starts = nullptr;  // that cameras which share know from the start
  const Cluster* cluster = nullptr;   // whose workers map; without the first two
};

// Chooses the sensors of the plan, and maps. Every robot of the plan, nullopt for those that were interrupted. Throws
// Error(kBadInput) for start maps of other sensors, the first trouble with a robot, unless it is to be lived with,
// and Interrupted where that says more.
std::vector<std::optional<RobotResult>> map_robots(const RunConfiguration&, RunPlan&, const RobotsAround&,
                                                   const EarlyEnds&, WorkerPool&, Progress&);

}  // namespace mapweave::runtime
