#include "block_kernels.h"

#include <mapweave/core/error.h>
#include <mapweave/core/processor_clones.h>
#include <mapweave/graph/block_cholesky.h>

#include <Eigen/Cholesky>
#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>
#include <algorithm>

namespace mapweave::graph {
namespace {

// For each row its place in an order that leaves few blocks in the factor.
std::vector<std::int32_t> places(std::size_t count, const std::vector<std::size_t>& row_begin,
                                 const std::vector<std::int32_t>& columns) {
  using Pattern = Eigen::SparseMatrix<double, Eigen::ColMajor, int>;
  std::vector<Eigen::Triplet<double>> entries;
  for (std::size_t row = 0; row < count; ++row) {
    entries.emplace_back(static_cast<int>(row), static_cast<int>(row), 1.0);
    for (std::size_t i = row_begin[row]; i < row_begin[row + 1]; ++i) {
      entries.emplace_back(static_cast<int>(row), columns[i], 1.0);
      entries.emplace_back(columns[i], static_cast<int>(row), 1.0);
    }
  }
  Pattern pattern(static_cast<int>(count), static_cast<int>(count));
  pattern.setFromTriplets(entries.begin(), entries.end());
  Eigen::PermutationMatrix<Eigen::Dynamic, Eigen::Dynamic, int> order;
  Eigen::AMDOrdering<int>()(pattern, order);  // order.indices()(place) is a row
  std::vector<std::int32_t> place(count);
  for (std::size_t i = 0; i < count; ++i)
    place[static_cast<std::size_t>(order.indices()(static_cast<int>(i)))] = static_cast<std::int32_t>(i);
  return place;
}

// Puts the factor into the place of the block.
template <class Block>
bool has_root(Block& block) {
  const Eigen::LLT<Block> cholesky(block);
  if (cholesky.info() == Eigen::Success) block = cholesky.matrixL();
  return cholesky.info() == Eigen::Success;
}

}  // namespace

template <int kSize>
BlockCholesky<kSize>::BlockCholesky(std::vector<std::size_t> row_begin, std::vector<std::int32_t> columns)
    : count_(row_begin.size() - 1), row_begin_(std::move(row_begin)), columns_(std::move(columns)) {
  MAPWEAVE_EXPECT(row_begin_.back() == columns_.size(), "each row knows where its columns end");
  place_ = places(count_, row_begin_, columns_);
  std::vector<std::vector<std::int32_t>> below(count_);  // by column
  for (std::size_t row = 0; row < count_; ++row)
    for (std::size_t i = row_begin_[row]; i < row_begin_[row + 1]; ++i) {
      const auto [low, high] = std::minmax(place_[row], place_[static_cast<std::size_t>(columns_[i])]);
      below[static_cast<std::size_t>(low)].push_back(high);
    }
  // A column's rows, but the first, are rows of the column which that first one names.
  begin_.push_back(0);
  for (std::size_t column = 0; column < count_; ++column) {
    auto& rows = below[column];
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    if (rows.size() > 1) {
      auto& parent = below[static_cast<std::size_t>(rows.front())];
      parent.insert(parent.end(), rows.begin() + 1, rows.end());
    }
    rows_.insert(rows_.end(), rows.begin(), rows.end());
    begin_.push_back(rows_.size());
    std::vector<std::int32_t>().swap(rows);
  }
  target_.resize(columns_.size());
  turned_.resize(columns_.size());
  for (std::size_t row = 0; row < count_; ++row)
    for (std::size_t i = row_begin_[row]; i < row_begin_[row + 1]; ++i) {
      const std::int32_t one = place_[row], other = place_[static_cast<std::size_t>(columns_[i])];
      turned_[i] = one < other;
      const auto column = static_cast<std::size_t>(std::min(one, other));
      const auto first = rows_.begin() + static_cast<std::ptrdiff_t>(begin_[column]),
                 last = rows_.begin() + static_cast<std::ptrdiff_t>(begin_[column + 1]);
      target_[i] = static_cast<std::size_t>(std::lower_bound(first, last, std::max(one, other)) - rows_.begin());
    }
}

namespace {

// The factor in the place of the matrix; false where it is not positive definite.
template <int kSize>
MAPWEAVE_INTO_CLONES bool eliminate(std::size_t count, const std::size_t* begin, const std::int32_t* rows,
                                    Eigen::Matrix<double, kSize, kSize>* pivots,
                                    Eigen::Matrix<double, kSize, kSize>* blocks) {
  constexpr std::int32_t kNone = -1;
  // Columns that are finished and whose next row is this one; which block that is.
  std::vector<std::int32_t> waiting(count, kNone), next(count, kNone);
  std::vector<std::size_t> reached(count), where(count);
  for (std::size_t column = 0; column < count; ++column) {
    for (std::size_t i = begin[column]; i < begin[column + 1]; ++i) where[static_cast<std::size_t>(rows[i])] = i;
    for (std::int32_t done = waiting[column]; done != kNone;) {
      const auto from = static_cast<std::size_t>(done);
      const std::size_t first = reached[from], end = begin[from + 1];
      const double* const factor = blocks[first].data();
      subtract_product<kSize, kSize>(factor, factor, pivots[column].data());
      for (std::size_t i = first + 1; i < end; ++i)
        subtract_product<kSize, kSize>(blocks[i].data(), factor,
                                       blocks[where[static_cast<std::size_t>(rows[i])]].data());
      done = next[from];
      if (first + 1 < end) {
        reached[from] = first + 1;
        auto& list = waiting[static_cast<std::size_t>(rows[first + 1])];
        next[from] = list;
        list = static_cast<std::int32_t>(from);
      }
    }
    if (!has_root(pivots[column])) return false;
    for (std::size_t i = begin[column]; i < begin[column + 1]; ++i)
      divide_by_transposed<kSize>(pivots[column].data(), blocks[i].data());
    if (begin[column] == begin[column + 1]) continue;
    reached[column] = begin[column];
    auto& list = waiting[static_cast<std::size_t>(rows[begin[column]])];
    next[column] = list;
    list = static_cast<std::int32_t>(column);
  }
  return true;
}

MAPWEAVE_WIDE_CLONES bool eliminated(std::size_t count, const std::size_t* begin, const std::int32_t* rows,
                                     BlockCholesky<3>::Block* pivots, BlockCholesky<3>::Block* blocks) {
  return eliminate<3>(count, begin, rows, pivots, blocks);
}
MAPWEAVE_WIDE_CLONES bool eliminated(std::size_t count, const std::size_t* begin, const std::int32_t* rows,
                                     BlockCholesky<6>::Block* pivots, BlockCholesky<6>::Block* blocks) {
  return eliminate<6>(count, begin, rows, pivots, blocks);
}
MAPWEAVE_WIDE_CLONES bool eliminated(std::size_t count, const std::size_t* begin, const std::int32_t* rows,
                                     BlockCholesky<7>::Block* pivots, BlockCholesky<7>::Block* blocks) {
  return eliminate<7>(count, begin, rows, pivots, blocks);
}

}  // namespace

template <int kSize>
bool BlockCholesky<kSize>::factorise(const std::vector<Block>& diagonal, const std::vector<Block>& below) {
  MAPWEAVE_EXPECT(diagonal.size() == count_ && below.size() == columns_.size(), "blocks as the pattern has them");
  pivots_.resize(count_);
  blocks_.assign(rows_.size(), Block::Zero());
  for (std::size_t row = 0; row < count_; ++row) pivots_[static_cast<std::size_t>(place_[row])] = diagonal[row];
  for (std::size_t i = 0; i < below.size(); ++i) {
    if (turned_[i])
      blocks_[target_[i]] = below[i].transpose();
    else
      blocks_[target_[i]] = below[i];
  }
  return eliminated(count_, begin_.data(), rows_.data(), pivots_.data(), blocks_.data());
}

template <int kSize>
Eigen::VectorXd BlockCholesky<kSize>::solved(const Eigen::VectorXd& right) const {
  const auto rows = static_cast<Eigen::Index>(count_);
  MAPWEAVE_EXPECT(right.size() == kSize * rows, "kSize numbers a row");
  Eigen::VectorXd x(right.size());
  const auto at = [](auto place) { return kSize * static_cast<Eigen::Index>(place); };
  for (std::size_t row = 0; row < count_; ++row)
    x.template segment<kSize>(at(place_[row])) = right.template segment<kSize>(at(row));
  for (std::size_t column = 0; column < count_; ++column) {
    auto here = x.template segment<kSize>(at(column));
    pivots_[column].template triangularView<Eigen::Lower>().solveInPlace(here);
    for (std::size_t i = begin_[column]; i < begin_[column + 1]; ++i)
      x.template segment<kSize>(at(rows_[i])).noalias() -= blocks_[i].lazyProduct(here);
  }
  for (std::size_t column = count_; column-- > 0;) {
    auto here = x.template segment<kSize>(at(column));
    for (std::size_t i = begin_[column]; i < begin_[column + 1]; ++i)
      here.noalias() -= blocks_[i].transpose().lazyProduct(x.template segment<kSize>(at(rows_[i])));
    pivots_[column].template triangularView<Eigen::Lower>().transpose().solveInPlace(here);
  }
  Eigen::VectorXd result(right.size());
  for (std::size_t row = 0; row < count_; ++row)
    result.template segment<kSize>(at(row)) = x.template segment<kSize>(at(place_[row]));
  return result;
}

template class BlockCholesky<3>;
template class BlockCholesky<6>;
template class BlockCholesky<7>;

}  // namespace mapweave::graph
