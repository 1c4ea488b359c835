#pragma once
// All robots of a run from their logs to their maps, each a task of the worker pool.

#include "coordinated_robots.h"

#include <mapweave/runtime/robot_task.h>

#include <optional>
#include <vector>

namespace mapweave::runtime {

// What may end a robot's log early.
struct EarlyEnds {
  bool keep_going = false;  // trouble with it, which is lived with
  bool saves_part = false;  // an interruption (map_robot); of one robot alone, not of cameras that share while they map
};

// Chooses the sensors of the plan, and maps. Every robot of the plan, nullopt for those that were interrupted.
// `coordinated`: maps the lasers; may be null. Throws the first trouble with a robot, unless it is to be lived with,
// and Interrupted where that says more.
std::vector<std::optional<RobotResult>> map_robots(const RunConfiguration&, RunPlan&, CoordinatedRobots* coordinated,
                                                   const EarlyEnds&, WorkerPool&, Progress&);

}  // namespace mapweave::runtime
