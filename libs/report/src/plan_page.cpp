#include <mapweave/report/plan_page.h>

#include "page_text.h"
#include "run_data.h"

#include <mapweave/core/hash.h>

#include <algorithm>

namespace mapweave::report {
namespace {

using scheduling::Latency;
using scheduling::LatencyTerms;
using scheduling::Plan;
using scheduling::PlanOptions;
using scheduling::Problem;

constexpr std::size_t kMostOverlaps = 4000;
constexpr int kDigits = 6;  // of seconds

std::vector<std::vector<std::uint32_t>> robots_by_edge(const Problem& problem, const Plan& plan) {
  std::vector<std::vector<std::uint32_t>> robots_at(problem.edges.size());
  for (std::uint32_t robot = 0; robot < plan.edge_of.size(); ++robot) {
    robots_at[plan.edge_of[robot]].push_back(robot);
    if (plan.further_edges_of.empty()) continue;
    for (const std::uint32_t edge : plan.further_edges_of[robot]) robots_at[edge].push_back(robot);
  }
  return robots_at;
}

Json robots_json(const Problem& problem, const Plan& plan) {
  Json robots = Json::array();
  for (std::size_t robot = 0; robot < problem.robots.size(); ++robot) {
    robots.push_back({{"name", problem.robots[robot].str()}, {"edge", plan.edge_of[robot]}});
    if (!plan.further_edges_of.empty()) robots.back()["further"] = plan.further_edges_of[robot];
  }
  return robots;
}

// [robot, robot, degree], the largest first.
Json overlaps_json(const scheduling::OverlapGraph& graph) {
  std::vector<scheduling::OverlapLink> links;
  for (std::uint32_t robot = 0; robot < graph.size(); ++robot)
    for (const scheduling::Neighbour& other : graph.neighbours(robot))
      if (other.vertex > robot) links.push_back({robot, other.vertex, other.weight});
  std::stable_sort(links.begin(), links.end(), [](const auto& a, const auto& b) { return a.weight > b.weight; });
  links.resize(std::min(links.size(), kMostOverlaps));
  Json overlaps = Json::array();
  for (const auto& link : links) overlaps.push_back({link.a, link.b, rounded(link.weight, kDigits)});
  return overlaps;
}

Json edges_json(const Latency& latency, const LatencyTerms& terms) {
  Json edges = Json::array();
  for (std::uint32_t i = 0; i < terms.edges.size(); ++i) {
    const scheduling::EdgeResources& edge = latency.problem().edges[i];
    double scans = 0.0, bytes = 0.0;
    for (const auto& robot : terms.edges[i].robots) {
      scans += latency.scans(robot.robot);
      bytes += latency.sent_bytes(robot.robot, i);
    }
    edges.push_back({{"name", edge.id.str()},
                     {"robots", terms.edges[i].robots.size()},
                     {"capacity", edge.capacity ? Json(*edge.capacity) : Json()},
                     {"speed", edge.speed},
                     {"scans", scans},
                     {"bytes", rounded(bytes, 0)},
                     {"bytes_per_s", edge.bandwidth_bytes_per_s},
                     {"delay_s", latency.cloud_delay_s(i)},
                     {"computing_seconds", rounded(terms.edges[i].computing_seconds(), kDigits)},
                     {"sending_seconds", rounded(terms.edges[i].transfer_s, kDigits)}});
  }
  return edges;
}

// As the timeline of a run in summary.json has it, with each robot's link.
Json timeline_json(const Latency& latency, const LatencyTerms& terms, double total_seconds) {
  const scheduling::LatencyModel& model = latency.model();
  Json robots = Json::array(), edges = Json::array();
  for (std::uint32_t i = 0; i < terms.edges.size(); ++i) {
    const std::string name = latency.problem().edges[i].id.str();
    const LatencyTerms::EdgeTerms& edge = terms.edges[i];
    if (edge.robots.empty()) continue;
    double ready = 0.0;
    for (const LatencyTerms::RobotTerms& robot : edge.robots) {
      ready = std::max(ready, robot.seconds());
      const auto link = latency.problem().links.find({robot.robot, i});
      const scheduling::RobotLink wire = link != latency.problem().links.end()
                                             ? link->second
                                             : scheduling::RobotLink{model.robot_bytes_per_s, model.robot_delay_s};
      robots.push_back(
          {{"id", latency.problem().robots[robot.robot].str()},
           {"edge", name},
           {"packed_seconds", rounded(robot.pack_s, kDigits)},
           {"arrived_seconds", rounded(robot.pack_s + robot.transfer_s, kDigits)},
           {"mapped_seconds", rounded(robot.seconds(), kDigits)},
           {"sensed_bytes", rounded(model.robot_bytes_fixed + model.scan_bytes * latency.scans(robot.robot), 0)},
           {"bytes_per_s", wire.bytes_per_s},
           {"delay_s", wire.delay_s}});
    }
    edges.push_back({{"id", name},
                     {"ready_seconds", rounded(ready, kDigits)},
                     {"fused_seconds", rounded(ready + edge.fusion_s, kDigits)},
                     {"arrived_seconds", rounded(edge.seconds(), kDigits)}});
  }
  return {{"mode", "offload"},
          {"robots", robots},
          {"edges", edges},
          {"cloud", {{"fusing_cpu_seconds", rounded(terms.fusion_s, kDigits)}}},
          {"total_seconds", rounded(total_seconds, kDigits)}};
}

Json inputs_json(const PlanSource& source) {
  std::vector<std::filesystem::path> files = {source.problem};
  std::error_code ignored;
  if (std::filesystem::is_directory(source.problem, ignored))
    files = {source.problem / "summary.json", source.problem / "config.yaml"};
  if (!source.model.empty()) files.push_back(source.model);
  Json inputs = Json::array();
  for (const auto& file : files) inputs.push_back({{"path", file.string()}, {"sha256", to_hex(hash_of_file(file))}});
  return inputs;
}

std::string command(const PlanOptions& options, const std::string& method, const PlanSource& source) {
  std::string text = "mapweave plan " + shell_word(source.problem.string()) + " --method " + method + " --seed " +
                     std::to_string(options.seed);
  if (options.edges_per_robot > 1) text += " --edges-per-robot " + std::to_string(options.edges_per_robot);
  if (!source.model.empty()) text += " --model " + shell_word(source.model.string());
  return text + " --report again.html";
}

}  // namespace

std::string plan_page(const Problem& problem, const PlanOptions& options, const Plan& plan, const PlanSource& source) {
  const Latency latency(problem, options.model);
  const LatencyTerms terms = latency.terms(robots_by_edge(problem, plan));
  const std::string& method = scheduling::plan_method_names()[static_cast<std::size_t>(options.method)];
  const Json data = {{"robots", robots_json(problem, plan)},
                     {"overlaps", overlaps_json(problem.overlaps)},
                     {"overlap_count", problem.overlaps.links()},
                     {"edges", edges_json(latency, terms)},
                     {"cloud", {{"speed", problem.cloud.speed}, {"edges_judge", problem.cloud.edges_judge}}},
                     {"timeline", timeline_json(latency, terms, plan.predicted_seconds)},
                     {"method", method},
                     {"edges_per_robot", options.edges_per_robot},
                     {"in_group_weight", plan.in_group_weight},
                     {"cut_weight", plan.cut_weight},
                     {"predicted_seconds", plan.predicted_seconds},
                     {"lower_bound_seconds", plan.lower_bound_seconds},
                     {"seed", options.seed},
                     {"commands", {command(options, method, source)}},
                     {"inputs", inputs_json(source)},
                     {"versions", {{"mapweave", source.program_version}}}};
  const std::string title = "mapweave plan: " + std::to_string(problem.robots.size()) + " robots, " +
                            std::to_string(problem.edges.size()) + " edges";
  return page_text(PageKind::plan, title, data);
}

}  // namespace mapweave::report
