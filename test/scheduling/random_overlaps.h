#pragma once
// Random overlap graphs for tests and benches of scheduling.

#include <mapweave/scheduling/overlap_graph.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

namespace mapweave::scheduling::testing_graphs {

// building: discs of what robots saw, in a square; clustered: the same, gathered around places; sparse, dense: Erdos
// and Renyi's, about 8 links a robot and every second pair.
constexpr const char* kKinds[] = {"building", "sparse", "dense", "clustered"};

inline double uniform(std::mt19937_64& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }

// Common part of two discs.
inline double lens(double distance, double r, double s) {
  if (distance >= r + s) return 0.0;
  if (distance <= std::abs(r - s)) return M_PI * std::min(r, s) * std::min(r, s);
  const double a = (distance * distance + r * r - s * s) / (2.0 * distance * r),
               b = (distance * distance + s * s - r * r) / (2.0 * distance * s);
  return r * r * std::acos(a) + s * s * std::acos(b) -
         0.5 * std::sqrt((-distance + r + s) * (distance + r - s) * (distance - r + s) * (distance + r + s));
}

inline OverlapGraph of_kind(const std::string& kind, std::uint32_t robots, std::uint64_t seed) {
  std::mt19937_64 random(seed * 1000003 + robots);
  std::vector<OverlapLink> links;
  if (kind == "sparse" || kind == "dense") {
    const double chance = kind == "dense" ? 0.5 : std::min(0.7, 8.0 / robots);
    for (std::uint32_t a = 0; a < robots; ++a)
      for (std::uint32_t b = a + 1; b < robots; ++b)
        if (uniform(random) < chance) links.push_back({a, b, 0.5 * uniform(random)});
    return OverlapGraph(robots, links);
  }
  // About eight neighbours each.
  const double side = std::sqrt(static_cast<double>(robots));
  std::vector<double> x(robots), y(robots), r(robots);
  std::vector<std::pair<double, double>> places(std::max(2u, robots / 12));
  for (auto& place : places) place = {side * uniform(random), side * uniform(random)};
  for (std::uint32_t i = 0; i < robots; ++i) {
    x[i] = side * uniform(random);
    y[i] = side * uniform(random);
    if (kind == "clustered") {
      const auto& place = places[random() % places.size()];
      x[i] = place.first + 0.08 * (x[i] - 0.5 * side) + uniform(random) - 0.5;
      y[i] = place.second + 0.08 * (y[i] - 0.5 * side) + uniform(random) - 0.5;
    }
    r[i] = 0.5 + 0.6 * uniform(random);
  }
  for (std::uint32_t a = 0; a < robots; ++a)
    for (std::uint32_t b = a + 1; b < robots; ++b) {
      if (std::abs(x[a] - x[b]) > 2.2) continue;
      const double common = lens(std::hypot(x[a] - x[b], y[a] - y[b]), r[a], r[b]);
      if (common > 0.0) links.push_back({a, b, common / (M_PI * (r[a] * r[a] + r[b] * r[b]))});
    }
  return OverlapGraph(robots, links);
}

inline std::vector<std::uint32_t> even_sizes(std::uint32_t robots, std::uint32_t groups) {
  std::vector<std::uint32_t> sizes;
  for (std::uint32_t i = 0; i < groups; ++i) sizes.push_back(robots / groups + (i < robots % groups));
  return sizes;
}

}  // namespace mapweave::scheduling::testing_graphs
