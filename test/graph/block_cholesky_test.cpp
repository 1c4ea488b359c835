#include <mapweave/graph/block_cholesky.h>

#include <gmock/gmock.h>
#include <Eigen/Cholesky>
#include <random>

namespace mapweave::graph {
namespace {

template <int kSize>
struct Problem {
  using Block = typename BlockCholesky<kSize>::Block;
  std::vector<std::size_t> row_begin{0};
  std::vector<std::int32_t> columns;
  std::vector<Block> diagonal, below;
  Eigen::MatrixXd dense;
  Eigen::VectorXd right;
};

template <int kSize>
Problem<kSize> problem(int rows, int per_row, unsigned seed, double least = 1.0) {
  std::mt19937 random(seed);
  const auto draw = [&] { return static_cast<double>(random() >> 8) * 0x1.0p-24 - 0.5; };
  using Block = typename BlockCholesky<kSize>::Block;
  Problem<kSize> result;
  result.dense = Eigen::MatrixXd::Zero(kSize * rows, kSize * rows);
  for (int row = 0; row < rows; ++row) {
    std::vector<std::int32_t> columns;
    if (row > 0) columns.push_back(row - 1);
    for (int i = 0; i < per_row && row > 0; ++i)
      columns.push_back(static_cast<std::int32_t>(random() % static_cast<unsigned>(row)));
    std::sort(columns.begin(), columns.end());
    columns.erase(std::unique(columns.begin(), columns.end()), columns.end());
    for (const std::int32_t column : columns) {
      result.columns.push_back(column);
      result.below.push_back(Block::NullaryExpr([&] { return draw(); }));
      result.dense.template block<kSize, kSize>(kSize * row, kSize * column) = result.below.back();
      result.dense.template block<kSize, kSize>(kSize * column, kSize * row) = result.below.back().transpose();
    }
    result.row_begin.push_back(result.columns.size());
  }
  for (int row = 0; row < rows; ++row) {
    const double sum = result.dense.middleRows(kSize * row, kSize).cwiseAbs().rowwise().sum().maxCoeff();
    Block block = (least * sum + 1.0) * Block::Identity();
    block(1, 0) = block(0, 1) = 0.1;
    result.diagonal.push_back(block);
    result.dense.template block<kSize, kSize>(kSize * row, kSize * row) = block;
  }
  result.right = Eigen::VectorXd::NullaryExpr(kSize * rows, [&] { return draw(); });
  return result;
}

template <int kSize>
void expect_solves_what_a_dense_one_does() {
  for (const auto& [rows, per_row] : {std::pair(1, 0), {2, 1}, {7, 0}, {40, 2}, {90, 6}}) {
    const Problem<kSize> p = problem<kSize>(rows, per_row, static_cast<unsigned>(rows));
    BlockCholesky<kSize> cholesky(p.row_begin, p.columns);
    for (int again = 0; again < 2; ++again) {
      ASSERT_TRUE(cholesky.factorise(p.diagonal, p.below));
      const Eigen::VectorXd expected = p.dense.llt().solve(p.right);
      EXPECT_LT((cholesky.solved(p.right) - expected).norm(), 1e-12 * expected.norm()) << rows;
    }
  }
}
TEST(BlockCholesky, solves_what_a_dense_one_does) {
  expect_solves_what_a_dense_one_does<3>();
  expect_solves_what_a_dense_one_does<6>();
}

TEST(BlockCholesky, says_what_is_not_positive_definite) {
  Problem<6> p = problem<6>(30, 3, 5);
  p.diagonal[17](2, 2) = -1.0;
  BlockCholesky<6> cholesky(p.row_begin, p.columns);
  EXPECT_FALSE(cholesky.factorise(p.diagonal, p.below));
}

}  // namespace
}  // namespace mapweave::graph
