#include "least_squares.h"

#include <mapweave/core/error.h>
#include <mapweave/graph/pose_graph.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <array>

namespace mapweave::graph {
namespace {

using Row3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// residual = sqrt(weight * information) * (from_from_to^-1 (+) (from^-1 (+) to)), with analytic derivatives.
class EdgeCost : public ceres::SizedCostFunction<3, 3, 3> {
 public:
  EdgeCost(const Edge& edge, const double* weight) : measured_(edge.from_from_to), weight_(weight) {
    // Symmetric square root: also of matrices that are rank deficient.
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(0.5 * (edge.information + edge.information.transpose()));
    root_ = eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() * eigen.eigenvectors().transpose();
  }
  bool Evaluate(const double* const* parameters, double* residuals, double** jacobians) const override {
    const double* a = parameters[0];
    const double* b = parameters[1];
    const double ca = std::cos(a[2]), sa = std::sin(a[2]), cm = std::cos(measured_.phi), sm = std::sin(measured_.phi);
    const double dx = b[0] - a[0], dy = b[1] - a[1];
    const double lx = ca * dx + sa * dy, ly = -sa * dx + ca * dy;  // b seen from a
    const double ex = lx - measured_.x, ey = ly - measured_.y;
    const Eigen::Vector3d error(cm * ex + sm * ey, -sm * ex + cm * ey, wrap_angle(b[2] - a[2] - measured_.phi));
    const double scale = std::sqrt(*weight_);
    Eigen::Map<Eigen::Vector3d> out(residuals);
    out = scale * (root_ * error);
    if (jacobians == nullptr) return true;
    const double c = ca * cm - sa * sm, s = sa * cm + ca * sm;  // rotation from the parent frame into the measured one
    Eigen::Matrix3d by_b;
    by_b << c, s, 0, -s, c, 0, 0, 0, 1;
    if (jacobians[1] != nullptr) Eigen::Map<Row3>{jacobians[1]} = scale * (root_ * by_b);
    if (jacobians[0] != nullptr) {
      Eigen::Matrix3d by_a = -by_b;
      by_a(0, 2) = cm * ly + sm * -lx;  // d(lx)/d(yaw) = ly, d(ly)/d(yaw) = -lx
      by_a(1, 2) = -sm * ly + cm * -lx;
      Eigen::Map<Row3>{jacobians[0]} = scale * (root_ * by_a);
    }
    return true;
  }

 private:
  Pose2 measured_;
  Eigen::Matrix3d root_;
  const double* weight_;
};

// Starting poses far from the solution cost iterations only; weights are what the rounds of GNC change.
int run(std::vector<std::array<double, 3>>& poses, const std::vector<Edge>& edges, const std::vector<double>& weights, int iterations,
        std::uint32_t fixed, bool& converged) {
  ceres::Problem::Options problem_options;
  problem_options.enable_fast_removal = false;
  ceres::Problem problem(problem_options);
  for (std::size_t i = 0; i < edges.size(); ++i)
    if (weights[i] > 1e-9)
      problem.AddResidualBlock(new EdgeCost(edges[i], &weights[i]), nullptr, poses[edges[i].from].data(), poses[edges[i].to].data());
  if (problem.NumResidualBlocks() == 0) {
    converged = true;
    return 0;
  }
  if (problem.HasParameterBlock(poses[fixed].data())) problem.SetParameterBlockConstant(poses[fixed].data());
  const ceres::Solver::Summary summary = minimised(problem, iterations, 1e6);
  converged = summary.termination_type == ceres::CONVERGENCE;
  return static_cast<int>(summary.iterations.size());
}

}  // namespace

double chi2_of(const Edge& edge, const std::vector<Pose2>& poses) {
  const Pose2 error = between(edge.from_from_to, between(poses[edge.from], poses[edge.to]));
  const Eigen::Vector3d e(error.x, error.y, error.phi);
  return e.dot(edge.information * e);
}

Solution solve(const std::vector<Pose2>& initial, const std::vector<Edge>& edges, const SolveOptions& options, std::uint32_t fixed) {
  for (const auto& edge : edges) {
    MAPWEAVE_EXPECT(edge.from < initial.size() && edge.to < initial.size() && edge.from != edge.to, "an edge joins two poses of the graph");
    MAPWEAVE_EXPECT(edge.information.allFinite() && is_finite(edge.from_from_to), "edges are finite");
  }
  Solution solution;
  solution.poses = initial;
  solution.weight.assign(edges.size(), 1.0);
  if (initial.empty()) return solution;
  MAPWEAVE_EXPECT(fixed < initial.size(), "the fixed pose is one of the graph");

  std::vector<std::array<double, 3>> poses;
  poses.reserve(initial.size());
  for (const auto& p : initial) poses.push_back({p.x, p.y, p.phi});
  const auto read_back = [&] {
    for (std::size_t i = 0; i < poses.size(); ++i) solution.poses[i] = {poses[i][0], poses[i][1], wrap_angle(poses[i][2])};
  };
  const bool robust = std::any_of(edges.begin(), edges.end(), [](const Edge& e) { return e.doubtful; });
  solution.iterations = run(poses, edges, solution.weight, options.iterations, fixed, solution.converged);
  read_back();
  if (robust) {
    const double bound = options.truncation_chi2;
    double largest = 0.0;
    for (const auto& edge : edges)
      if (edge.doubtful) largest = std::max(largest, chi2_of(edge, solution.poses));
    // GNC-TLS: the surrogate starts convex for the largest residual and hardens each round.
    double mu = largest > bound ? bound / std::max(2.0 * largest - bound, 1e-9) : -1.0;
    for (int round = 0; round < options.robust_rounds && mu > 0.0; ++round) {
      bool hard = true;
      for (std::size_t i = 0; i < edges.size(); ++i) {
        if (!edges[i].doubtful) continue;
        const double square = chi2_of(edges[i], solution.poses);
        const double upper = (mu + 1.0) / mu * bound, lower = mu / (mu + 1.0) * bound;
        double weight;
        if (square >= upper)
          weight = 0.0;
        else if (square <= lower)
          weight = 1.0;
        else
          weight = std::clamp(std::sqrt(bound * mu * (mu + 1.0) / square) - mu, 0.0, 1.0);
        hard = hard && (weight == 0.0 || weight == 1.0);
        solution.weight[i] = weight;
      }
      solution.iterations += run(poses, edges, solution.weight, options.iterations, fixed, solution.converged);
      read_back();
      if (hard && mu > 1.0) break;
      mu *= mu < 0.1 ? 4.0 : 1.8;
    }
    // Weights end as a decision.
    for (std::size_t i = 0; i < edges.size(); ++i)
      if (edges[i].doubtful) solution.weight[i] = chi2_of(edges[i], solution.poses) <= bound ? 1.0 : 0.0;
    if (mu > 0.0) {
      solution.iterations += run(poses, edges, solution.weight, options.iterations, fixed, solution.converged);
      read_back();
    }
  }
  for (std::size_t i = 0; i < edges.size(); ++i) solution.chi2 += solution.weight[i] * chi2_of(edges[i], solution.poses);
  return solution;
}

MapSolution optimise(Map& map, const SolveOptions& options) {
  MapSolution result;
  if (map.nodes.empty()) return result;
  std::vector<Pose2> poses;
  std::vector<NodeId> ids;
  poses.reserve(map.nodes.size());
  ids.reserve(map.nodes.size());
  for (const auto& [id, node] : map.nodes) {
    ids.push_back(id);
    poses.push_back(planar(node.map_from_node));
  }
  const auto number = [&](const NodeId& id) {
    const auto place = std::lower_bound(ids.begin(), ids.end(), id);
    MAPWEAVE_EXPECT(place != ids.end() && *place == id, "a constraint names nodes of its map");
    return static_cast<std::uint32_t>(place - ids.begin());
  };
  std::vector<Edge> edges;
  std::vector<ConstraintId> names;
  edges.reserve(map.constraints.size());
  for (const auto& [id, constraint] : map.constraints) {
    edges.push_back({number(id.from), number(id.to), planar(constraint.from_from_to.pose), planar(constraint.information),
                     id.kind == ConstraintKind::loop || id.kind == ConstraintKind::between_maps});
    names.push_back(id);
  }
  const Solution solution = solve(poses, edges, options);
  // What does not lie in the plane (height, roll, pitch of a camera's robot) stays as it is.
  for (std::size_t i = 0; i < ids.size(); ++i) {
    Pose3& pose = map.nodes.find(ids[i])->map_from_node;
    const Pose3 flat = spatial(poses[i]), moved = spatial(solution.poses[i]);
    const bool is_planar = pose.t == flat.t && pose.q.x() == 0.0 && pose.q.y() == 0.0;
    pose = is_planar ? moved : compose(compose(moved, inverse(flat)), pose);
  }
  if (std::all_of(solution.weight.begin(), solution.weight.end(), [](double weight) { return weight > 0.5; })) {
    result.chi2 = solution.chi2;
    result.iterations = solution.iterations;
    return result;
  }
  Table<ConstraintId, Constraint> kept;
  kept.reserve(map.constraints.size());
  std::size_t i = 0;
  for (auto& [id, constraint] : map.constraints) {
    if (solution.weight[i++] > 0.5)
      kept.set(id, std::move(constraint));
    else
      result.rejected.push_back(std::move(constraint));
  }
  map.constraints = std::move(kept);
  result.chi2 = solution.chi2;
  result.iterations = solution.iterations;
  return result;
}

}  // namespace mapweave::graph
