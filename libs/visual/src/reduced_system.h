#pragma once
// The normal equations of bundle adjustment once points are eliminated: a block of 6 x 6 for each two views that see a
// common point, and a border of two for what all views share. Dense for a window, sparse for a whole map.

#include <Eigen/Core>
#include <Eigen/SparseCholesky>
#include <cstdint>
#include <utility>
#include <vector>

namespace mapweave::visual {

class ReducedSystem {
 public:
  using Block = Eigen::Matrix<double, 6, 6>;
  using Border = Eigen::Matrix<double, 2, 6>;
  // pairs: (row, column) with column < row, of free views that see a common point; sorted, each once. Not looked at
  // where few are free.
  ReducedSystem(int views, const std::vector<std::pair<int, int>>& pairs);
  static bool is_sparse(int views) { return views > kMostDense; }

  void set_zero();
  Block& diagonal(int view) { return blocks_[static_cast<std::size_t>(view)]; }
  Block& below(int row, int column);  // column < row
  Border& border(int view) { return borders_[static_cast<std::size_t>(view)]; }
  Eigen::Matrix2d& corner() { return corner_; }
  // Lower triangle counts. Empty where it cannot be solved.
  Eigen::VectorXd solved(const Eigen::VectorXd& right);

 private:
  static constexpr int kMostDense = 40;  // views: larger systems have few blocks that are not zero
  Eigen::VectorXd solved_densely(const Eigen::VectorXd& right) const;
  Eigen::VectorXd solved_sparsely(const Eigen::VectorXd& right);
  int views_;
  std::vector<Block> blocks_;           // diagonal ones, then those below
  std::vector<std::size_t> row_begin_;  // sparse: in columns_
  std::vector<int> columns_;
  std::vector<Border> borders_;
  Eigen::Matrix2d corner_;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> sparse_;
  bool analysed_ = false;
};

}  // namespace mapweave::visual
