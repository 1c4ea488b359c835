#include "pose_graph_solver.h"

#include <mapweave/core/error.h>
#include <mapweave/graph/spatial_graph.h>

#include <cmath>

namespace mapweave::graph {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Vector7 = Eigen::Matrix<double, 7, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix7 = Eigen::Matrix<double, 7, 7>;
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

// A small motion (translation, rotation vector) in the pose's own frame.
Pose3 moved_by(Pose3 pose, const Vector6& motion) {
  const double angle = motion.tail<3>().norm();
  pose.t += pose.q * motion.head<3>();
  if (angle > 0.0)
    pose.q = (pose.q * Eigen::Quaterniond(Eigen::AngleAxisd(angle, motion.tail<3>() / angle))).normalized();
  return pose;
}

struct InSpace {
  using Pose = Pose3;
  using Edge = SpatialEdge;
  using Error = Vector6;
  using Matrix = Matrix6;
  static constexpr int kSize = 6;
  static constexpr double kFirstDamping = 1e-4;  // rotations are less linear than in the plane: shorter first steps

  static Vector6 error_of(const SpatialEdge& edge, const Pose3& from, const Pose3& to) {
    Eigen::Quaterniond turn;
    return graph::error_of(edge.from_from_to, from, to, turn);
  }
  static void linearise(const SpatialEdge& edge, const Pose3& from, const Pose3& to, Vector6& error, Matrix6& by_from,
                        Matrix6& by_to) {
    Eigen::Quaterniond turn;
    error = graph::error_of(edge.from_from_to, from, to, turn);
    const Matrix3d back = edge.from_from_to.q.toRotationMatrix().transpose(),
                   from_from_map = from.q.toRotationMatrix().transpose();
    const Matrix3d v = cross(turn.vec()), w = turn.w() * Matrix3d::Identity();
    by_to.setZero();
    by_to.topLeftCorner<3, 3>() = back * from_from_map * to.q.toRotationMatrix();
    by_to.bottomRightCorner<3, 3>() = w + v;
    by_from.setZero();
    by_from.topLeftCorner<3, 3>() = -back;
    by_from.topRightCorner<3, 3>() = back * cross(from_from_map * (to.t - from.t));
    by_from.bottomRightCorner<3, 3>() = (v - w) * back;
  }
  static Pose3 moved(const Pose3& pose, const Vector6& motion) { return moved_by(pose, motion); }
};

// Translations are in the scale of `from`, small motions in that of the graph.
struct WithScale {
  using Pose = Sim3;
  using Edge = SimilarityEdge;
  using Error = Vector7;
  using Matrix = Matrix7;
  static constexpr int kSize = 7;
  static constexpr double kFirstDamping = 1e-4;  // as in space

  // As in space, and the logarithm of the scale.
  static Vector7 error_of(const SimilarityEdge& edge, const Sim3& from, const Sim3& to) {
    Eigen::Quaterniond turn;
    Vector7 error;
    error << graph::error_of(edge.from_from_to.pose, in_scale_of(from, from), in_scale_of(from, to), turn),
        std::log(to.scale / (from.scale * edge.from_from_to.scale));
    error.head<3>() /= edge.from_from_to.scale;
    return error;
  }
  static void linearise(const SimilarityEdge& edge, const Sim3& from, const Sim3& to, Vector7& error, Matrix7& by_from,
                        Matrix7& by_to) {
    const Sim3& measured = edge.from_from_to;
    const Pose3 a = in_scale_of(from, from), b = in_scale_of(from, to);
    error = error_of(edge, from, to);
    Vector6 rigid;
    Matrix6 from6, to6;
    InSpace::linearise({edge.from, edge.to, measured.pose, {}}, a, b, rigid, from6, to6);
    const auto shrink = [&](Matrix6& by) {
      by.topRows<3>() /= measured.scale;
      by.topLeftCorner<3, 3>() /= from.scale;
    };
    shrink(from6);
    shrink(to6);
    by_from.setZero();
    by_from.topLeftCorner<6, 6>() = from6;
    by_from.topRightCorner<3, 1>() = (measured.pose.q.conjugate() * (a.q.conjugate() * (a.t - b.t))) / measured.scale;
    by_from(6, 6) = -1.0;
    by_to.setZero();
    by_to.topLeftCorner<6, 6>() = to6;
    by_to(6, 6) = 1.0;
  }
  static Pose3 in_scale_of(const Sim3& from, const Sim3& pose) { return {pose.pose.t / from.scale, pose.pose.q}; }
  static Sim3 moved(const Sim3& pose, const Vector7& motion) {
    return {moved_by(pose.pose, motion.head<6>()), pose.scale * std::exp(motion(6))};
  }
};

bool is_sound(const Pose3& pose) { return is_finite(pose); }
bool is_sound(const Sim3& pose) { return is_finite(pose.pose) && pose.scale > 0.0 && std::isfinite(pose.scale); }

template <class Space, class Solution>
Solution solved(const std::vector<typename Space::Pose>& initial, const std::vector<typename Space::Edge>& edges,
                int iterations, std::uint32_t fixed) {
  MAPWEAVE_EXPECT(initial.empty() || fixed < initial.size(), "the fixed pose is one of them");
  for (const auto& edge : edges) {
    MAPWEAVE_EXPECT(edge.from < initial.size() && edge.to < initial.size() && edge.from != edge.to,
                    "edges join two of the poses");
    MAPWEAVE_EXPECT(edge.information.allFinite() && is_sound(edge.from_from_to), "edges are finite");
  }
  Solution solution;
  solution.poses = initial;
  if (edges.empty()) {
    solution.converged = true;
    return solution;
  }
  constexpr double kEnough = 1e-6;  // of the cost: what a step gains at the end
  const Descent descent = PoseGraphSolver<Space>(solution.poses, edges, fixed).run(iterations, kEnough);
  solution.chi2 = descent.cost;
  solution.iterations = descent.iterations;
  solution.converged = descent.converged;
  return solution;
}

}  // namespace

SpatialSolution solve(const std::vector<Pose3>& initial, const std::vector<SpatialEdge>& edges, int iterations,
                      std::uint32_t fixed) {
  return solved<InSpace, SpatialSolution>(initial, edges, iterations, fixed);
}

SimilaritySolution solve(const std::vector<Sim3>& initial, const std::vector<SimilarityEdge>& edges, int iterations,
                         std::uint32_t fixed) {
  for (const Sim3& pose : initial)
    MAPWEAVE_EXPECT(pose.scale > 0.0 && std::isfinite(pose.scale), "scales are positive");
  return solved<WithScale, SimilaritySolution>(initial, edges, iterations, fixed);
}

double chi2_of(const SpatialEdge& edge, const std::vector<Pose3>& poses) {
  const Vector6 error = InSpace::error_of(edge, poses[edge.from], poses[edge.to]);
  return error.dot(edge.information * error);
}

}  // namespace mapweave::graph
