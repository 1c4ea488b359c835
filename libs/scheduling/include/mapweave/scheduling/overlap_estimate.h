#pragma once
// How much do two maps share, as far as their summaries show (RecSLAM IV-A, V)? Guesses for scheduling: no map is
// merged by them. Pure functions; thread-safe.

#include <mapweave/core/geometry.h>
#include <mapweave/core/ids.h>
#include <mapweave/maps/map.h>
#include <mapweave/maps/map_summary.h>

#include <map>
#include <optional>
#include <vector>

namespace mapweave::scheduling {

struct Waypoint {
  double x_m = 0.0, y_m = 0.0;  // frame team
};

// What scans, keyframes' landmarks and grids of the map show. Empty for an empty map, and for one of more than
// kMostCells.
MapSummary summary_of(const Map&);
// Before there is a map: what a robot that announces its route will have seen within `range_m` of it. In the team's
// frame.
MapSummary summary_of_route(const std::vector<Waypoint>&, double range_m);

// |A and B| / (|A| + |B|) in known cells, 0 to 0.5 (RecSLAM IV-A).
double overlap_degree(const MapSummary& a, const MapSummary& b, const Pose2& a_from_b);

// Where nobody knows how the maps lie: viewpoints that look alike are laid on each other in all headings, with what
// stands around them, each map's walls on the other map, and what most of them say counts: the answer hardly depends
// on which map is named first. nullopt where nothing agrees.
struct EstimatedOverlap {
  Pose2 a_from_b;
  double degree = 0.0;
};
std::optional<EstimatedOverlap> estimate_overlap(const MapSummary& a, const MapSummary& b);

// The summaries of a team as they grow, and what pairs of them share. Work and memory grow with robots, not with their
// pairs: each is compared with the few others that look most like it. The same summaries in the same order give the
// same answer. Not thread-safe.
class OverlapEstimator {
 public:
  void put(const RobotId&, MapSummary);  // in place of the one before; an empty one is forgotten
  void remove(const RobotId& robot) { maps_.erase(robot); }

  struct Overlap {
    RobotId a, b;  // a < b
    double degree;
  };
  // Pairs that share something, ascending. Only what has changed by a tenth since is compared again.
  std::vector<Overlap> overlaps();

 private:
  struct Entry {
    MapSummary summary, compared;  // as it is; as it was when it was compared last
    bool is_stale = true;
  };
  std::vector<std::pair<RobotId, RobotId>> candidates() const;
  std::map<RobotId, Entry> maps_;
  std::map<std::pair<RobotId, RobotId>, double> degrees_;  // of those compared; 0 for nothing
};

}  // namespace mapweave::scheduling
