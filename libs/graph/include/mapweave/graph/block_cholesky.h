#pragma once
// Sparse Cholesky factorisation of symmetric positive definite matrices of square blocks, as poses make them:
// left-looking by block columns (Davis, Direct Methods for Sparse Linear Systems, 2006, section 4.8), in the order of
// approximate minimum degree.

#include <Eigen/Core>

#include <cstdint>
#include <vector>

namespace mapweave::graph {

// kSize: rows of a block; 3 (poses in the plane), 6 (in space) or 7 (with scale). The same pattern factorised again and
// again is analysed once. One thread; the same input gives the same bytes.
template <int kSize>
class BlockCholesky {
 public:
  using Block = Eigen::Matrix<double, kSize, kSize>;

  // Blocks below the diagonal: those of row r stand in columns[row_begin[r]] .. columns[row_begin[r + 1] - 1],
  // ascending, each below r.
  BlockCholesky(std::vector<std::size_t> row_begin, std::vector<std::int32_t> columns);

  // `below` in the order of the pattern's columns; of the diagonal blocks the lower triangle counts. False where the
  // matrix is not positive definite.
  bool factorise(const std::vector<Block>& diagonal, const std::vector<Block>& below);
  // After factorise(). kSize numbers a row.
  Eigen::VectorXd solved(const Eigen::VectorXd& right) const;

 private:
  std::size_t count_;
  std::vector<std::size_t> row_begin_;
  std::vector<std::int32_t> columns_;
  std::vector<std::int32_t> place_;  // of each row in the order of elimination
  // The factor's columns, in the order of elimination: rows below the diagonal, ascending.
  std::vector<std::size_t> begin_;
  std::vector<std::int32_t> rows_;
  // Where each block of the pattern goes: into the factor's blocks; transposed where the order turns it over.
  std::vector<std::size_t> target_;
  std::vector<char> turned_;
  std::vector<Block, Eigen::aligned_allocator<Block>> pivots_, blocks_;
};

extern template class BlockCholesky<3>;
extern template class BlockCholesky<6>;
extern template class BlockCholesky<7>;

}  // namespace mapweave::graph
