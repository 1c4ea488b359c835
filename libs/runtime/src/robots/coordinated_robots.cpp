#include "coordinated_robots.h"
#include "plan/planned_links.h"

#include <mapweave/core/stopwatch.h>
#include <mapweave/runtime/metrics.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapweave::runtime {
namespace {

// In cores of this machine, as the configuration has the tiers.
scheduling::LatencyModel model_of(const RunConfiguration& configuration, const std::filesystem::path& file) {
  scheduling::LatencyModel model = file.empty() ? scheduling::LatencyModel() : scheduling::read_model(file);
  const ProcessorOptions& processors = configuration.processors;
  if (configuration.mode == Mode::offload) {
    model.pack_s_per_scan /= processors.robot_speed();
  } else {  // robots map, and send their maps
    model.pack_s_per_scan = std::exchange(model.slam_s_per_scan, 0.0) / processors.robot_speed();
    model.scan_bytes = model.map_bytes_per_scan;
    model.robot_bytes_fixed = model.map_bytes_fixed;
    for (auto& [id, edge] : model.edges) edge.slam_s_per_scan.reset();
  }
  return model;
}

}  // namespace

tiers::CoordinatorOptions coordinator_options(const RunConfiguration& configuration, const RunPlan& plan) {
  tiers::CoordinatorOptions options;
  options.plan.method = configuration.coordinator.method.value();
  options.plan.seed = configuration.seed;
  options.plan.recslam = configuration.coordinator.recslam;
  options.plan.model = model_of(configuration, plan.model);
  options.cloud = planned_cloud(configuration);
  options.hysteresis = configuration.coordinator.hysteresis;
  return options;
}

std::string coordination_method(const RunConfiguration& configuration) {
  return scheduling::plan_method_names().at(static_cast<std::size_t>(configuration.coordinator.method.value()));
}

RobotComes announced(const RobotEntry& entry, const RobotId& robot, const TierId& edge, double route_range_m) {
  std::vector<scheduling::Waypoint> route;
  for (const RoutePoint& point : entry.route) route.push_back({point.x_m, point.y_m});
  return {robot, route.empty() ? std::nullopt : std::optional(summary_of_route(route, route_range_m)), edge};
}

CoordinatedRobots::CoordinatedRobots(const RunConfiguration& configuration, RunPlan& plan)
    : configuration_(configuration), plan_(plan), coordinator_(coordinator_options(configuration, plan)) {
  report_.method = coordination_method(configuration);
  report_.at = configuration.coordinator.at.empty() ? "cloud" : configuration.coordinator.at;
  report_robots(0.0);
  report_edges_and_wires(0.0);
  decide(0.0);
}

void CoordinatedRobots::send(const CoordinatorEvent& event) {
  coordinator_.receive(decode_coordinator_event(encode(event), "what the coordinator receives"));
}

void CoordinatedRobots::report_robots(double now_s) {
  for (const PlannedRobot& robot : plan_.robots) {
    const RobotEntry entry = robot_entry(configuration_, robot.id);
    if (now_s < entry.from_s || coordinator_.edge_of().count(robot.id) != 0) continue;
    send(announced(entry, robot.id, robot.edge, configuration_.coordinator.route_range_m));
  }
}

transport::LinkState CoordinatedRobots::link(const std::string& from, const std::string& to,
                                             const transport::LinkModelOptions& otherwise, double now_s) {
  auto wire = wires_.find({from, to});
  if (wire == wires_.end())
    wire = wires_
               .emplace(std::make_pair(from, to),
                        transport::LinkModel(wire_between(plan_.network, from, to, otherwise), 0))
               .first;
  return wire->second.state_at(now_s);
}

// From where the robot's map is to where the coordinator is: from the edge that maps it, or from the robot itself.
double CoordinatedRobots::summary_seconds(const RobotId& robot, std::size_t bytes, double now_s) {
  const NetworkOptions& network = plan_.network;
  const auto planned =
      std::find_if(plan_.robots.begin(), plan_.robots.end(), [&](const PlannedRobot& one) { return one.id == robot; });
  const bool is_on_edge = configuration_.mode == Mode::offload && !planned->edge.empty();
  const std::string from = is_on_edge ? planned->edge.str() : robot.str();
  const std::string to = configuration_.coordinator.at.empty() ? cloud_place() : configuration_.coordinator.at;
  if (from == to) return 0.0;
  const bool is_in_cloud = to == cloud_tier().str();
  const transport::LinkState wire = link(from, to,
                                         is_on_edge    ? network.edge_cloud
                                         : is_in_cloud ? network.robot_cloud
                                                       : network.robot_edge,
                                         now_s);
  return static_cast<double>(bytes) / planned_bytes_per_s(wire) + wire.delay_s;
}

std::string CoordinatedRobots::cloud_place() const {
  return configuration_.cloud.at.empty() ? cloud_tier().str() : configuration_.cloud.at;
}

void CoordinatedRobots::report_edges_and_wires(double now_s) {
  const NetworkOptions& network = plan_.network;
  const std::string cloud = cloud_place();
  for (const TierId& id : plan_.edges) {
    const EdgeEntry entry = edge_entry(configuration_, id);
    if (now_s < entry.from_s || (entry.until_s > 0.0 && now_s >= entry.until_s)) {
      send(EdgeGoes{id});
      continue;
    }
    EdgeIs edge;
    edge.edge = id;
    edge.speed = configuration_.processors.edge_speed() * entry.speed;
    edge.bytes_per_s = kAnyBytesPerS;
    edge.delay_s = 0.0;  // where the cloud is
    if (id.str() != cloud) {
      const transport::LinkState wire = link(id.str(), cloud, network.edge_cloud, now_s);
      edge.bytes_per_s = planned_bytes_per_s(wire);
      edge.delay_s = wire.delay_s;
    }
    if (entry.capacity > 0) edge.capacity = static_cast<std::uint32_t>(entry.capacity);
    send(edge);
    for (const PlannedRobot& robot : plan_.robots) {
      if (coordinator_.edge_of().count(robot.id) == 0) continue;
      const transport::LinkState wire = link(robot.id.str(), id.str(), network.robot_edge, now_s);
      send(LinkIs{robot.id, id, planned_bytes_per_s(wire), wire.delay_s});
    }
  }
}

bool CoordinatedRobots::decide(double now_s) {
  const double before_s = thread_cpu_seconds();
  std::optional<tiers::CoordinatorDecision> decision = coordinator_.decide(now_s);
  report_.cpu_seconds += thread_cpu_seconds() - before_s;
  if (!decision) return false;
  for (PlannedRobot& robot : plan_.robots)
    if (const auto edge = decision->edge_of.find(robot.id); edge != decision->edge_of.end()) robot.edge = edge->second;
  report_.decisions.push_back(std::move(*decision));
  return true;
}

void CoordinatedRobots::decide(double now_s, LasersInStep& lasers, WorkerPool& pool) {
  if (!decide(now_s)) return;
  std::vector<RobotMove> moves;
  for (const RobotMove& move : report_.decisions.back().moves)
    moves.push_back(decode_robot_move(encode(move), "what robots receive"));
  pool.for_each(moves.size(), [&](std::size_t i) {
    if (LaserTask* task = lasers.task_of(moves[i].robot)) task->move();
  });
}

double CoordinatedRobots::next_s(double due_s) const {
  const double period_s = configuration_.coordinator.overlap_period_s;
  return period_s * (1.0 + std::max(report_.recorded_s / period_s, std::floor(due_s / period_s)));
}

void CoordinatedRobots::step(double now_s, LasersInStep& lasers, WorkerPool& pool) {
  has_ended_.resize(lasers.size(), false);
  const std::vector<std::string> reports = pool.map(lasers.size(), [&](std::size_t i) {
    if (has_ended_[i] || !lasers.has_come(i, now_s)) return std::string();
    LaserTask& task = lasers.task(i);
    return encode(MapReport{lasers.robot(i).id, task.scans(), scheduling::summary_of(task.map_so_far())});
  });
  report_robots(now_s);
  double slowest_s = 0.0;
  for (std::size_t i = 0; i < reports.size(); ++i) {
    if (reports[i].empty()) continue;
    const RobotId& robot = lasers.robot(i).id;
    report_.summary_bytes += reports[i].size();
    slowest_s = std::max(slowest_s, summary_seconds(robot, reports[i].size(), now_s));
    coordinator_.receive(decode_coordinator_event(reports[i], "the report of robot " + robot.str()));
    has_ended_[i] = !lasers.task(i).next();
    if (has_ended_[i]) send(RobotGoes{robot});
  }
  report_.summary_s += slowest_s;
  report_edges_and_wires(now_s);
  report_.recorded_s = now_s;
  decide(now_s, lasers, pool);
}

}  // namespace mapweave::runtime
