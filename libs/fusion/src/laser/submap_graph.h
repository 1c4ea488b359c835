#pragma once
// The pose graph of several robots' submaps: each robot's own trajectory and loop closures, and matches between submaps
// of any two robots or of one. What a robot's own map says is a measurement here like any other: the team can bend it.

#include "decision/prepared_map.h"

#include <mapweave/graph/relative_covariance.h>

#include <algorithm>
#include <map>
#include <vector>

namespace mapweave::fusion {

// An alignment of two submaps that the graph may hold.
struct SubmapMatch {
  std::size_t from = 0, to = 0;  // numbers of submaps, over all maps
  Pose2 from_from_to;
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();  // x, y, yaw in the frame of `to`
  double probability = 0.0;
  Hash judgement;
  bool is_observable = true;  // in all directions; along a bare corridor a match can slide
  // Of two submaps of one robot: what its own map says of these places, and of those beside them, is left out.
  bool overrules_own = false;
};

// Maps solved together.
struct SolvedSubmaps {
  std::vector<std::size_t> submaps;     // numbers, rising
  std::vector<Pose2> team_from_submap;  // of each; the first stays where its own map has it
  std::vector<double> match_weight;     // of the matches given: 0 where GNC rejected it
  std::vector<std::pair<std::size_t, std::size_t>>
      doubted;        // pairs of one robot's submaps whose own constraint GNC rejected, or a match overrules
  double chi2 = 0.0;  // of the matches that hold
  std::vector<graph::Edge> edges;
  std::vector<double> weights;
  std::size_t place_of(std::size_t submap) const {
    return static_cast<std::size_t>(std::lower_bound(submaps.begin(), submaps.end(), submap) - submaps.begin());
  }
  const Pose2& pose_of(std::size_t submap) const { return team_from_submap[place_of(submap)]; }
  graph::RelativeCovariance covariance() const { return {team_from_submap, edges, weights}; }
};

// Which submap a node with a payload is most in the middle of.
std::map<NodeId, std::size_t> homes_of(const PreparedMap& map);
// Where the middle of a submap's walls lies when the submap lies there.
Eigen::Vector2d middle_of(const PreparedMap& map, std::size_t submap, const Pose2& team_from_submap);

// Between the middles of submaps that may show the same: at least, and where both see far.
constexpr double kNearSubmaps_m = 6.0, kFarSubmaps_m = 14.0;

constexpr double kWideRadius_m = 12.0;  // of a wide window: bounds the time of its search
// Of a window that lays the middles of two submaps' walls on each other: a share of their radii together.
inline double wide_radius_m(double radii_m) { return std::min(kWideRadius_m, std::max(4.0, 0.7 * radii_m)); }

class SubmapGraph {
 public:
  // `maps` must outlive the graph.
  SubmapGraph(const std::vector<PreparedMap>& maps, const graph::SolveOptions& options);

  std::size_t number(std::size_t map, std::size_t submap) const { return first_[map] + submap; }
  std::size_t map_of(std::size_t number) const { return map_of_[number]; }
  std::size_t submap_of(std::size_t number) const { return number - first_[map_of_[number]]; }
  std::size_t size() const { return map_of_.size(); }
  std::size_t first_of(std::size_t map) const { return first_[map]; }
  // Whether the two submaps of one robot lie so near along its trajectory that a match of them says nothing new, or its
  // own map constrains them.
  bool is_constrained(std::size_t one, std::size_t other) const;
  // Whether one of the matches overrules what the robot's own map says of how two of its submaps lie.
  static bool is_overruled(std::size_t one, std::size_t other, const std::vector<SubmapMatch>& matches);

  // `members`: numbers of maps, rising, that the matches connect (else the others stay where their own frame puts
  // them). Starts along the matches, the most probable first. `is_doubtful`: whether robots' own loop closures may be
  // rejected too.
  SolvedSubmaps solve(const std::vector<std::size_t>& members, const std::vector<SubmapMatch>& matches) const;
  // Each map as it is: what its own graph knows.
  SolvedSubmaps alone(std::size_t map) const { return solve({map}, {}); }

 private:
  struct OwnEdge {
    std::size_t from, to;
    Pose2 from_from_to;
    Eigen::Matrix3d information;
    bool is_loop;
  };
  void add_own_edges(std::size_t map);

  const std::vector<PreparedMap>& maps_;
  graph::SolveOptions options_;
  std::vector<std::size_t> first_, map_of_;
  std::vector<std::vector<OwnEdge>> own_;  // of each map
};

}  // namespace mapweave::fusion
