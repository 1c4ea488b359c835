#pragma once
// `mapweave run`: robots, edges and cloud in one process. Every robot is a task of the worker pool; what they leave is
// folded in the order of their names, so that neither threads nor the order of the list change a byte.

#include <mapweave/core/progress.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/runtime/cluster.h>
#include <mapweave/runtime/report.h>
#include <mapweave/runtime/run_configuration.h>

namespace mapweave::runtime {

struct RunSettings {
  std::filesystem::path out;
  bool force = false;
  bool keep_going = false;  // bad input ends its robot's stream only; otherwise it ends the run and nothing is written.
                            // A dead helper ends its robot only
  const Cluster* cluster = nullptr;  // maps the robots (run_batch alone); null: this process does
};

// Writes the folder of results. Throws Error: what the first robot in trouble met (without keep_going), kCannotWrite.
// An interruption is not thrown once a robot's map is finished: that is saved, and the report says so.
Report run_batch(const RunConfiguration&, const RunPlan&, const RunSettings&, WorkerPool&, Progress&);

// `mapweave slam`: as run_batch() for one robot, without edges and cloud. Where it begins with maps that its own one
// joins, that team's map is at the top of the folder, and its own one in robots/NAME.
Report run_slam(const RunConfiguration&, const RunPlan&, const RunSettings&, WorkerPool&, Progress&);

}  // namespace mapweave::runtime
