#pragma once
// Partial offloading (RecSLAM III-B): the data of one robot go to several edges, each of which maps a part of its log.

#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/tiers/robot_slam.h>

#include <memory>
#include <vector>

namespace mapweave::runtime {

// Chooses where the parts of logs begin and end: parts of equal duration, from the first record to the last. Their
// sensors are chosen. A log that cannot be read, or that cannot be divided since its robot has cameras, is trouble.
void divide_logs(RunPlan&, const RunConfiguration&, WorkerPool&);

// The records of the part alone.
std::unique_ptr<rawlog::ObservationStream> part_of(std::unique_ptr<rawlog::ObservationStream>, const LogPart&);

// Of the maps of parts that follow each other: the second one begins where the first one ends.
std::vector<fusion::MapPrior> priors_of_parts(const RunPlan&, const std::vector<tiers::RobotOutcome>&);

}  // namespace mapweave::runtime
