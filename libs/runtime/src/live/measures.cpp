#include "measures.h"

#include <algorithm>
#include <cmath>

namespace mapweave::runtime {
namespace {

// What is nearly as before is no news: every change is a reason to plan again.
constexpr double kNews = 0.2;
constexpr double kLeastScans = 50.0;  // of a measure of an edge's speed
constexpr double kSlowest = 1e-3, kFastest = 1e3;

double newer(const std::optional<double>& before, double now) {
  return before && std::abs(now - *before) <= kNews * *before ? *before : now;
}

}  // namespace

const char* to_text(Known known) {
  static constexpr const char* kWords[] = {"measured", "configured", "like others"};
  return kWords[static_cast<std::size_t>(known)];
}

Measures::Measures(const RunConfiguration& configuration, const RunPlan& plan, const scheduling::LatencyModel& model)
    : network_(plan.network) {
  for (const TierId& edge : plan.edges) {
    EdgeEntry entry = edge_entry(configuration, edge);
    entry.id = edge.str();
    edges_[edge].planned = planned_edge(entry, configuration, network_);
    const auto own = model.edges.find(edge.str());
    edges_[edge].slam_s_per_scan =
        own == model.edges.end() ? model.slam_s_per_scan : own->second.slam_s_per_scan.value_or(model.slam_s_per_scan);
  }
}

void Measures::take_wire(const RobotId& robot, const TierId& edge, double bytes_per_s) {
  std::map<TierId, double>& known = wires_[robot];
  const auto before = known.find(edge);
  known[edge] =
      newer(before == known.end() ? std::nullopt : std::optional(before->second), std::min(bytes_per_s, kAnyBytesPerS));
}

void Measures::take_wire_to_cloud(const TierId& edge, double bytes_per_s) {
  std::optional<double>& known = edges_.at(edge).bytes_per_s;
  known = newer(known, std::min(bytes_per_s, kAnyBytesPerS));
}

void Measures::take_mapping(const TierId& edge, double scans, double seconds) {
  Edge& of = edges_.at(edge);
  if (scans < of.scans || seconds < of.seconds) of.scans = of.seconds = 0.0;  // it began again
  if (of.slam_s_per_scan <= 0.0 || scans - of.scans < kLeastScans || seconds <= of.seconds) return;
  const double s_per_scan = (seconds - of.seconds) / (scans - of.scans);
  of.speed = newer(of.speed, std::clamp(of.slam_s_per_scan / s_per_scan, kSlowest, kFastest));
  of.scans = scans;
  of.seconds = seconds;
}

Expected Measures::wire(const RobotId& robot, const TierId& edge) const {
  const double configured = planned_link(robot, edge, network_).bytes_per_s;
  const auto known = wires_.find(robot);
  if (known == wires_.end()) return {configured, Known::configured};
  if (const auto measured = known->second.find(edge); measured != known->second.end())
    return {measured->second, Known::measured};
  if (configured < kAnyBytesPerS) return {configured, Known::configured};
  double sum = 0.0;
  for (const auto& [other, bytes_per_s] : known->second) sum += bytes_per_s;
  return {sum / static_cast<double>(known->second.size()), Known::like_others};
}

double Measures::delay_s(const RobotId& robot, const TierId& edge) const {
  return planned_link(robot, edge, network_).delay_s;
}

Expected Measures::wire_to_cloud(const TierId& edge) const {
  const Edge& of = edges_.at(edge);
  if (of.bytes_per_s) return {*of.bytes_per_s, Known::measured};
  double sum = 0.0, count = 0.0;
  for (const auto& [other, one] : edges_)
    if (one.bytes_per_s) {
      sum += *one.bytes_per_s;
      ++count;
    }
  if (of.planned.bandwidth_bytes_per_s < kAnyBytesPerS || count == 0.0)
    return {of.planned.bandwidth_bytes_per_s, Known::configured};
  return {sum / count, Known::like_others};
}

// What is configured counts against other edges.
Expected Measures::speed(const TierId& edge) const {
  const Edge& of = edges_.at(edge);
  if (of.speed) return {*of.speed, Known::measured};
  double sum = 0.0, count = 0.0;
  for (const auto& [other, one] : edges_)
    if (one.speed) {
      sum += *one.speed / one.planned.speed;
      ++count;
    }
  if (count == 0.0) return {of.planned.speed, Known::configured};
  return {of.planned.speed * sum / count, Known::like_others};
}

scheduling::EdgeResources Measures::resources(const TierId& edge) const {
  scheduling::EdgeResources resources = edges_.at(edge).planned;
  resources.speed = speed(edge).value;
  resources.bandwidth_bytes_per_s = wire_to_cloud(edge).value;
  return resources;
}

}  // namespace mapweave::runtime
