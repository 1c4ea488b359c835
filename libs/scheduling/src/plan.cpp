#include <mapweave/scheduling/plan.h>

#include "uneven_sizes.h"

#include <mapweave/core/error.h>
#include <mapweave/core/stopwatch.h>

#include <algorithm>
#include <limits>

namespace mapweave::scheduling {
namespace {

constexpr double kWorthwhile = 0.05;  // groups are uneven where that saves more than this share of the time

Groups members_of(const GroupOf& group_of, std::size_t groups) {
  Groups members(groups);
  for (std::uint32_t robot = 0; robot < group_of.size(); ++robot) members[group_of[robot]].push_back(robot);
  return members;
}

Groups grouped(const Problem& problem, const PlanOptions& options, const std::vector<std::uint32_t>& sizes) {
  const OverlapGraph& graph = problem.overlaps;
  GroupOf group_of;
  switch (options.method) {
    case PlanMethod::standard: group_of = group_balanced(graph, sizes, {options.seed}); break;
    case PlanMethod::recslam:  // knows the number of edges and nothing of capacities; may leave groups empty
      return members_of(group_recslam(graph, static_cast<std::uint32_t>(problem.edges.size()), options.recslam),
                        problem.edges.size());
    case PlanMethod::greedy: group_of = group_greedy(graph, sizes, options.seed); break;
    case PlanMethod::random: group_of = group_randomly(graph.size(), sizes, options.seed); break;
    case PlanMethod::metis: {
      const auto found = group_with_metis(graph, sizes, options.seed);
      if (!found)
        throw Error(ErrorCode::kUnsupported, "this program was built without METIS", "--method metis",
                    "install libmetis-dev and build again");
      group_of = *found;
      break;
    }
    case PlanMethod::exact:
      if (graph.size() > kMostExact)
        throw Error(ErrorCode::kBadInput,
                    std::to_string(graph.size()) + " robots are too many for the exact method, which takes " +
                        std::to_string(kMostExact),
                    "--method exact", "choose default");
      group_of = group_exactly(graph, sizes);
      break;
  }
  return members_of(group_of, sizes.size());
}

// Greedy and random know nothing of edges: group i goes to the i-th edge with room for it.
std::vector<std::uint32_t> placed(const Latency& latency, const Groups& groups, PlanMethod method) {
  if (method == PlanMethod::recslam) return place_as_recslam(latency, groups);
  if (method != PlanMethod::greedy && method != PlanMethod::random) return place_optimally(latency, groups);
  // The fullest edges take the largest groups; where capacities are equal, this is their order.
  const auto& edges = latency.problem().edges;
  std::vector<std::uint32_t> by_room(edges.size()), by_size(groups.size()), edge_of(groups.size());
  for (std::uint32_t i = 0; i < by_room.size(); ++i) by_room[i] = i;
  for (std::uint32_t i = 0; i < by_size.size(); ++i) by_size[i] = i;
  std::stable_sort(by_room.begin(), by_room.end(), [&](std::uint32_t a, std::uint32_t b) {
    constexpr auto kAny = std::numeric_limits<std::uint32_t>::max();
    return edges[a].capacity.value_or(kAny) > edges[b].capacity.value_or(kAny);
  });
  std::stable_sort(by_size.begin(), by_size.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return groups[a].size() > groups[b].size(); });
  for (std::size_t i = 0; i < by_size.size(); ++i) edge_of[by_size[i]] = by_room[i];
  return edge_of;
}

void offload_to_further_edges(const Latency& latency, std::uint32_t edges_per_robot, Plan& plan, Groups& robots_at) {
  const auto& edges = latency.problem().edges;
  const auto robots = static_cast<std::uint32_t>(plan.edge_of.size());
  plan.further_edges_of.resize(robots);
  std::vector<std::uint32_t> room;
  std::uint64_t rooms = 0;
  for (const EdgeResources& edge : edges) {
    room.push_back(std::min(edge.capacity.value_or(robots), robots));
    rooms += room.back();
  }
  if (edges_per_robot > edges.size() || rooms < std::uint64_t{robots} * edges_per_robot)
    throw Error(ErrorCode::kBadInput, "the edges cannot take each robot " + std::to_string(edges_per_robot) + " times",
                "--edges-per-robot", "add edges, raise capacities, or ask for fewer");
  for (std::uint32_t copy = 1; copy < edges_per_robot; ++copy)
    for (std::uint32_t robot = 0; robot < robots; ++robot) {
      double least = std::numeric_limits<double>::infinity();
      std::size_t chosen = edges.size();
      for (std::uint32_t edge = 0; edge < edges.size(); ++edge) {
        auto& there = robots_at[edge];
        const auto place = std::lower_bound(there.begin(), there.end(), robot);
        if (there.size() >= room[edge] || (place != there.end() && *place == robot)) continue;
        auto with = there;
        with.insert(with.begin() + (place - there.begin()), robot);
        if (const double seconds = latency.edge_seconds(with, edge); seconds < least) {
          least = seconds;
          chosen = edge;
        }
      }
      if (chosen == edges.size())
        throw Error(ErrorCode::kBadInput,
                    "no further edge has room for robot '" + latency.problem().robots[robot].str() + "'",
                    "--edges-per-robot", "raise capacities, or ask for fewer");
      auto& there = robots_at[chosen];
      there.insert(std::lower_bound(there.begin(), there.end(), robot), robot);
      plan.further_edges_of[robot].push_back(static_cast<std::uint32_t>(chosen));
    }
}

Plan plan_with_sizes(const Latency& latency, const PlanOptions& options, const std::vector<std::uint32_t>& sizes) {
  const Problem& problem = latency.problem();
  Groups groups = grouped(problem, options, sizes);
  const std::vector<std::uint32_t> edge_of = placed(latency, groups, options.method);
  Plan plan;
  plan.edge_of.resize(problem.robots.size());
  Groups robots_at(problem.edges.size());
  GroupOf group_of(problem.robots.size());
  for (std::uint32_t group = 0; group < groups.size(); ++group) {
    for (const std::uint32_t robot : groups[group]) {
      plan.edge_of[robot] = edge_of[group];
      group_of[robot] = group;
    }
    robots_at[edge_of[group]] = groups[group];
  }
  if (options.edges_per_robot > 1) offload_to_further_edges(latency, options.edges_per_robot, plan, robots_at);
  groups.erase(std::remove_if(groups.begin(), groups.end(), [](const auto& group) { return group.empty(); }),
               groups.end());
  std::sort(groups.begin(), groups.end());
  plan.groups = std::move(groups);
  plan.cut_weight = cut_weight(problem.overlaps, group_of);
  plan.in_group_weight = in_group_weight(problem.overlaps, group_of);
  plan.predicted_seconds = latency.total_seconds(robots_at);
  return plan;
}

// The methods of the papers make groups of equal size.
bool looks_at_speeds(PlanMethod method) { return method == PlanMethod::standard || method == PlanMethod::exact; }

}  // namespace

const std::vector<std::string>& plan_method_names() {
  static const std::vector<std::string> names{"default", "recslam", "greedy", "random", "metis", "exact"};
  return names;
}

Plan make_plan(const Problem& problem, const PlanOptions& options) {
  MAPWEAVE_EXPECT(options.edges_per_robot >= 1, "every robot has an edge");
  const Latency latency(problem, options.model);
  const double start = thread_cpu_seconds();
  const std::vector<std::uint32_t> even = group_sizes(problem);
  Plan plan = plan_with_sizes(latency, options, even);
  if (looks_at_speeds(options.method))
    if (const auto uneven = uneven_sizes(problem, options.model, even); uneven != even) {
      Plan other = plan_with_sizes(latency, options, uneven);
      if (other.predicted_seconds < plan.predicted_seconds * (1.0 - kWorthwhile)) plan = std::move(other);
    }
  plan.algorithm_seconds = thread_cpu_seconds() - start;
  plan.lower_bound_seconds = lower_bound_seconds(latency);
  return plan;
}

}  // namespace mapweave::scheduling
