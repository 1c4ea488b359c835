#include "pose_graph_solver.h"

#include <mapweave/core/error.h>
#include <mapweave/graph/spatial_graph.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace mapweave::graph {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Eigen::Matrix3d;

Matrix3d cross(const Eigen::Vector3d& v) {
  Matrix3d m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// What is left of an edge: translation and rotation vector (to first order) of measured^-1 * (from^-1 * to).
Vector6 error_of(const Pose3& measured, const Pose3& a, const Pose3& b, Eigen::Quaterniond& turn) {
  const Eigen::Quaterniond back = measured.q.conjugate() * a.q.conjugate();
  turn = back * b.q;
  if (turn.w() < 0) turn.coeffs() = -turn.coeffs();
  Vector6 error;
  error << back * (b.t - a.t) - measured.q.conjugate() * measured.t, 2.0 * turn.vec();
  return error;
}

// By how much the error grows with a small motion of `from` and of `to` in their own frames.
struct Slopes {
  Matrix6 from = Matrix6::Zero(), to = Matrix6::Zero();
};
Slopes slopes_of(const Pose3& measured, const Pose3& a, const Pose3& b, const Eigen::Quaterniond& turn) {
  const Matrix3d back = measured.q.toRotationMatrix().transpose(), a_from_map = a.q.toRotationMatrix().transpose();
  const Matrix3d v = cross(turn.vec()), w = turn.w() * Matrix3d::Identity();
  Slopes slopes;
  slopes.to.topLeftCorner<3, 3>() = back * a_from_map * b.q.toRotationMatrix();
  slopes.to.bottomRightCorner<3, 3>() = w + v;
  slopes.from.topLeftCorner<3, 3>() = -back;
  slopes.from.topRightCorner<3, 3>() = back * cross(a_from_map * (b.t - a.t));
  slopes.from.bottomRightCorner<3, 3>() = (v - w) * back;
  return slopes;
}

// Symmetric, and nowhere negative.
Matrix6 sound(const Matrix6& information) {
  const Matrix6 symmetric = 0.5 * (information + information.transpose());
  if (symmetric.llt().info() == Eigen::Success) return symmetric;
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(symmetric);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * eigen.eigenvectors().transpose();
}

struct InSpace {
  using Pose = Pose3;
  using Edge = SpatialEdge;
  using Error = Vector6;
  using Matrix = Matrix6;
  static constexpr int kSize = 6;
  static constexpr double kFirstDamping = 1e-4;

  static Matrix6 sound(const Matrix6& information) { return graph::sound(information); }
  static Vector6 error_of(const SpatialEdge& edge, const Pose3& from, const Pose3& to) {
    Eigen::Quaterniond turn;
    return graph::error_of(edge.from_from_to, from, to, turn);
  }
  static void linearise(const SpatialEdge& edge, const Pose3& from, const Pose3& to, Vector6& error, Matrix6& by_from,
                        Matrix6& by_to) {
    Eigen::Quaterniond turn;
    error = graph::error_of(edge.from_from_to, from, to, turn);
    const Slopes slopes = slopes_of(edge.from_from_to, from, to, turn);
    by_from = slopes.from;
    by_to = slopes.to;
  }
  static Pose3 moved(Pose3 pose, const Vector6& motion) {
    const double angle = motion.tail<3>().norm();
    pose.t += pose.q * motion.head<3>();
    if (angle > 0.0)
      pose.q = (pose.q * Eigen::Quaterniond(Eigen::AngleAxisd(angle, motion.tail<3>() / angle))).normalized();
    return pose;
  }
};

}  // namespace

SpatialSolution solve(const std::vector<Pose3>& initial, const std::vector<SpatialEdge>& edges, int iterations,
                      std::uint32_t fixed) {
  MAPWEAVE_EXPECT(initial.empty() || fixed < initial.size(), "the fixed pose is one of them");
  for (const SpatialEdge& edge : edges) {
    MAPWEAVE_EXPECT(edge.from < initial.size() && edge.to < initial.size() && edge.from != edge.to,
                    "edges join two of the poses");
    MAPWEAVE_EXPECT(edge.information.allFinite() && is_finite(edge.from_from_to), "edges are finite");
  }
  std::vector<Pose3> poses = initial;
  SpatialSolution solution;
  if (edges.empty()) {
    solution.converged = true;
  } else {
    constexpr double kEnough = 1e-6;
    const Descent result = PoseGraphSolver<InSpace>(poses, edges, fixed).run(iterations, kEnough);
    solution.chi2 = result.cost;
    solution.iterations = result.iterations;
    solution.converged = result.converged;
  }
  solution.poses = std::move(poses);
  return solution;
}

double chi2_of(const SpatialEdge& edge, const std::vector<Pose3>& poses) {
  const Vector6 error = InSpace::error_of(edge, poses[edge.from], poses[edge.to]);
  return error.dot(edge.information * error);
}

}  // namespace mapweave::graph
