#include <mapweave/core/error.h>
#include <mapweave/graph/block_cholesky.h>
#include <mapweave/graph/spatial_graph.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <optional>

namespace mapweave::graph {
namespace {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Eigen::Matrix3d;

constexpr std::int32_t kNone = -1;

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

// Levenberg-Marquardt on the poses that edges name, without the fixed one.
class Solver {
 public:
  Solver(std::vector<Pose3>& poses, const std::vector<SpatialEdge>& edges, std::uint32_t fixed) : poses_(poses), edges_(edges) {
    std::vector<std::int32_t> number(poses.size(), kNone);
    for (const SpatialEdge& edge : edges) {
      information_.push_back(sound(edge.information));
      for (const std::uint32_t pose : {edge.from, edge.to})
        if (pose != fixed) number[pose] = 0;
    }
    for (std::size_t pose = 0; pose < poses.size(); ++pose)
      if (number[pose] != kNone) number[pose] = static_cast<std::int32_t>(free_.size()), free_.push_back(pose);
    std::vector<std::vector<std::int32_t>> below(free_.size());
    for (const SpatialEdge& edge : edges) {
      Place place{number[edge.from], number[edge.to], 0};
      if (place.from != kNone && place.to != kNone)
        below[static_cast<std::size_t>(std::max(place.from, place.to))].push_back(std::min(place.from, place.to));
      places_.push_back(place);
    }
    std::vector<std::size_t> row_begin{0};
    std::vector<std::int32_t> columns;
    for (auto& row : below) {
      std::sort(row.begin(), row.end());
      row.erase(std::unique(row.begin(), row.end()), row.end());
      columns.insert(columns.end(), row.begin(), row.end());
      row_begin.push_back(columns.size());
    }
    for (Place& place : places_) {
      if (place.from == kNone || place.to == kNone) continue;
      const auto row = static_cast<std::size_t>(std::max(place.from, place.to));
      const auto first = columns.begin() + static_cast<std::ptrdiff_t>(row_begin[row]),
                 last = columns.begin() + static_cast<std::ptrdiff_t>(row_begin[row + 1]);
      place.block = static_cast<std::size_t>(std::lower_bound(first, last, std::min(place.from, place.to)) - columns.begin());
    }
    diagonal_.resize(free_.size()), below_.resize(columns.size());
    cholesky_.emplace(std::move(row_begin), std::move(columns));
  }

  SpatialSolution run(int iterations) {
    constexpr double kEnough = 1e-6;  // of the cost, that a step saves
    SpatialSolution solution;
    double cost = cost_of(poses_), damping = 1e-4;
    while (solution.iterations < iterations && !solution.converged) {
      ++solution.iterations;
      linearise();
      bool better = false;
      while (!better && !solution.converged) {
        const double saved = step(damping, cost);
        better = saved > 0.0;
        if (!better && damping > 1e8) solution.converged = true;  // nothing is left to gain
        damping = std::clamp(better ? 0.1 * damping : 10.0 * damping, 1e-10, 1e10);
        if (better) solution.converged = saved <= kEnough * cost, cost -= saved;
      }
      if (cost < 1e-20) solution.converged = true;
    }
    solution.chi2 = cost;
    return solution;
  }

 private:
  struct Place {
    std::int32_t from, to;  // among the free poses
    std::size_t block;      // between both
  };

  double cost_of(const std::vector<Pose3>& poses) const {
    double cost = 0.0;
    Eigen::Quaterniond turn;
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const Vector6 error = error_of(edges_[i].from_from_to, poses[edges_[i].from], poses[edges_[i].to], turn);
      cost += error.dot(information_[i] * error);
    }
    return cost;
  }

  void linearise() {
    for (Matrix6& block : diagonal_) block.setZero();
    for (Matrix6& block : below_) block.setZero();
    gradient_.setZero(6 * static_cast<Eigen::Index>(free_.size()));
    const auto add = [&](std::int32_t pose, const Matrix6& slope, const Matrix6& weighted, const Vector6& error) {
      if (pose == kNone) return;
      diagonal_[static_cast<std::size_t>(pose)].noalias() += slope.transpose().lazyProduct(weighted);
      gradient_.segment<6>(6 * static_cast<Eigen::Index>(pose)).noalias() += weighted.transpose().lazyProduct(error);
    };
    Eigen::Quaterniond turn;
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const Pose3 &a = poses_[edges_[i].from], &b = poses_[edges_[i].to], &measured = edges_[i].from_from_to;
      const Vector6 error = error_of(measured, a, b, turn);
      const Slopes slopes = slopes_of(measured, a, b, turn);
      const Matrix6 from = information_[i].lazyProduct(slopes.from), to = information_[i].lazyProduct(slopes.to);
      const Place& place = places_[i];
      add(place.from, slopes.from, from, error);
      add(place.to, slopes.to, to, error);
      if (place.from == kNone || place.to == kNone) continue;
      if (place.from > place.to)
        below_[place.block].noalias() += slopes.from.transpose().lazyProduct(to);
      else
        below_[place.block].noalias() += slopes.to.transpose().lazyProduct(from);
    }
  }

  // Answers what it saves of the cost, 0 where it is not taken.
  double step(double damping, double cost) {
    std::vector<Matrix6> damped = diagonal_;
    for (Matrix6& block : damped)
      for (int i = 0; i < 6; ++i) block(i, i) += damping * std::max(block(i, i), 1e-6);
    if (!cholesky_->factorise(damped, below_)) return 0.0;
    const Eigen::VectorXd change = cholesky_->solved(gradient_);
    std::vector<Pose3> moved = poses_;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const Vector6 d = -change.segment<6>(6 * static_cast<Eigen::Index>(i));
      Pose3& pose = moved[free_[i]];
      const double angle = d.tail<3>().norm();
      pose.t += pose.q * d.head<3>();
      if (angle > 0.0) pose.q = (pose.q * Eigen::Quaterniond(Eigen::AngleAxisd(angle, d.tail<3>() / angle))).normalized();
    }
    const double after = cost_of(moved);
    if (!(after < cost)) return 0.0;
    poses_ = std::move(moved);
    return cost - after;
  }

  std::vector<Pose3>& poses_;
  const std::vector<SpatialEdge>& edges_;
  std::vector<Matrix6> information_;
  std::vector<std::size_t> free_;
  std::vector<Place> places_;
  std::vector<Matrix6> diagonal_, below_;
  Eigen::VectorXd gradient_;
  std::optional<BlockCholesky> cholesky_;
};

}  // namespace

SpatialSolution solve(const std::vector<Pose3>& initial, const std::vector<SpatialEdge>& edges, int iterations, std::uint32_t fixed) {
  MAPWEAVE_EXPECT(initial.empty() || fixed < initial.size(), "the fixed pose is one of them");
  for (const SpatialEdge& edge : edges) {
    MAPWEAVE_EXPECT(edge.from < initial.size() && edge.to < initial.size() && edge.from != edge.to, "edges join two of the poses");
    MAPWEAVE_EXPECT(edge.information.allFinite() && is_finite(edge.from_from_to), "edges are finite");
  }
  std::vector<Pose3> poses = initial;
  SpatialSolution solution;
  if (edges.empty())
    solution.converged = true;
  else
    solution = Solver(poses, edges, fixed).run(iterations);
  solution.poses = std::move(poses);
  return solution;
}

double chi2_of(const SpatialEdge& edge, const std::vector<Pose3>& poses) {
  Eigen::Quaterniond turn;
  const Vector6 error = error_of(edge.from_from_to, poses[edge.from], poses[edge.to], turn);
  return error.dot(edge.information * error);
}

}  // namespace mapweave::graph
