// How groupings compare on random graphs: cut weight and processor time.
//   grouping_benchmark exact [GRAPHS]         the default against the least cut there is, 4 to 16 robots
//   grouping_benchmark compare [MOST_ROBOTS]  the default against METIS, greedy and recslam
//   grouping_benchmark worse [SEEDS]          how often, and by how much, another one is better; 10 to 64 robots
//   grouping_benchmark time                   milliseconds of the default on one core
// Prints JSON.
#include <mapweave/scheduling/grouping.h>

#include "random_overlaps.h"

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <functional>
#include <string>

using namespace mapweave;
using namespace mapweave::scheduling;

namespace {

double cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

void exact(std::uint32_t count) {
  double sum = 0.0, worst = 0.0;
  std::uint32_t found = 0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t robots = 4 + i % 13, groups = std::min(2 + i / 13 % 5, robots / 2);
    const OverlapGraph graph = testing_graphs::of_kind(testing_graphs::kKinds[i % 4], robots, i);
    const auto sizes = testing_graphs::even_sizes(robots, groups);
    const double best = cut_weight(graph, group_exactly(graph, sizes)),
                 ours = cut_weight(graph, group_balanced(graph, sizes, {i}));
    const double excess = best > 1e-12 ? ours / best - 1.0 : ours > 1e-12 ? 1.0 : 0.0;
    sum += excess;
    worst = std::max(worst, excess);
    found += excess < 1e-9;
  }
  std::printf("{\"graphs\": %u, \"mean_excess\": %.6f, \"worst_excess\": %.6f, \"optimal\": %u}\n", count, sum / count,
              worst, found);
}

void compare(std::uint32_t most_robots) {
  std::printf("[");
  const char* comma = "";
  for (const std::uint32_t robots : {10u, 20u, 50u, 100u, 200u, 500u, 1000u, 2000u}) {
    if (robots > most_robots) break;
    for (const char* kind : testing_graphs::kKinds)
      for (const std::uint32_t groups : {2u, 3u, 5u, 8u, 16u}) {
        if (groups * 2 > robots) continue;
        const OverlapGraph graph = testing_graphs::of_kind(kind, robots, 7 * robots + groups);
        const auto sizes = testing_graphs::even_sizes(robots, groups);
        const auto measured = [&](const char* name, const std::function<GroupOf()>& method) {
          const double start = cpu_seconds();
          const GroupOf group_of = method();
          const double seconds = cpu_seconds() - start;
          std::printf(", \"%s\": %.9g, \"%s_ms\": %.4g", name, cut_weight(graph, group_of), name, 1e3 * seconds);
        };
        std::printf("%s\n{\"kind\": \"%s\", \"robots\": %u, \"links\": %zu, \"groups\": %u", comma, kind, robots,
                    graph.links(), groups);
        comma = ",";
        measured("default", [&] { return group_balanced(graph, sizes); });
        if (group_with_metis(graph, sizes)) measured("metis", [&] { return *group_with_metis(graph, sizes); });
        measured("greedy", [&] { return group_greedy(graph, sizes); });
        measured("recslam", [&] { return group_recslam(graph, groups); });
        RecslamOptions intended;
        intended.search = RecslamSearch::tabu;
        measured("recslam_tabu", [&] { return group_recslam(graph, groups, intended); });
        intended.search = RecslamSearch::none;
        measured("recslam_no_search", [&] { return group_recslam(graph, groups, intended); });
        measured("random", [&] { return group_randomly(robots, sizes); });
        std::printf("}");
        std::fflush(stdout);
      }
  }
  std::printf("\n]\n");
}

void worse(std::uint32_t seeds) {
  std::printf("[");
  const char* comma = "";
  for (const std::uint32_t robots : {10u, 16u, 20u, 32u, 50u, 64u}) {
    std::uint32_t graphs = 0, behind = 0, far_behind = 0;
    double worst = 0.0, before = cpu_seconds(), seconds = 0.0;
    for (std::uint32_t seed = 1; seed <= seeds; ++seed)
      for (const char* kind : testing_graphs::kKinds)
        for (const std::uint32_t groups : {2u, 3u, 5u, 8u}) {
          if (groups * 2 > robots) continue;
          const OverlapGraph graph = testing_graphs::of_kind(kind, robots, 1000 + 7 * seed + groups);
          const auto sizes = testing_graphs::even_sizes(robots, groups);
          before = cpu_seconds();
          const double ours = cut_weight(graph, group_balanced(graph, sizes));
          seconds += cpu_seconds() - before;
          double best =
              std::min(cut_weight(graph, group_greedy(graph, sizes)), cut_weight(graph, group_recslam(graph, groups)));
          if (const auto metis = group_with_metis(graph, sizes)) best = std::min(best, cut_weight(graph, *metis));
          const double excess = ours <= best + 1e-9 ? 0.0 : best > 0.0 ? ours / best - 1.0 : 1.0;
          ++graphs;
          behind += excess > 0.0;
          far_behind += excess > 0.01;
          worst = std::max(worst, excess);
        }
    std::printf(
        "%s\n{\"robots\": %u, \"graphs\": %u, \"behind\": %u, \"behind_by_a_percent\": %u, \"worst\": %.4f, \"ms\": "
        "%.4g}",
        comma, robots, graphs, behind, far_behind, worst, 1e3 * seconds / graphs);
    std::fflush(stdout);
    comma = ",";
  }
  std::printf("\n]\n");
}

void time() {
  std::printf("[");
  const char* comma = "";
  for (const std::uint32_t robots : {10u, 20u, 50u, 100u, 200u, 500u, 1000u, 2000u, 5000u, 10000u})
    for (const char* kind : testing_graphs::kKinds) {
      if (robots > 2000 && std::string(kind) == "dense") continue;
      for (const std::uint32_t groups : {3u, 10u}) {
        if (groups * 2 > robots) continue;
        const OverlapGraph graph = testing_graphs::of_kind(kind, robots, 3);
        const auto sizes = testing_graphs::even_sizes(robots, groups);
        const int repetitions = robots <= 200 ? 50 : robots <= 1000 ? 5 : 1;
        const double start = cpu_seconds();
        for (int i = 0; i < repetitions; ++i) group_balanced(graph, sizes, {static_cast<std::uint64_t>(i)});
        std::printf("%s\n{\"kind\": \"%s\", \"robots\": %u, \"links\": %zu, \"groups\": %u, \"ms\": %.4g}", comma, kind,
                    robots, graph.links(), groups, 1e3 * (cpu_seconds() - start) / repetitions);
        std::fflush(stdout);
        comma = ",";
      }
    }
  std::printf("\n]\n");
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  const int number = argc > 2 ? std::atoi(argv[2]) : 0;
  if (what == "exact")
    exact(number > 0 ? static_cast<std::uint32_t>(number) : 200);
  else if (what == "compare")
    compare(number > 0 ? static_cast<std::uint32_t>(number) : 2000);
  else if (what == "worse")
    worse(number > 0 ? static_cast<std::uint32_t>(number) : 10);
  else if (what == "time") {
    time();
  } else {
    std::fprintf(stderr, "usage: grouping_benchmark exact [GRAPHS] | compare [MOST_ROBOTS] | worse [SEEDS] | time\n");
    return 2;
  }
  return 0;
}
