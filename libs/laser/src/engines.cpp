#include <mapweave/laser/engines.h>

namespace mapweave::laser {

ScanInputOptions scan_input_of(const LaserOptions& options) {
  ScanInputOptions scan = options.scan;
  if (options.engine != Engine::graph) scan.inertial = InertialUse::none;
  return scan;
}

std::unique_ptr<LaserMapper> make_laser_mapper(ClientId client, const LaserOptions& options, std::uint64_t seed) {
  switch (options.engine) {
    case Engine::rbpf: {
      RbpfOptions rbpf = options.rbpf;
      rbpf.seed = static_cast<std::uint32_t>(rbpf.seed + seed);
      return std::make_unique<ExternalMapper>(client, rbpf, options.external);
    }
    case Engine::icp: return std::make_unique<ExternalMapper>(client, options.icp, options.external);
    case Engine::graph: break;
  }
  GraphMapperOptions graph = options.graph;
  if (options.scan.sweep != SweepSource::automatic) graph.sweep.estimate = false;
  return std::make_unique<GraphMapper>(client, graph);
}

}  // namespace mapweave::laser
