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
  explicit Wires(const TimelineOptions& options) : options_(options) {}

  double send(const std::string& from, const std::string& to, const transport::LinkModelOptions& otherwise, double at_s,
              std::uint64_t bytes) {
    auto known = wires_.find({from, to});
    if (known == wires_.end()) {
      std::uint64_t seed = options_.seed;  // one of its own for each wire
      for (const char letter : from + ">" + to) seed = mixed(seed ^ static_cast<unsigned char>(letter));
      known = wires_
                  .emplace(std::make_pair(from, to),
                           transport::LinkModel(wire_between(options_.network, from, to, otherwise), seed))
                  .first;
    }
    return known->second.send(options_.recorded_s + at_s, bytes) - options_.recorded_s;
  }

 private:
  const TimelineOptions& options_;
  std::map<std::pair<std::string, std::string>, transport::LinkModel> wires_;
};

}  // namespace

const transport::LinkModelOptions& wire_between(const NetworkOptions& network, const std::string& from,
                                                const std::string& to, const transport::LinkModelOptions& otherwise) {
  const auto named = std::find_if(network.links.begin(), network.links.end(),
                                  [&](const LinkEntry& entry) { return entry.from == from && entry.to == to; });
  return named != network.links.end() ? *named : otherwise;
}

Timeline timeline(const TimelineOptions& options, const Work& work) {
  const NetworkOptions& network = options.network;
  const ProcessorOptions& processors = options.processors;
  const std::string cloud = options.cloud.at.empty() ? kCloud : options.cloud.at;
  std::map<TierId, double> speed;  // of edges
  for (const EdgeWork& edge : work.edges) speed[edge.id] = processors.edge_speed() * edge.speed;
  const auto speed_of = [&](const TierId& edge) {
    return speed.count(edge) != 0 ? speed.at(edge) : processors.edge_speed();
  };
  Wires wires(options);
  Timeline result;
  result.mode = options.mode;
  result.recorded_s = options.recorded_s;
  struct Finished {
    double at_s;
    const RobotWork* robot;
  };
  std::vector<Finished> at_edges;
  std::map<TierId, double> ready_s;
  double maps_there_s = 0.0;
  for (const RobotWork& robot : work.robots) {
    Timeline::Robot line{robot.id, robot.edge};
    const std::string id = robot.id.str(), edge = robot.edge.str();
    const bool is_alone = edge.empty() || options.mode == Mode::cloud_only;
    double busy_s = 0.0;
    if (options.mode == Mode::offload && !is_alone) {
      line.packed_s = busy_s = (robot.packing_s + robot.seeing_s) / processors.robot_speed();
      line.arrived_s = wires.send(id, edge, network.robot_edge, line.packed_s, robot.sensed_bytes);
      line.mapped_s = line.arrived_s + robot.mapping_s / speed_of(robot.edge);
    } else {
      line.mapped_s = busy_s = (robot.mapping_s + robot.seeing_s) / processors.robot_speed();
      if (is_alone)
        line.arrived_s = wires.send(id, cloud, options.cloud.at.empty() ? network.robot_cloud : network.robot_edge,
                                    line.mapped_s, robot.map_bytes);
      else
        line.arrived_s = wires.send(id, edge, network.robot_edge, line.mapped_s, robot.map_bytes);
    }
    if (robot.log_s > 0.0) line.load = busy_s / robot.log_s;
    const double there_s = std::max(line.arrived_s, line.mapped_s);
    if (is_alone || edge == cloud) maps_there_s = std::max(maps_there_s, there_s);
    if (!is_alone) {
      ready_s[robot.edge] = std::max(ready_s[robot.edge], there_s);
      if (edge != cloud) at_edges.push_back({there_s, &robot});
    }
    result.robots.push_back(line);
  }
  // Each map goes on to the cloud while its edge waits for others and fuses. What the edge found of them follows.
  std::map<TierId, std::uint64_t> sent;
  std::stable_sort(at_edges.begin(), at_edges.end(),
                   [](const Finished& l, const Finished& r) { return l.at_s < r.at_s; });
  for (const auto& [at_s, robot] : at_edges) {
    maps_there_s =
        std::max(maps_there_s, wires.send(robot->edge.str(), cloud, network.edge_cloud, at_s, robot->map_bytes));
    sent[robot->edge] += robot->map_bytes;
  }
  double received_s = 0.0, free_s = 0.0;  // free: where the cloud is an edge, that has fused
  for (const EdgeWork& edge : work.edges) {
    Timeline::Edge line{edge.id, ready_s[edge.id]};
    const bool is_here = edge.id.str() == cloud;
    line.fused_s = line.ready_s + edge.fusing_s / speed_of(edge.id);
    line.arrived_s = is_here ? line.fused_s
                             : wires.send(edge.id.str(), cloud, network.edge_cloud, line.fused_s,
                                          edge.bytes - std::min(edge.bytes, sent[edge.id]));
    if (is_here) free_s = line.fused_s;
    received_s = std::max(received_s, line.arrived_s);
    result.edges.push_back(line);
  }
  // Once all maps are there, the cloud shares out those that lie on two edges, which compare them when they have fused
  // their own.
  const double cloud_speed = options.cloud.at.empty() ? processors.cloud_speed() : speed_of(TierId(cloud));
  const double planned_s = std::max(maps_there_s, free_s) + work.planning_s / cloud_speed;
  double judged_s = std::max(received_s, planned_s);
  for (std::size_t i = 0; i < work.edges.size(); ++i) {
    const EdgeWork& edge = work.edges[i];
    Timeline::Edge& line = result.edges[i];
    if (edge.judging_s == 0.0 && edge.sent_bytes == 0) continue;
    const bool is_here = edge.id.str() == cloud;
    const double sent_s =
        is_here ? planned_s : wires.send(cloud, edge.id.str(), network.edge_cloud, planned_s, edge.sent_bytes);
    const double done_s = std::max(line.fused_s, sent_s) + edge.judging_s / speed_of(edge.id);
    line.judged_s = is_here ? done_s : wires.send(edge.id.str(), cloud, network.edge_cloud, done_s, edge.judged_bytes);
    judged_s = std::max(judged_s, line.judged_s);
  }
  result.total_s = judged_s + (work.fusing_s - work.planning_s) / cloud_speed;
  for (const PushWork& push : work.pushes)
    result.pushes.push_back({push.robot, wires.send(cloud, push.robot.str(),
                                                    options.cloud.at.empty() ? network.robot_cloud : network.robot_edge,
                                                    result.total_s, push.bytes)});
  return result;
}

nlohmann::ordered_json timeline_json(const Timeline& timeline, const Work& work) {
  using Json = nlohmann::ordered_json;
  static constexpr const char* kModes[] = {"offload", "onboard", "cloud-only"};
  Json robots = Json::array(), edges = Json::array(), pushes = Json::array(), overlaps = Json::array();
  for (std::size_t i = 0; i < timeline.robots.size(); ++i) {
    const Timeline::Robot& line = timeline.robots[i];
    const RobotWork& done = work.robots.at(i);
    robots.push_back({{"id", line.id.str()},
                      {"edge", line.edge.str()},
                      {"log_seconds", done.log_s},
                      {"packing_cpu_seconds", done.packing_s},
                      {"mapping_cpu_seconds", done.mapping_s},
                      {"seeing_cpu_seconds", done.seeing_s},
                      {"sensed_bytes", done.sensed_bytes},
                      {"map_bytes", done.map_bytes},
                      {"repeated_cpu_seconds", done.repeated_s},
                      {"repeated_bytes", done.repeated_bytes},
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
                     {"speed", work.edges.at(i).speed},
                     {"ready_seconds", line.ready_s},
                     {"fused_seconds", line.fused_s},
                     {"arrived_seconds", line.arrived_s},
                     {"lent_bytes", work.edges.at(i).sent_bytes},
                     {"judging_cpu_seconds", work.edges.at(i).judging_s},
                     {"judged_bytes", work.edges.at(i).judged_bytes},
                     {"judged_seconds", line.judged_s}});
  }
  for (const auto& [a, b, degree] : work.overlaps) overlaps.push_back({a.str(), b.str(), degree});
  for (std::size_t i = 0; i < timeline.pushes.size(); ++i)
    pushes.push_back({{"robot", timeline.pushes[i].robot.str()},
                      {"bytes", work.pushes.at(i).bytes},
                      {"arrived_seconds", timeline.pushes[i].arrived_s}});
  return {{"mode", kModes[static_cast<int>(timeline.mode)]},
          {"robots", robots},
          {"edges", edges},
          {"cloud", {{"fusing_cpu_seconds", work.fusing_s}, {"planning_cpu_seconds", work.planning_s}}},
          {"total_seconds", timeline.total_s},
          {"recorded_seconds", timeline.recorded_s},
          {"pushes", pushes},
          {"overlaps", overlaps}};
}

}  // namespace mapweave::runtime
