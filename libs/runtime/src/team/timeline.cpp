#include <mapweave/runtime/timeline.h>

#include "wires.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

constexpr const char* kCloud = "cloud";

}  // namespace

const transport::LinkModelOptions& wire_between(const NetworkOptions& network, const std::string& from,
                                                const std::string& to, const transport::LinkModelOptions& otherwise) {
  const auto named = std::find_if(network.links.begin(), network.links.end(),
                                  [&](const LinkEntry& entry) { return entry.from == from && entry.to == to; });
  return named != network.links.end() ? *named : otherwise;
}

namespace {

// Steps of a run in virtual time, each after those that it waits for.
class Replay {
 public:
  Replay(const TimelineOptions& options, const Work& work)
      : options_(options), work_(work), cloud_(options.cloud.at.empty() ? kCloud : options.cloud.at), wires_(options) {
    result_.mode = options.mode;
    result_.recorded_s = options.recorded_s;
    for (const EdgeWork& edge : work.edges) speed_[edge.id] = options.processors.edge_speed() * edge.speed;
  }

  Timeline run() {
    for (const RobotWork& robot : work_.robots) map(robot);
    send_maps_on();
    for (const EdgeWork& edge : work_.edges) fuse(edge);
    judge_on_edges();
    finalize();
    if (!work_.rounds.empty()) result_.rounds = rounds_timeline(options_, work_);
    return std::move(result_);
  }

 private:
  struct MapAtEdge {
    double at_s;
    const RobotWork* robot;
  };
  double speed_of(const TierId& edge) const {
    const auto known = speed_.find(edge);
    return known != speed_.end() ? known->second : options_.processors.edge_speed();
  }
  bool is_thinned(const TierId& edge) const {
    return std::any_of(work_.edges.begin(), work_.edges.end(),
                       [&](const EdgeWork& one) { return one.id == edge && one.thinning.scans > 0; });
  }
  double cloud_speed() const {
    return options_.cloud.at.empty() ? options_.processors.cloud_speed() : speed_of(TierId(cloud_));
  }
  const auto& robot_cloud() const {
    return options_.cloud.at.empty() ? options_.network.robot_cloud : options_.network.robot_edge;
  }
  double send_up(const TierId& edge, double at_s, std::uint64_t bytes) {
    return wires_.send(edge.str(), cloud_, options_.network.edge_cloud, at_s, bytes);
  }
  void map(const RobotWork& robot);
  void send_maps_on();
  void fuse(const EdgeWork& edge);
  void judge_on_edges();
  void finalize();

  const TimelineOptions& options_;
  const Work& work_;
  const std::string cloud_;
  Wires wires_;
  Timeline result_;
  std::map<TierId, double> speed_;            // of edges
  std::map<TierId, double> ready_s_;          // the last of its robots' maps is there
  std::vector<MapAtEdge> at_edges_;           // to go on to the cloud
  std::map<TierId, std::uint64_t> sent_;      // bytes of these maps
  double maps_there_s_ = 0.0;                 // all maps are in the cloud
  double received_s_ = 0.0, judged_s_ = 0.0;  // what edges found is there; what they judged, too
  double free_s_ = 0.0;                       // where the cloud is an edge: that has fused
};

void Replay::map(const RobotWork& robot) {
  const NetworkOptions& network = options_.network;
  const double robot_speed = options_.processors.robot_speed();
  const std::string id = robot.id.str(), edge = robot.edge.str();
  const bool is_alone = edge.empty() || options_.mode == Mode::cloud_only;
  Timeline::RobotTimes line{robot.id, robot.edge};
  double busy_s = 0.0;
  if (options_.mode == Mode::offload && !is_alone) {
    line.packed_s = busy_s = (robot.packing_s + robot.seeing_s) / robot_speed;
    line.arrived_s =
        wires_.send(id, edge, network.robot_edge, line.packed_s, robot.sensed_bytes + robot.repeated_bytes);
    line.mapped_s = line.arrived_s + (robot.mapping_s + robot.repeated_s) / speed_of(robot.edge);
  } else {
    line.mapped_s = busy_s = (robot.mapping_s + robot.seeing_s) / robot_speed;
    line.arrived_s = is_alone ? wires_.send(id, cloud_, robot_cloud(), line.mapped_s, robot.map_bytes)
                              : wires_.send(id, edge, network.robot_edge, line.mapped_s, robot.map_bytes);
  }
  if (robot.log_s > 0.0) line.load = busy_s / robot.log_s;
  const double there_s = std::max(line.arrived_s, line.mapped_s);
  if (is_alone || edge == cloud_) maps_there_s_ = std::max(maps_there_s_, there_s);
  if (!is_alone) {
    ready_s_[robot.edge] = std::max(ready_s_[robot.edge], there_s);
    if (edge != cloud_ && !is_thinned(robot.edge)) at_edges_.push_back({there_s, &robot});
  }
  result_.robots.push_back(line);
}

// Each whole map goes on to the cloud while its edge waits for others and fuses. What the edge found of them follows.
void Replay::send_maps_on() {
  std::stable_sort(at_edges_.begin(), at_edges_.end(),
                   [](const MapAtEdge& l, const MapAtEdge& r) { return l.at_s < r.at_s; });
  for (const auto& [at_s, robot] : at_edges_) {
    maps_there_s_ = std::max(maps_there_s_, send_up(robot->edge, at_s, robot->map_bytes));
    sent_[robot->edge] += robot->map_bytes;
  }
}

void Replay::fuse(const EdgeWork& edge) {
  Timeline::EdgeTimes line{edge.id, ready_s_[edge.id]};
  line.fused_s = line.ready_s + edge.fusing_s / speed_of(edge.id);
  if (edge.id.str() == cloud_)
    line.arrived_s = free_s_ = line.fused_s;
  else
    line.arrived_s = send_up(edge.id, line.fused_s, edge.bytes - std::min(edge.bytes, sent_[edge.id]));
  if (edge.thinning.scans > 0) maps_there_s_ = std::max(maps_there_s_, line.arrived_s);
  received_s_ = std::max(received_s_, line.arrived_s);
  result_.edges.push_back(line);
}

// Once all maps are there, the cloud shares out those that lie on two edges, which compare them when they have fused
// their own.
void Replay::judge_on_edges() {
  const double planned_s = std::max(maps_there_s_, free_s_) + work_.planning_s / cloud_speed();
  judged_s_ = std::max(received_s_, planned_s);
  for (std::size_t i = 0; i < work_.edges.size(); ++i) {
    const EdgeWork& edge = work_.edges[i];
    Timeline::EdgeTimes& line = result_.edges[i];
    if (edge.judging_s == 0.0 && edge.sent_bytes == 0) continue;
    const bool is_here = edge.id.str() == cloud_;
    const double sent_s =
        is_here ? planned_s
                : wires_.send(cloud_, edge.id.str(), options_.network.edge_cloud, planned_s, edge.sent_bytes);
    const double done_s = std::max(line.fused_s, sent_s) + edge.judging_s / speed_of(edge.id);
    line.judged_s = is_here ? done_s : send_up(edge.id, done_s, edge.judged_bytes);
    judged_s_ = std::max(judged_s_, line.judged_s);
  }
}

void Replay::finalize() {
  result_.total_s = judged_s_ + (work_.fusing_s - work_.planning_s) / cloud_speed();
  for (const PushWork& push : work_.pushes)
    result_.pushes.push_back(
        {push.robot, wires_.send(cloud_, push.robot.str(), robot_cloud(), result_.total_s, push.bytes)});
}

}  // namespace

Timeline timeline(const TimelineOptions& options, const Work& work) { return Replay(options, work).run(); }

nlohmann::ordered_json timeline_json(const Timeline& timeline, const Work& work) {
  using Json = nlohmann::ordered_json;
  static constexpr const char* kModes[] = {"offload", "onboard", "cloud-only"};
  Json robots = Json::array(), edges = Json::array(), pushes = Json::array(), overlaps = Json::array();
  for (std::size_t i = 0; i < timeline.robots.size(); ++i) {
    const Timeline::RobotTimes& line = timeline.robots[i];
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
    const Timeline::EdgeTimes& line = timeline.edges[i];
    edges.push_back({{"id", line.id.str()},
                     {"fusing_cpu_seconds", work.edges.at(i).fusing_s},
                     {"bytes", work.edges.at(i).bytes},
                     {"scans", work.edges.at(i).thinning.scans},
                     {"sent_scans", work.edges.at(i).thinning.kept},
                     {"walls_left_out", work.edges.at(i).thinning.walls_left_out},
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
  for (std::size_t i = 0; i < timeline.pushes.size(); ++i) {
    pushes.push_back({{"robot", timeline.pushes[i].robot.str()},
                      {"bytes", work.pushes.at(i).bytes},
                      {"arrived_seconds", timeline.pushes[i].arrived_s}});
    if (!work.pushes[i].next_run.empty()) pushes.back()["next_run"] = work.pushes[i].next_run;
  }
  Json json = {{"mode", kModes[static_cast<int>(timeline.mode)]},
               {"robots", robots},
               {"edges", edges},
               {"cloud", {{"fusing_cpu_seconds", work.fusing_s}, {"planning_cpu_seconds", work.planning_s}}},
               {"total_seconds", timeline.total_s},
               {"recorded_seconds", timeline.recorded_s},
               {"pushes", pushes},
               {"overlaps", overlaps}};
  if (timeline.rounds) json["rounds"] = rounds_timeline_json(*timeline.rounds, work.rounds);
  return json;
}

}  // namespace mapweave::runtime
