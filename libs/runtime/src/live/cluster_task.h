#pragma once
// What a run and a worker say to each other, as JSON.

#include <mapweave/core/error.h>
#include <mapweave/core/hash.h>
#include <mapweave/runtime/run_configuration.h>

#include <string>
#include <string_view>

namespace mapweave::runtime {

// Subjects. Of the run: task. Of the worker: alive, every second while it maps; mapped, a message of what it mapped;
// failed, an Error that is not the robot's.
namespace cluster_subject {
inline constexpr char kTask[] = "task", kAlive[] = "alive", kMapped[] = "mapped", kFailed[] = "failed";
}

struct ClusterTask {
  std::string version;  // of the program that asks
  RobotId robot;
  std::string log;  // where the run has it
  Hash log_sha256;
  std::string configuration;  // YAML: of this robot alone
};

std::string encode(const ClusterTask& task);
// Throws Error kCorrupt or kBadInput for what is not sound.
ClusterTask decode_cluster_task(std::string_view bytes, const std::string& where);

ClusterTask task_of(const RunConfiguration& configuration, const PlannedRobot& robot);
// As the worker maps it, with its log at this path. Throws Error for a configuration that is none.
struct WorkerPlan {
  RunConfiguration configuration;
  RunPlan plan;  // one robot, its sensors chosen
};
WorkerPlan plan_of(const ClusterTask& task, const std::filesystem::path& log);

}  // namespace mapweave::runtime
