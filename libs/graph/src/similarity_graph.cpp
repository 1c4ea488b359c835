#include "least_squares.h"

#include <mapweave/core/error.h>
#include <mapweave/graph/spatial_graph.h>

#include <Eigen/Eigenvalues>

namespace mapweave::graph {
namespace {

using Matrix7 = Eigen::Matrix<double, 7, 7>;

// What is left of an edge: translation, rotation vector and logarithm of the scale of measured^-1 * (from^-1 * to).
// Parameters: x, y, z, the quaternion as Eigen keeps it (x, y, z, w), and the scale's logarithm.
class SimilarityError {
 public:
  explicit SimilarityError(const SimilarityEdge& edge) : measured_(edge.from_from_to) {
    const Eigen::SelfAdjointEigenSolver<Matrix7> eigen(0.5 * (edge.information + edge.information.transpose()));
    root_ = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
            eigen.eigenvectors().transpose();
  }
  template <class T>
  bool operator()(const T* from_t, const T* from_q, const T* from_s, const T* to_t, const T* to_q, const T* to_s,
                  T* residuals) const {
    using std::exp;
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> ta(from_t), tb(to_t);
    const Eigen::Map<const Eigen::Quaternion<T>> qa(from_q), qb(to_q);
    const Eigen::Quaternion<T> measured = measured_.pose.q.cast<T>();
    Eigen::Quaternion<T> turn = measured.conjugate() * qa.conjugate() * qb;
    if (turn.w() < T(0)) turn.coeffs() = -turn.coeffs();
    const Eigen::Matrix<T, 3, 1> motion = exp(-from_s[0]) * (qa.conjugate() * (tb - ta));
    Eigen::Matrix<T, 7, 1> error;
    error.template head<3>() =
        T(1.0 / measured_.scale) * (measured.conjugate() * (motion - measured_.pose.t.cast<T>()));
    error.template segment<3>(3) = T(2) * turn.vec();
    error[6] = to_s[0] - from_s[0] - T(std::log(measured_.scale));
    Eigen::Map<Eigen::Matrix<T, 7, 1>>{residuals} = root_.cast<T>() * error;
    return true;
  }

 private:
  Sim3 measured_;
  Matrix7 root_;
};

}  // namespace

SimilaritySolution solve(const std::vector<Sim3>& initial, const std::vector<SimilarityEdge>& edges, int iterations,
                         std::uint32_t fixed) {
  SimilaritySolution solution;
  solution.poses = initial;
  MAPWEAVE_EXPECT(initial.empty() || fixed < initial.size(), "the fixed pose is one of them");
  std::vector<double> logarithms;
  for (const Sim3& pose : initial) {
    MAPWEAVE_EXPECT(pose.scale > 0.0 && std::isfinite(pose.scale), "scales are positive");
    logarithms.push_back(std::log(pose.scale));
  }
  ceres::Problem problem;
  for (const SimilarityEdge& edge : edges) {
    MAPWEAVE_EXPECT(edge.from < initial.size() && edge.to < initial.size() && edge.from != edge.to,
                    "edges join two of the poses");
    MAPWEAVE_EXPECT(edge.information.allFinite() && is_finite(edge.from_from_to.pose) &&
                        edge.from_from_to.scale > 0.0 && std::isfinite(edge.from_from_to.scale),
                    "edges are finite");
    Pose3 &a = solution.poses[edge.from].pose, &b = solution.poses[edge.to].pose;
    problem.AddResidualBlock(
        new ceres::AutoDiffCostFunction<SimilarityError, 7, 3, 4, 1, 3, 4, 1>(new SimilarityError(edge)), nullptr,
        a.t.data(), a.q.coeffs().data(), &logarithms[edge.from], b.t.data(), b.q.coeffs().data(), &logarithms[edge.to]);
  }
  if (problem.NumResidualBlocks() == 0) {
    solution.converged = true;
    return solution;
  }
  for (std::size_t i = 0; i < solution.poses.size(); ++i) {
    Pose3& pose = solution.poses[i].pose;
    if (!problem.HasParameterBlock(pose.t.data())) continue;
    problem.SetManifold(pose.q.coeffs().data(), new ceres::EigenQuaternionManifold);
    if (i != fixed) continue;
    problem.SetParameterBlockConstant(pose.t.data()), problem.SetParameterBlockConstant(pose.q.coeffs().data());
    problem.SetParameterBlockConstant(&logarithms[i]);
  }
  const ceres::Solver::Summary summary = minimised(problem, iterations);
  for (std::size_t i = 0; i < solution.poses.size(); ++i) {
    solution.poses[i].pose.q.normalize();
    solution.poses[i].scale = std::exp(logarithms[i]);
  }
  solution.chi2 = 2.0 * summary.final_cost;
  solution.iterations = static_cast<int>(summary.iterations.size());
  solution.converged = summary.termination_type == ceres::CONVERGENCE;
  return solution;
}

}  // namespace mapweave::graph
