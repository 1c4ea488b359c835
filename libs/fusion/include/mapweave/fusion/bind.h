#pragma once
// One graph of one robot's laser and cameras: keyframes and laser nodes of one robot are tied by time, so that a loop that a camera sees
// moves the grid, and an alignment of walls moves keyframes.

#include <mapweave/graph/pose_graph.h>
#include <mapweave/maps/map.h>

#include <vector>

namespace mapweave::fusion {

struct BindOptions {
  double longest_gap_s = 1.0;
  double tie_m = 0.02, tie_rad = 0.01;
  double step_m = 0.02, step_share = 0.02, step_rad = 0.012;
  int least_shared = 15;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("longest_gap_s", longest_gap_s, "between the scans around a keyframe, for the two to be tied");
    v.positive("tie_m", tie_m, "how far a keyframe may be from where the laser says that the robot was, beside both maps' errors");
    v.positive("tie_rad", tie_rad, "the same in heading");
    v.positive("step_m", step_m, "error of the way from one keyframe to another that sees the same");
    v.non_negative("step_share", step_share, "and of its length");
    v.positive("step_rad", step_rad, "error of its heading");
    v.integer("least_shared", least_shared, 1, 100000, "landmarks that two keyframes see, for the way between them to be known");
  }
};

// The laser map with the keyframes and landmarks of the camera maps (all of one robot), under the belief that agrees best with both. A
// camera map whose time has no scan around it is not in the result: its id is among `apart`. The result has the laser map's id; its first
// node stays where the camera or laser map has it.
struct BoundMap {
  Map map;
  std::vector<MapId> apart;
};
BoundMap bound(Map laser, const std::vector<Map>& cameras, const BindOptions& options = {}, const graph::SolveOptions& solve = {});

}  // namespace mapweave::fusion
