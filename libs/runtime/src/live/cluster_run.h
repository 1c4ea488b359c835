#pragma once
// What else than robots a run gives to workers. Their answers are what this process would have found.

#include "results/results.h"

#include <mapweave/runtime/cluster.h>
#include <mapweave/tiers/judging_task.h>

#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

// Of each work, in order. What no worker can judge is judged here. Waits as map_on_cluster(); throws Interrupted.
std::vector<std::vector<Judgement>> judge_on_cluster(const RunConfiguration& configuration,
                                                     const std::vector<tiers::JudgingWork>& judging,
                                                     const Cluster& cluster, WorkerPool& pool, Progress& progress);

// The files into the folders that are there, and of each its notes; nullopt where no worker can. inputs: logs whose
// hashes are known. Waits as map_on_cluster(); throws Interrupted.
std::vector<std::optional<std::vector<std::string>>> draw_on_cluster(const RunConfiguration& configuration,
                                                                     const std::vector<DenseRequest>& requests,
                                                                     const std::vector<InputFile>& inputs,
                                                                     const Cluster& cluster, Progress& progress);

}  // namespace mapweave::runtime
