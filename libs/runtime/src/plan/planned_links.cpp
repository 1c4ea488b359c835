#include "planned_links.h"

namespace mapweave::runtime {
namespace {

transport::LinkState at_first(const NetworkOptions& network, const std::string& from, const std::string& to,
                              const transport::LinkModelOptions& otherwise) {
  return transport::LinkModel(wire_between(network, from, to, otherwise), 0).state_at(0.0);
}

}  // namespace

scheduling::EdgeResources planned_edge(const EdgeEntry& entry, const RunConfiguration& configuration,
                                       const NetworkOptions& network) {
  scheduling::EdgeResources edge;
  edge.id = TierId(entry.id);
  edge.speed = configuration.processors.edge_speed() * entry.speed;
  edge.bandwidth_bytes_per_s = kAnyBytesPerS;
  edge.delay_s = 0.0;  // where the cloud is
  if (entry.id != configuration.cloud.at) {
    const std::string cloud = configuration.cloud.at.empty() ? cloud_tier().str() : configuration.cloud.at;
    const transport::LinkState wire = at_first(network, entry.id, cloud, network.edge_cloud);
    edge.bandwidth_bytes_per_s = planned_bytes_per_s(wire);
    edge.delay_s = wire.delay_s;
  }
  if (entry.capacity > 0) edge.capacity = static_cast<std::uint32_t>(entry.capacity);
  return edge;
}

scheduling::RobotLink planned_link(const RobotId& robot, const TierId& edge, const NetworkOptions& network) {
  const transport::LinkState wire = at_first(network, robot.str(), edge.str(), network.robot_edge);
  return {planned_bytes_per_s(wire), wire.delay_s};
}

}  // namespace mapweave::runtime
