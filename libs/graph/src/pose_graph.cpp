#include "pose_graph_solver.h"

#include <mapweave/core/error.h>
#include <mapweave/graph/pose_graph.h>

#include <algorithm>

namespace mapweave::graph {
namespace {

struct InPlane {
  using Pose = Pose2;
  using Edge = graph::Edge;
  using Error = Eigen::Vector3d;
  using Matrix = Eigen::Matrix3d;
  static constexpr int kSize = 3;
  static constexpr double kFirstDamping = 1e-6;  // all but Gauss-Newton: chains of poses begin near the answer

  // from_from_to^-1 (+) (from^-1 (+) to)
  static Error error_of(const graph::Edge& edge, const Pose2& from, const Pose2& to) {
    const Pose2 error = between(edge.from_from_to, between(from, to));
    return {error.x, error.y, error.phi};
  }
  // Motions are of positions in the map's frame, and of yaws.
  static void linearise(const graph::Edge& edge, const Pose2& from, const Pose2& to, Error& error, Matrix& by_from,
                        Matrix& by_to) {
    const Pose2& measured = edge.from_from_to;
    const double cf = std::cos(from.phi), sf = std::sin(from.phi), cm = std::cos(measured.phi),
                 sm = std::sin(measured.phi);
    const double dx = to.x - from.x, dy = to.y - from.y;
    const double lx = cf * dx + sf * dy, ly = -sf * dx + cf * dy;  // `to` seen from `from`
    const double ex = lx - measured.x, ey = ly - measured.y;
    error = {cm * ex + sm * ey, -sm * ex + cm * ey, wrap_angle(to.phi - from.phi - measured.phi)};
    const double c = cf * cm - sf * sm, s = sf * cm + cf * sm;  // rotation from the map's frame into the measured one
    by_to << c, s, 0, -s, c, 0, 0, 0, 1;
    by_from = -by_to;
    by_from(0, 2) = cm * ly - sm * lx;  // d(lx)/d(yaw) = ly, d(ly)/d(yaw) = -lx
    by_from(1, 2) = -sm * ly - cm * lx;
  }
  static Pose2 moved(const Pose2& pose, const Error& motion) {
    return {pose.x + motion.x(), pose.y + motion.y(), wrap_angle(pose.phi + motion.z())};
  }
};

}  // namespace

double chi2_of(const Edge& edge, const std::vector<Pose2>& poses) {
  const Eigen::Vector3d error = InPlane::error_of(edge, poses[edge.from], poses[edge.to]);
  return error.dot(edge.information * error);
}

Solution solve(const std::vector<Pose2>& initial, const std::vector<Edge>& edges, const SolveOptions& options,
               std::uint32_t fixed) {
  for (const auto& edge : edges) {
    MAPWEAVE_EXPECT(edge.from < initial.size() && edge.to < initial.size() && edge.from != edge.to,
                    "an edge joins two poses of the graph");
    MAPWEAVE_EXPECT(edge.information.allFinite() && is_finite(edge.from_from_to), "edges are finite");
  }
  Solution solution;
  solution.poses = initial;
  solution.weight.assign(edges.size(), 1.0);
  if (initial.empty()) return solution;
  MAPWEAVE_EXPECT(fixed < initial.size(), "the fixed pose is one of the graph");
  if (edges.empty()) {
    solution.converged = true;
    return solution;
  }
  PoseGraphSolver<InPlane> solver(solution.poses, edges, fixed);
  // Of the cost, what a step gains at the end: in the last round, and in those that only find weights (DECISIONS.md,
  // 70).
  constexpr double kEnough = 1e-7, kEnoughToWeigh = 1e-3;
  const auto run = [&](double enough) {
    const Descent result = solver.run(options.iterations, enough);
    solution.iterations += result.iterations;
    solution.converged = result.converged;
  };
  const bool robust = std::any_of(edges.begin(), edges.end(), [](const Edge& e) { return e.doubtful; });
  run(robust ? kEnoughToWeigh : kEnough);
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
      solver.set_weights(solution.weight);
      run(kEnoughToWeigh);
      if (hard && mu > 1.0) break;
      mu *= mu < 0.1 ? 4.0 : 1.8;
    }
    // Weights end as a decision.
    for (std::size_t i = 0; i < edges.size(); ++i)
      if (edges[i].doubtful) solution.weight[i] = chi2_of(edges[i], solution.poses) <= bound ? 1.0 : 0.0;
    if (mu > 0.0) solver.set_weights(solution.weight);
    run(kEnough);
  }
  for (std::size_t i = 0; i < edges.size(); ++i)
    solution.chi2 += solution.weight[i] * chi2_of(edges[i], solution.poses);
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
    edges.push_back({number(id.from), number(id.to), planar(constraint.from_from_to.pose),
                     planar(constraint.information),
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
