#pragma once
// The engines by name, and the options of each.

#include <mapweave/laser/external_mapper.h>
#include <mapweave/laser/graph_mapper.h>
#include <mapweave/laser/scan_input.h>

#include <cstdint>
#include <memory>

namespace mapweave::laser {

enum class Engine { graph, rbpf, icp };

struct LaserOptions {
  Engine engine = Engine::graph;
  ScanInputOptions scan;
  GraphMapperOptions graph;
  RbpfOptions rbpf;
  IcpOptions icp;
  ExternalMapperOptions external;
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice("engine", engine, {{"graph", Engine::graph}, {"rbpf", Engine::rbpf}, {"icp", Engine::icp}},
             "laser SLAM to map with; graph: submaps and a pose graph with loop closures; rbpf: MRPT's "
             "Rao-Blackwellised particle "
             "filter; icp: MRPT's incremental scan matching without loop closures");
    v.section("scan", scan, "how laser scans are read from a log");
    v.section("graph", graph, "laser SLAM with submaps and a pose graph (laser.engine: graph)");
    v.section("rbpf", rbpf, "MRPT's Rao-Blackwellised particle filter (laser.engine: rbpf)");
    v.section("icp", icp, "MRPT's incremental scan matching (laser.engine: icp)");
    v.section("external", external, "the helper process that runs MRPT's engines rbpf and icp");
  }
};

// How the robot reads its log: no inertial unit where the engine does not use it.
ScanInputOptions scan_input_of(const LaserOptions& options);

// `seed` is the run's; an engine's own seed is added to it.
std::unique_ptr<LaserMapper> make_laser_mapper(ClientId client, const LaserOptions& options, std::uint64_t seed);

}  // namespace mapweave::laser
