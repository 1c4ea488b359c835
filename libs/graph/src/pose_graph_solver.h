#pragma once
// Graphs of poses as a problem of levenberg_marquardt.h: in the plane, in space, and where scales drift. What differs
// stands in a `Space`:
//   Pose, Edge        with numbers of poses `from` and `to`, the measured pose `from_from_to`, and `information`
//   kSize             numbers that a small motion of a pose has
//   kFirstDamping     share of the diagonal that is added first
//   Error, Matrix     vector of kSize, square
//   error_of(edge, from, to)                          what is left of the edge
//   linearise(edge, from, to, error, by_from, by_to)  the same, and how it changes with small motions of both
//   moved(pose, motion)

#include "levenberg_marquardt.h"

#include <mapweave/graph/block_cholesky.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <vector>

namespace mapweave::graph {

// Symmetric and nowhere negative; also of matrices that are rank deficient.
template <class Matrix>
Matrix sound(const Matrix& information) {
  const Matrix symmetric = 0.5 * (information + information.transpose());
  if (symmetric.llt().info() == Eigen::Success) return symmetric;
  const Eigen::SelfAdjointEigenSolver<Matrix> eigen(symmetric);
  return eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0.0).asDiagonal() * eigen.eigenvectors().transpose();
}

// Poses that edges name are free, but for the fixed one. The pattern is analysed once, however often weights change.
template <class Space>
class PoseGraphSolver {
 public:
  using Pose = typename Space::Pose;
  using Edge = typename Space::Edge;
  using Error = typename Space::Error;
  using Matrix = typename Space::Matrix;

  // Both must outlive this.
  PoseGraphSolver(std::vector<Pose>& poses, const std::vector<Edge>& edges, std::uint32_t fixed)
      : poses_(poses), edges_(edges) {
    std::vector<std::int32_t> number(poses.size(), kNone);
    for (const Edge& edge : edges) {
      information_.push_back(sound(edge.information));
      for (const std::uint32_t pose : {edge.from, edge.to})
        if (pose != fixed) number[pose] = 0;
    }
    weighted_ = information_;
    for (std::size_t pose = 0; pose < poses.size(); ++pose)
      if (number[pose] != kNone) {
        number[pose] = static_cast<std::int32_t>(free_.size());
        free_.push_back(pose);
      }
    place_edges(number);
  }

  // Of each edge; all are 1 before.
  void set_weights(const std::vector<double>& weights) {
    for (std::size_t i = 0; i < weighted_.size(); ++i) weighted_[i] = weights[i] * information_[i];
  }

  // Of levenberg_marquardt.h.
  Descent run(int iterations, double enough) {
    Damping damping;
    damping.first = Space::kFirstDamping;
    return descend(*this, iterations, enough, damping);
  }
  double cost() const { return cost_of(poses_); }
  void linearise() {
    for (Matrix& block : diagonal_) block.setZero();
    for (Matrix& block : below_) block.setZero();
    gradient_.setZero(Space::kSize * static_cast<Eigen::Index>(free_.size()));
    const auto add = [&](std::int32_t pose, const Matrix& slope, const Matrix& weighted, const Error& error) {
      if (pose == kNone) return;
      diagonal_[static_cast<std::size_t>(pose)].noalias() += slope.transpose().lazyProduct(weighted);
      gradient_.template segment<Space::kSize>(Space::kSize * static_cast<Eigen::Index>(pose)).noalias() +=
          weighted.transpose().lazyProduct(error);
    };
    Error error;
    Matrix by_from, by_to;
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      Space::linearise(edges_[i], poses_[edges_[i].from], poses_[edges_[i].to], error, by_from, by_to);
      const Matrix from = weighted_[i].lazyProduct(by_from), to = weighted_[i].lazyProduct(by_to);
      const Place& place = places_[i];
      add(place.from, by_from, from, error);
      add(place.to, by_to, to, error);
      if (place.from == kNone || place.to == kNone) continue;
      if (place.from > place.to)
        below_[place.block].noalias() += by_from.transpose().lazyProduct(to);
      else
        below_[place.block].noalias() += by_to.transpose().lazyProduct(from);
    }
  }
  std::optional<double> try_step(double damping) {
    std::vector<Matrix> damped = diagonal_;
    for (Matrix& block : damped)
      for (int i = 0; i < Space::kSize; ++i) block(i, i) += damping * std::max(block(i, i), 1e-6);
    if (!cholesky_->factorise(damped, below_)) return std::nullopt;
    const Eigen::VectorXd change = cholesky_->solved(gradient_);
    tried_ = poses_;
    for (std::size_t i = 0; i < free_.size(); ++i) {
      const Error motion = -change.segment<Space::kSize>(Space::kSize * static_cast<Eigen::Index>(i));
      tried_[free_[i]] = Space::moved(tried_[free_[i]], motion);
    }
    return cost_of(tried_);
  }
  void take_step() { poses_.swap(tried_); }

 private:
  static constexpr std::int32_t kNone = -1;
  struct Place {
    std::int32_t from, to;  // among the free poses
    std::size_t block;      // between both
  };

  void place_edges(const std::vector<std::int32_t>& number) {
    std::vector<std::vector<std::int32_t>> below(free_.size());
    for (const Edge& edge : edges_) {
      const Place place{number[edge.from], number[edge.to], 0};
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
      place.block =
          static_cast<std::size_t>(std::lower_bound(first, last, std::min(place.from, place.to)) - columns.begin());
    }
    diagonal_.resize(free_.size());
    below_.resize(columns.size());
    cholesky_.emplace(std::move(row_begin), std::move(columns));
  }

  double cost_of(const std::vector<Pose>& poses) const {
    double cost = 0.0;
    for (std::size_t i = 0; i < edges_.size(); ++i) {
      const Error error = Space::error_of(edges_[i], poses[edges_[i].from], poses[edges_[i].to]);
      cost += error.dot(weighted_[i] * error);
    }
    return cost;
  }

  std::vector<Pose>& poses_;
  std::vector<Pose> tried_;
  const std::vector<Edge>& edges_;
  std::vector<Matrix> information_, weighted_;
  std::vector<std::size_t> free_;
  std::vector<Place> places_;
  std::vector<Matrix> diagonal_, below_;
  Eigen::VectorXd gradient_;
  std::optional<BlockCholesky<Space::kSize>> cholesky_;
};

}  // namespace mapweave::graph
