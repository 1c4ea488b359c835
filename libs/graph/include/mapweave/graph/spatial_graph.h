#pragma once
// Pose graphs in space. As pose_graph.h, but for poses that do not stay in a plane; every edge is believed.

#include <mapweave/core/geometry.h>

#include <cstdint>
#include <vector>

namespace mapweave::graph {

struct SpatialEdge {
  std::uint32_t from = 0, to = 0;  // numbers of poses
  Pose3 from_from_to;
  // Of a small motion of `to` in its own frame: x, y, z, then the rotation vector.
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Identity();
};

struct SpatialSolution {
  std::vector<Pose3> poses;
  double chi2 = 0.0;
  int iterations = 0;
  bool converged = false;
};

// Pose `fixed` stays where it is. Edges name poses of `initial`. Throws ContractViolation otherwise, or for information
// that is not finite.
SpatialSolution solve(const std::vector<Pose3>& initial, const std::vector<SpatialEdge>& edges, int iterations = 50,
                      std::uint32_t fixed = 0);

// The same where scale drifts too, as one camera's does: a pose's own metres are `scale` times as long in the graph's
// frame (Strasdat, Montiel, Davison: Scale Drift-Aware Large Scale Monocular SLAM, RSS 2010).
struct SimilarityEdge {
  std::uint32_t from = 0, to = 0;
  Sim3 from_from_to;
  // Of a small motion of `to` in its own frame: x, y, z, the rotation vector, and the logarithm of its scale.
  Eigen::Matrix<double, 7, 7> information = Eigen::Matrix<double, 7, 7>::Identity();
};
struct SimilaritySolution {
  std::vector<Sim3> poses;
  double chi2 = 0.0;
  int iterations = 0;
  bool converged = false;
};
SimilaritySolution solve(const std::vector<Sim3>& initial, const std::vector<SimilarityEdge>& edges,
                         int iterations = 50, std::uint32_t fixed = 0);

double chi2_of(const SpatialEdge& edge, const std::vector<Pose3>& poses);

}  // namespace mapweave::graph
