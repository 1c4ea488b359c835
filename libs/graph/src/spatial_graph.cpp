#include <ceres/ceres.h>
#include <mapweave/core/error.h>
#include <mapweave/graph/spatial_graph.h>

#include <Eigen/Eigenvalues>

namespace mapweave::graph {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

// What is left of an edge: translation and rotation vector of measured^-1 * (from^-1 * to). Parameters: x, y, z, and the quaternion as
// Eigen keeps it (x, y, z, w).
class EdgeError {
 public:
  explicit EdgeError(const SpatialEdge& edge) : measured_(edge.from_from_to) {
    const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(0.5 * (edge.information + edge.information.transpose()));
    root_ = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
  }
  template <class T>
  bool operator()(const T* from_t, const T* from_q, const T* to_t, const T* to_q, T* residuals) const {
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> ta(from_t), tb(to_t);
    const Eigen::Map<const Eigen::Quaternion<T>> qa(from_q), qb(to_q);
    const Eigen::Quaternion<T> measured = measured_.q.cast<T>(), back = measured.conjugate() * qa.conjugate();
    Eigen::Quaternion<T> turn = back * qb;
    if (turn.w() < T(0)) turn.coeffs() = -turn.coeffs();
    Eigen::Matrix<T, 6, 1> error;
    error.template head<3>() = back * (tb - ta) - measured.conjugate() * measured_.t.cast<T>();
    error.template tail<3>() = T(2) * turn.vec();
    Eigen::Map<Eigen::Matrix<T, 6, 1>>{residuals} = root_.cast<T>() * error;
    return true;
  }

 private:
  Pose3 measured_;
  Matrix6 root_;
};

}  // namespace

SpatialSolution solve(const std::vector<Pose3>& initial, const std::vector<SpatialEdge>& edges, int iterations, std::uint32_t fixed) {
  SpatialSolution solution;
  solution.poses = initial;
  MAPWEAVE_EXPECT(initial.empty() || fixed < initial.size(), "the fixed pose is one of them");
  ceres::Problem problem;
  for (const SpatialEdge& edge : edges) {
    MAPWEAVE_EXPECT(edge.from < initial.size() && edge.to < initial.size() && edge.from != edge.to, "edges join two of the poses");
    MAPWEAVE_EXPECT(edge.information.allFinite() && is_finite(edge.from_from_to), "edges are finite");
    Pose3 &a = solution.poses[edge.from], &b = solution.poses[edge.to];
    problem.AddResidualBlock(new ceres::AutoDiffCostFunction<EdgeError, 6, 3, 4, 3, 4>(new EdgeError(edge)), nullptr, a.t.data(),
                             a.q.coeffs().data(), b.t.data(), b.q.coeffs().data());
  }
  if (problem.NumResidualBlocks() == 0) {
    solution.converged = true;
    return solution;
  }
  for (std::size_t i = 0; i < solution.poses.size(); ++i) {
    Pose3& pose = solution.poses[i];
    if (!problem.HasParameterBlock(pose.t.data())) continue;
    problem.SetManifold(pose.q.coeffs().data(), new ceres::EigenQuaternionManifold);
    if (i == fixed) problem.SetParameterBlockConstant(pose.t.data()), problem.SetParameterBlockConstant(pose.q.coeffs().data());
  }
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  options.num_threads = 1;
  options.max_num_iterations = iterations;
  options.function_tolerance = 1e-7;
  options.parameter_tolerance = 1e-9;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  for (Pose3& pose : solution.poses) pose.q.normalize();
  solution.chi2 = 2.0 * summary.final_cost;
  solution.iterations = static_cast<int>(summary.iterations.size());
  solution.converged = summary.termination_type == ceres::CONVERGENCE;
  return solution;
}

double chi2_of(const SpatialEdge& edge, const std::vector<Pose3>& poses) {
  const Pose3 error = between(edge.from_from_to, between(poses[edge.from], poses[edge.to]));
  Vector6 e;
  const double sign = error.q.w() < 0 ? -2.0 : 2.0;
  e << error.t, sign * error.q.vec();
  return e.dot(edge.information * e);
}

}  // namespace mapweave::graph
