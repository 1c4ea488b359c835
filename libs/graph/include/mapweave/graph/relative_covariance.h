#pragma once
// How well a solved planar pose graph knows the pose of one node relative to another (what pairwise consistency is
// tested with: Mangelson et al., ICRA 2018; recovery of marginals from the factor: Kaess and Dellaert, Robotics and
// Autonomous Systems 57(12), 2009).

#include <mapweave/graph/pose_graph.h>

#include <memory>
#include <vector>

namespace mapweave::graph {

// Factorises the graph once; each node that is asked about costs one solution with its three columns, which are kept.
// Not thread-safe.
class RelativeCovariance {
 public:
  // `weights` of the edges, 0 to 1, as solve() returns them. Nodes that no edge connects to the others have a
  // sigma of 100 m.
  RelativeCovariance(const std::vector<Pose2>& poses, const std::vector<Edge>& edges,
                     const std::vector<double>& weights);
  ~RelativeCovariance();
  RelativeCovariance(RelativeCovariance&&) noexcept;
  RelativeCovariance& operator=(RelativeCovariance&&) noexcept;

  // Of a small motion (x, y, yaw) of `to` in its own frame, as seen from `from`.
  Eigen::Matrix3d between(std::uint32_t from, std::uint32_t to);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::graph
