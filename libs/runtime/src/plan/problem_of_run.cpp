#include <mapweave/runtime/problem_of_run.h>

#include "planned_links.h"

#include <mapweave/core/files.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/runtime/timeline.h>
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
    problem.edges.push_back(planned_edge(edge, configuration, configuration.network));
    for (const auto& [robot, index] : numbers)
      problem.links[{index, number}] = planned_link(robot, TierId(edge.id), configuration.network);
  }
  scheduling::group_sizes(problem, (folder / "config.yaml").string());
  return problem;
}

}  // namespace mapweave::runtime
