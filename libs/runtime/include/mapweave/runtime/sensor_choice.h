#pragma once
// What robots map with, found from the beginnings of their logs.

#include <mapweave/core/worker_pool.h>
#include <mapweave/runtime/run_configuration.h>

namespace mapweave::runtime {

// Looks at the first seconds of each log, once, and completes the plan: each robot has its sensors, or the trouble:
// what open_log throws, or kBadInput where the log has no such sensor, naming those that it has. Throws Interrupted
// alone.
void choose_sensors(RunPlan&, const RunConfiguration&, WorkerPool&);

}  // namespace mapweave::runtime
