#include <mapweave/runtime/problem_of_run.h>

#include "planned_links.h"

#include <mapweave/core/files.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/scheduling/json_fields.h>

#include <nlohmann/json.hpp>

#include <algorithm>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::json;

std::map<std::string, double> scans_of(const std::filesystem::path& summary) {
  constexpr std::uint64_t kMostBytes = 1 << 26;
  constexpr double kMost = 1e12;
  const std::string where = summary.string(), key = "robots";
  const Json root = scheduling::parse_json(read_file(summary, kMostBytes), where);
  const Json& robots = scheduling::member(root, "robots", where, "");
  if (!robots.is_array()) scheduling::refuse("a list was expected", where, key, "");
  std::map<std::string, double> scans;
  for (const Json& robot : robots) {
    if (!robot.is_object()) scheduling::refuse("an object was expected", where, key, "");
    scans[scheduling::name(scheduling::member(robot, "id", where, key), where, key + ".id")] =
        scheduling::number(scheduling::member(robot, "scans", where, key), 0.0, kMost, false, where, key + ".scans");
  }
  return scans;
}

transport::LinkState at_first(const NetworkOptions& network, const std::string& from, const std::string& to,
                              const transport::LinkModelOptions& otherwise) {
  return transport::LinkModel(wire_between(network, from, to, otherwise), 0).state_at(0.0);
}

scheduling::EdgeResources resources_of(const EdgeEntry& entry, const RunConfiguration& configuration) {
  scheduling::EdgeResources edge;
  edge.id = TierId(entry.id);
  edge.speed = configuration.processors.edge_speed() * entry.speed;
  edge.bandwidth_bytes_per_s = kAnyBytesPerS;
  edge.delay_s = 0.0;  // where the cloud is
  if (entry.id != configuration.cloud.at) {
    const std::string cloud = configuration.cloud.at.empty() ? cloud_tier().str() : configuration.cloud.at;
    const transport::LinkState wire =
        at_first(configuration.network, entry.id, cloud, configuration.network.edge_cloud);
    edge.bandwidth_bytes_per_s = planned_bytes_per_s(wire);
    edge.delay_s = wire.delay_s;
  }
  if (entry.capacity > 0) edge.capacity = static_cast<std::uint32_t>(entry.capacity);
  return edge;
}

}  // namespace

scheduling::Problem problem_of_run(const std::filesystem::path& folder) {
  const std::filesystem::path summary = folder / "summary.json";
  const Work work = read_work(summary, nullptr);
  RunConfiguration configuration;
  load(configuration, {{folder / "config.yaml"}, {}, {}});
  if (configuration.edges.empty())
    scheduling::refuse("there are no edges", (folder / "config.yaml").string(), "edges", "run it again with edges");
  const std::map<std::string, double> scans = scans_of(summary);
  scheduling::Problem problem;
  problem.cloud = planned_cloud(configuration);
  std::map<RobotId, std::uint32_t> numbers;
  for (const RobotWork& robot : work.robots) {
    numbers.emplace(robot.id, static_cast<std::uint32_t>(problem.robots.size()));
    problem.robots.push_back(robot.id);
    const auto count = scans.find(robot.id.str());
    const bool has_scans = count != scans.end() && count->second > 0.0;  // a robot that maps with cameras has none
    problem.scans.push_back(has_scans ? std::optional(count->second) : std::nullopt);
  }
  std::vector<scheduling::OverlapLink> links;
  for (const OverlapOfRobots& overlap : work.overlaps) {
    const auto a = numbers.find(overlap.a), b = numbers.find(overlap.b);
    if (a == numbers.end() || b == numbers.end())
      scheduling::refuse("an overlap is of no robot of the run", summary.string(), "timeline.overlaps", "");
    links.push_back({a->second, b->second, overlap.degree});
  }
  problem.overlaps = scheduling::OverlapGraph(problem.robots.size(), links);
  for (const EdgeEntry& edge : configuration.edges) {
    const auto number = static_cast<std::uint32_t>(problem.edges.size());
    problem.edges.push_back(resources_of(edge, configuration));
    for (const auto& [robot, index] : numbers) {
      const transport::LinkState wire =
          at_first(configuration.network, robot.str(), edge.id, configuration.network.robot_edge);
      problem.links[{index, number}] = {planned_bytes_per_s(wire), wire.delay_s};
    }
  }
  scheduling::group_sizes(problem, (folder / "config.yaml").string());
  return problem;
}

}  // namespace mapweave::runtime
