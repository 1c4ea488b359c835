#include <mapweave/scheduling/placement.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <limits>
#include <set>

namespace mapweave::scheduling {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
constexpr std::uint32_t kNobody = ~std::uint32_t{0};

bool fits(const Latency& latency, const Groups& groups, std::size_t group, std::uint32_t edge) {
  return groups[group].size() <= latency.problem().edges[edge].capacity.value_or(~std::uint32_t{0});
}

[[noreturn]] void refuse() {
  throw Error(ErrorCode::kBadInput, "the groups do not fit on the edges, whose capacities differ", "edges",
              "method default makes groups that follow capacities");
}

// Edge by group where all of `seconds` (group by group, edges in a row) that are used are at most `limit`; empty where
// there is none. Augmenting paths, each found breadth first.
std::vector<std::uint32_t> assignment_below(const std::vector<double>& seconds, std::size_t groups, std::size_t edges,
                                            double limit) {
  std::vector<std::uint32_t> edge_of(groups, kNobody), group_of(edges, kNobody), from(edges);
  for (std::uint32_t start = 0; start < groups; ++start) {
    std::vector<std::uint32_t> queue{start};
    std::fill(from.begin(), from.end(), kNobody);
    std::uint32_t end = kNobody;
    for (std::size_t i = 0; i < queue.size() && end == kNobody; ++i)
      for (std::uint32_t edge = 0; edge < edges && end == kNobody; ++edge) {
        if (from[edge] != kNobody || seconds[queue[i] * edges + edge] > limit) continue;
        from[edge] = queue[i];
        if (group_of[edge] == kNobody)
          end = edge;
        else
          queue.push_back(group_of[edge]);
      }
    if (end == kNobody) return {};
    for (std::uint32_t edge = end; edge != kNobody;) {
      const std::uint32_t group = from[edge], next = edge_of[group];
      edge_of[group] = edge;
      group_of[edge] = group;
      edge = next;
    }
  }
  return edge_of;
}

// Of edges at least so fast; empty where groups do not fit on them.
std::vector<std::uint32_t> place_on_edges_from(double speed, const Latency& latency, const Groups& groups) {
  const std::size_t edges = latency.problem().edges.size();
  std::vector<double> seconds, limits;
  for (std::size_t group = 0; group < groups.size(); ++group)
    for (std::uint32_t edge = 0; edge < edges; ++edge) {
      const bool may = latency.problem().edges[edge].speed >= speed && fits(latency, groups, group, edge);
      seconds.push_back(may ? latency.edge_seconds(groups[group], edge) : kNever);
      if (seconds.back() != kNever) limits.push_back(seconds.back());
    }
  std::sort(limits.begin(), limits.end());
  limits.erase(std::unique(limits.begin(), limits.end()), limits.end());
  std::vector<std::uint32_t> best;
  for (std::size_t low = 0, high = limits.size(); low < high;) {
    const std::size_t middle = low + (high - low) / 2;
    if (auto found = assignment_below(seconds, groups.size(), edges, limits[middle]); !found.empty()) {
      best = std::move(found);
      high = middle;
    } else {
      low = middle + 1;
    }
  }
  return best;
}

}  // namespace

// What edges judge for the cloud waits for the slowest that is used: each speed is tried as the least one.
std::vector<std::uint32_t> place_optimally(const Latency& latency, const Groups& groups) {
  const Problem& problem = latency.problem();
  std::set<double> speeds;
  for (const EdgeResources& edge : problem.edges) speeds.insert(edge.speed);
  const bool may_choose = problem.cloud.edges_judge && groups.size() < problem.edges.size();
  std::vector<std::uint32_t> best;
  double least = kNever;
  for (const double speed : speeds) {
    std::vector<std::uint32_t> edge_of = place_on_edges_from(speed, latency, groups);
    if (edge_of.empty()) break;
    Groups robots_at(problem.edges.size());
    for (std::size_t group = 0; group < groups.size(); ++group) robots_at[edge_of[group]] = groups[group];
    if (const double seconds = latency.total_seconds(robots_at); best.empty() || seconds < least) {
      least = seconds;
      best = std::move(edge_of);
    }
    if (!may_choose) break;
  }
  if (best.empty() && !groups.empty()) refuse();
  return best;
}

std::vector<std::uint32_t> place_as_recslam(const Latency& latency, const Groups& groups) {
  const Problem& problem = latency.problem();
  std::vector<bool> taken(problem.edges.size(), false);
  std::vector<std::uint32_t> edge_of;
  for (std::size_t group = 0; group < groups.size(); ++group) {
    double least = kNever;
    std::uint32_t chosen = kNobody;
    for (std::uint32_t edge = 0; edge < problem.edges.size(); ++edge) {
      if (taken[edge] || !fits(latency, groups, group, edge)) continue;
      const double seconds = latency.computing_seconds(groups[group], edge) +
                             latency.fused_bytes(groups[group]) / problem.edges[edge].bandwidth_bytes_per_s;  // line 2
      if (chosen == kNobody || seconds < least) {
        least = seconds;
        chosen = edge;
      }
    }
    if (chosen == kNobody) refuse();
    taken[chosen] = true;
    edge_of.push_back(chosen);
  }
  return edge_of;
}

}  // namespace mapweave::scheduling
