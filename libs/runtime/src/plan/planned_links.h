#pragma once
// Processors and links of a configuration as the scheduler counts them: for a coordinator, and for plan.

#include <mapweave/runtime/run_configuration.h>
#include <mapweave/scheduling/problem.h>
#include <mapweave/transport/link_model.h>

namespace mapweave::runtime {

inline scheduling::CloudResources planned_cloud(const RunConfiguration& configuration) {
  const ProcessorOptions& processors = configuration.processors;
  const std::string& at = configuration.cloud.at;
  return {at.empty() ? processors.cloud_speed() : processors.edge_speed() * edge_entry(configuration, TierId(at)).speed,
          configuration.cloud.edges_judge};
}

inline constexpr double kAnyBytesPerS = 1e12;  // of a wire without a bound
inline double planned_bytes_per_s(const transport::LinkState& wire) {
  return wire.bytes_per_s > 0.0 ? wire.bytes_per_s * (1.0 - wire.loss) : kAnyBytesPerS;
}

// As the configuration has them at the beginning: an edge with its link to the cloud, a robot's link to an edge.
scheduling::EdgeResources planned_edge(const EdgeEntry& entry, const RunConfiguration&, const NetworkOptions&);
scheduling::RobotLink planned_link(const RobotId& robot, const TierId& edge, const NetworkOptions&);

}  // namespace mapweave::runtime
