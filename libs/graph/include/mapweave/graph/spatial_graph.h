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

// Pose `fixed` stays where it is. Edges name poses of `initial`. Throws ContractViolation otherwise, or for information that is not finite.
SpatialSolution solve(const std::vector<Pose3>& initial, const std::vector<SpatialEdge>& edges, int iterations = 50,
                      std::uint32_t fixed = 0);

double chi2_of(const SpatialEdge& edge, const std::vector<Pose3>& poses);

}  // namespace mapweave::graph
