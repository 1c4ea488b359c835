#pragma once
// Options with one field of every kind, as the tests of loading and printing need them.

#include <mapweave/core/options.h>

namespace mapweave::test {

enum class Engine { graph, rbpf, icp };

struct MatcherOptions {
  double search_radius_m = 4.0;
  double min_score = 0.55;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("search_radius_m", search_radius_m, "half the side of the searched square");
    v.fraction("min_score", min_score, "mean occupancy under the scan");
  }
};

struct LaserOptions {
  Engine engine = Engine::graph;
  MatcherOptions graph;
  bool close_loops = true;
  double height_m = 0.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice("engine", engine, {{"graph", Engine::graph}, {"rbpf", Engine::rbpf}, {"icp", Engine::icp}},
             "which mapper");
    v.section("graph", graph, "the mapper of submaps");
    v.flag("close_loops", close_loops, "look for places seen before");
    v.number("height_m", height_m, -2.0, 2.0, "above the robot's base");
  }
};

struct PointOptions {
  double x_m = 0.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("x_m", x_m, -10.0, 10.0, "forward");
  }
};

struct RobotOptions {
  std::string id, edge;
  std::vector<PointOptions> waypoints;
  PointOptions start;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("id", id, "the robot's name");
    v.text("edge", edge, "the edge that maps it");
    v.list("waypoints", waypoints, "where it goes");
    v.section("start", start, "where it begins");
  }
};

struct TeamOptions {
  std::uint32_t seed = 1;
  std::vector<RobotOptions> robots;
  LaserOptions laser;
  double decay_s = 0.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("seed", seed, 0, 4294967295, "of everything random");
    v.list("robots", robots, "who recorded what");
    v.section("laser", laser, "one robot's mapping");
    v.non_negative("decay_s", decay_s, "how long old scans count");
  }
};

}  // namespace mapweave::test
