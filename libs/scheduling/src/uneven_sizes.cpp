#include "uneven_sizes.h"

#include <algorithm>
#include <numeric>

namespace mapweave::scheduling {
namespace {

// Each robot has the mean number of scans, shares nothing and has no link of its own.
Problem with_robots_alike(const Problem& problem, const LatencyModel& model) {
  Problem alike;
  alike.robots = problem.robots;
  alike.overlaps = OverlapGraph(problem.robots.size(), {});
  alike.edges = problem.edges;
  alike.cloud = problem.cloud;
  const double scans = std::accumulate(problem.scans.begin(), problem.scans.end(), 0.0,
                                       [&](double sum, const auto& one) { return sum + one.value_or(model.scans); });
  alike.scans.assign(problem.robots.size(), scans / static_cast<double>(problem.robots.size()));
  return alike;
}

// t_c by how many robots each edge has.
class TimeOfCounts {
 public:
  TimeOfCounts(const Problem& problem, const LatencyModel& model)
      : problem_(with_robots_alike(problem, model)), latency_(problem_, model), edge_seconds_(problem.edges.size()) {}
  TimeOfCounts(const TimeOfCounts&) = delete;
  TimeOfCounts& operator=(const TimeOfCounts&) = delete;

  double seconds(const std::vector<std::uint32_t>& counts) {
    double last = 0.0;
    std::vector<double> scans;
    for (std::uint32_t edge = 0; edge < counts.size(); ++edge) {
      last = std::max(last, edge_seconds(edge, counts[edge]));
      scans.push_back(counts[edge] * latency_.scans(0));
    }
    return last + latency_.cloud_seconds(scans);
  }

 private:
  double edge_seconds(std::uint32_t edge, std::uint32_t count) {
    std::vector<double>& known = edge_seconds_[edge];
    while (known.size() <= count) {
      std::vector<std::uint32_t> robots(known.size());
      std::iota(robots.begin(), robots.end(), 0);
      known.push_back(latency_.edge_seconds(robots, edge));
    }
    return known[count];
  }

  const Problem problem_;
  const Latency latency_;
  std::vector<std::vector<double>> edge_seconds_;  // by edge and count
};

// The largest groups to the edges with most room, of these to the fastest.
std::vector<std::uint32_t> counts_of(const std::vector<std::uint32_t>& sizes, const std::vector<std::uint32_t>& rooms,
                                     const Problem& problem) {
  std::vector<std::uint32_t> order(rooms.size()), counts(rooms.size(), 0);
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return rooms[a] != rooms[b] ? rooms[a] > rooms[b] : problem.edges[a].speed > problem.edges[b].speed;
  });
  for (std::size_t i = 0; i < sizes.size(); ++i) counts[order[i]] = sizes[i];
  return counts;
}

}  // namespace

std::vector<std::uint32_t> uneven_sizes(const Problem& problem, const LatencyModel& model,
                                        std::vector<std::uint32_t> sizes) {
  const auto& edges = problem.edges;
  if (std::all_of(edges.begin(), edges.end(), [&](const auto& edge) { return edge.speed == edges.front().speed; }))
    return sizes;
  const auto robots = static_cast<std::uint32_t>(problem.robots.size());
  std::vector<std::uint32_t> rooms;
  for (const EdgeResources& edge : edges) rooms.push_back(std::min(edge.capacity.value_or(robots), robots));
  TimeOfCounts time(problem, model);
  std::vector<std::uint32_t> counts = counts_of(sizes, rooms, problem), best = counts;
  for (double least = time.seconds(counts);; counts = best) {
    for (std::size_t from = 0; from < edges.size(); ++from)
      for (std::size_t to = 0; to < edges.size(); ++to) {
        if (from == to || counts[from] == 0 || counts[to] == rooms[to]) continue;
        std::vector<std::uint32_t> moved = counts;
        --moved[from];
        ++moved[to];
        if (const double seconds = time.seconds(moved); seconds < least) {
          least = seconds;
          best = std::move(moved);
        }
      }
    if (best == counts) break;
  }
  counts.erase(std::remove(counts.begin(), counts.end(), 0u), counts.end());
  std::sort(counts.rbegin(), counts.rend());
  return counts;
}

}  // namespace mapweave::scheduling
