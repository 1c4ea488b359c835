#include "reduced_system.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace mapweave::visual {

ReducedSystem::ReducedSystem(int views, const std::vector<std::pair<int, int>>& pairs) : views_(views) {
  const auto count = static_cast<std::size_t>(views);
  borders_.resize(count);
  if (!is_sparse(views)) {
    blocks_.resize(count + count * (count > 0 ? count - 1 : 0) / 2);
  } else {
    blocks_.resize(count + pairs.size());
    row_begin_.assign(count + 1, 0);
    for (const auto& [row, column] : pairs) ++row_begin_[static_cast<std::size_t>(row) + 1], columns_.push_back(column);
    for (std::size_t i = 0; i < count; ++i) row_begin_[i + 1] += row_begin_[i];
  }
  set_zero();
}

void ReducedSystem::set_zero() {
  std::fill(blocks_.begin(), blocks_.end(), Block::Zero());
  std::fill(borders_.begin(), borders_.end(), Border::Zero());
  corner_.setZero();
}

ReducedSystem::Block& ReducedSystem::below(int row, int column) {
  const auto r = static_cast<std::size_t>(row);
  if (!is_sparse(views_))
    return blocks_[static_cast<std::size_t>(views_) + r * (r - 1) / 2 + static_cast<std::size_t>(column)];
  const auto first = columns_.begin();
  const auto place = std::lower_bound(first + static_cast<std::ptrdiff_t>(row_begin_[r]),
                                      first + static_cast<std::ptrdiff_t>(row_begin_[r + 1]), column);
  return blocks_[static_cast<std::size_t>(views_) + static_cast<std::size_t>(place - first)];
}

Eigen::VectorXd ReducedSystem::solved(const Eigen::VectorXd& right) {
  return is_sparse(views_) ? solved_sparsely(right) : solved_densely(right);
}

Eigen::VectorXd ReducedSystem::solved_densely(const Eigen::VectorXd& right) const {
  Eigen::MatrixXd matrix = Eigen::MatrixXd::Zero(right.size(), right.size());
  std::size_t next = static_cast<std::size_t>(views_);
  for (int row = 0; row < views_; ++row) {
    for (int column = 0; column < row; ++column) matrix.block<6, 6>(6 * row, 6 * column) = blocks_[next++];
    matrix.block<6, 6>(6 * row, 6 * row) = blocks_[static_cast<std::size_t>(row)];
    matrix.block<2, 6>(6 * views_, 6 * row) = borders_[static_cast<std::size_t>(row)];
  }
  matrix.bottomRightCorner<2, 2>() = corner_;
  return matrix.selfadjointView<Eigen::Lower>().ldlt().solve(right);
}

Eigen::VectorXd ReducedSystem::solved_sparsely(const Eigen::VectorXd& right) {
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(36 * blocks_.size());
  const auto put = [&](int row, int column, const auto& block) {
    for (int r = 0; r < block.rows(); ++r)
      for (int c = 0; c < block.cols(); ++c)
        if (row + r >= column + c) entries.emplace_back(row + r, column + c, block(r, c));
  };
  for (int row = 0; row < views_; ++row) {
    const auto r = static_cast<std::size_t>(row);
    put(6 * row, 6 * row, blocks_[r]);
    for (std::size_t i = row_begin_[r]; i < row_begin_[r + 1]; ++i)
      put(6 * row, 6 * columns_[i], blocks_[static_cast<std::size_t>(views_) + i]);
    put(6 * views_, 6 * row, borders_[r]);
  }
  put(6 * views_, 6 * views_, corner_);
  Eigen::SparseMatrix<double> matrix(right.size(), right.size());
  matrix.setFromTriplets(entries.begin(), entries.end());
  if (!analysed_) sparse_.analyzePattern(matrix), analysed_ = true;
  sparse_.factorize(matrix);
  if (sparse_.info() != Eigen::Success) return {};
  return sparse_.solve(right);
}

}  // namespace mapweave::visual
