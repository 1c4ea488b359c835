#pragma once
// Planar pose graphs: the poses that agree best with all constraints. Cold start, one thread, iteration budgets: the
// same input gives the same bytes. Solver: Levenberg-Marquardt (src/pose_graph_solver.h). Robust weighting: graduated
// non-convexity with truncated least squares (Yang et al., RA-L 2020), on the edges that ask for it.

#include <mapweave/core/geometry.h>
#include <mapweave/maps/map.h>

#include <cstdint>
#include <vector>

namespace mapweave::graph {

struct Edge {
  std::uint32_t from = 0, to = 0;  // numbers of poses
  Pose2 from_from_to;
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();  // x, y, yaw in the frame of `to`
  bool doubtful = false;                                      // may be wrong altogether: weighted by GNC
};

struct SolveOptions {
  int iterations = 30;
  // A doubtful edge whose squared error stays above this (chi-square, 3 degrees of freedom) is taken for wrong.
  double truncation_chi2 = 25.0;
  int robust_rounds = 12;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("iterations", iterations, 1, 1000,
              "most iterations of the solver in each round of optimising the pose graph; larger values are slower and "
              "change nothing once it has converged");
    v.positive("truncation_chi2", truncation_chi2,
               "a match of two places (a loop closure, or between two robots' maps) whose squared error in standard "
               "deviations (chi-square, 3 degrees of freedom) stays above this is removed as an outlier; larger values "
               "keep more matches");
    v.integer("robust_rounds", robust_rounds, 1, 100,
              "number of rounds of graduated non-convexity (GNC), in which outliers among matches of places lose their "
              "weight; larger values decide more gradually and take longer");
  }
};

struct Solution {
  std::vector<Pose2> poses;
  std::vector<double> weight;  // of each edge: 1 for certain edges, 0..1 for doubtful ones
  double chi2 = 0.0;           // of the edges, weighted
  int iterations = 0;
  bool converged = false;
};

// Pose `fixed` stays where it is. Edges name poses of `initial`. Throws ContractViolation otherwise, or for information
// that is not finite.
Solution solve(const std::vector<Pose2>& initial, const std::vector<Edge>& edges, const SolveOptions& options = {},
               std::uint32_t fixed = 0);

// Squared error of an edge under these poses.
double chi2_of(const Edge&, const std::vector<Pose2>& poses);

// Optimises the belief of a map: every node's pose, under all its constraints (loop and between_maps ones are
// doubtful). The first node stays. Constraints that GNC rejects are removed from the map and returned.
struct MapSolution {
  std::vector<Constraint> rejected;
  double chi2 = 0.0;
  int iterations = 0;
};
MapSolution optimise(Map& map, const SolveOptions& options = {});

}  // namespace mapweave::graph
