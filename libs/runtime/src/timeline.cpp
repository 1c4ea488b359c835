#include <mapweave/runtime/timeline.h>

#include <mapweave/core/error.h>
#include <mapweave/core/mixed_bits.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

constexpr const char* kCloud = "cloud";

// The wires of a run, each made when it is first used.
class Wires {
 public:
  Wires(const NetworkOptions& network, std::uint64_t seed) : network_(network), seed_(seed) {}

  double send(const std::string& from, const std::string& to, const transport::LinkOptions& otherwise, double at_s, std::uint64_t bytes) {
    const auto known = wires_.find({from, to});
    if (known != wires_.end()) return known->second.send(at_s, bytes);
    const auto named = std::find_if(network_.links.begin(), network_.links.end(),
                                    [&](const LinkEntry& entry) { return entry.from == from && entry.to == to; });
    const transport::LinkOptions& options = named != network_.links.end() ? *named : otherwise;
    std::uint64_t seed = seed_;  // one of its own for each wire
    for (const char letter : from + ">" + to) seed = mixed(seed ^ static_cast<unsigned char>(letter));
    return wires_.emplace(std::make_pair(from, to), transport::Link(options, seed)).first->second.send(at_s, bytes);
  }

 private:
  const NetworkOptions& network_;
  std::uint64_t seed_;
  std::map<std::pair<std::string, std::string>, transport::Link> wires_;
};

}  // namespace

Timeline timeline(Mode mode, const Work& work, const NetworkOptions& network, const ProcessorOptions& processors, std::uint64_t seed) {
  Wires wires(network, seed);
  Timeline result;
  result.mode = mode;
  std::map<TierId, double> ready_s;
  double all_there_s = 0.0;
  for (const RobotWork& robot : work.robots) {
    Timeline::Robot line{robot.id, robot.edge};
    const std::string id = robot.id.str(), edge = robot.edge.str();
    double busy_s = 0.0;
    if (mode == Mode::offload) {
      line.packed_s = busy_s = (robot.packing_s + robot.seeing_s) / processors.robot;
      line.arrived_s = wires.send(id, edge, network.robot_edge, line.packed_s, robot.sensed_bytes);
      line.mapped_s = line.arrived_s + robot.mapping_s / processors.edge;
    } else {
      line.mapped_s = busy_s = (robot.mapping_s + robot.seeing_s) / processors.robot;
      line.arrived_s = mode == Mode::onboard ? wires.send(id, edge, network.robot_edge, line.mapped_s, robot.map_bytes)
                                             : wires.send(id, kCloud, network.robot_cloud, line.mapped_s, robot.map_bytes);
    }
    if (robot.log_s > 0.0) line.load = busy_s / robot.log_s;
    const double there_s = std::max(line.arrived_s, line.mapped_s);
    ready_s[robot.edge] = std::max(ready_s[robot.edge], there_s);
    if (mode == Mode::cloud_only) all_there_s = std::max(all_there_s, there_s);
    result.robots.push_back(line);
  }
  for (const EdgeWork& edge : work.edges) {
    Timeline::Edge line{edge.id, ready_s[edge.id]};
    line.fused_s = line.ready_s + edge.fusing_s / processors.edge;
    line.arrived_s = wires.send(edge.id.str(), kCloud, network.edge_cloud, line.fused_s, edge.bytes);
    all_there_s = std::max(all_there_s, line.arrived_s);
    result.edges.push_back(line);
  }
  result.total_s = all_there_s + work.fusing_s / processors.cloud;
  return result;
}

nlohmann::ordered_json timeline_json(const Timeline& timeline, const Work& work) {
  using Json = nlohmann::ordered_json;
  static constexpr const char* kModes[] = {"offload", "onboard", "cloud-only"};
  Json robots = Json::array(), edges = Json::array();
  for (std::size_t i = 0; i < timeline.robots.size(); ++i) {
    const Timeline::Robot& line = timeline.robots[i];
    const RobotWork& done = work.robots.at(i);
    robots.push_back({{"id", line.id.str()},
                      {"packing_cpu_seconds", done.packing_s},
                      {"mapping_cpu_seconds", done.mapping_s},
                      {"seeing_cpu_seconds", done.seeing_s},
                      {"sensed_bytes", done.sensed_bytes},
                      {"map_bytes", done.map_bytes},
                      {"packed_seconds", line.packed_s},
                      {"arrived_seconds", line.arrived_s},
                      {"mapped_seconds", line.mapped_s},
                      {"load", line.load}});
  }
  for (std::size_t i = 0; i < timeline.edges.size(); ++i) {
    const Timeline::Edge& line = timeline.edges[i];
    edges.push_back({{"id", line.id.str()},
                     {"fusing_cpu_seconds", work.edges.at(i).fusing_s},
                     {"bytes", work.edges.at(i).bytes},
                     {"ready_seconds", line.ready_s},
                     {"fused_seconds", line.fused_s},
                     {"arrived_seconds", line.arrived_s}});
  }
  return {{"mode", kModes[static_cast<int>(timeline.mode)]},
          {"robots", robots},
          {"edges", edges},
          {"cloud", {{"fusing_cpu_seconds", work.fusing_s}}},
          {"total_seconds", timeline.total_s}};
}

}  // namespace mapweave::runtime
