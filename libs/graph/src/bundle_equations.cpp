#include "bundle_equations.h"

#include "block_kernels.h"

#include <mapweave/core/processor_clones.h>

#include <Eigen/LU>
#include <algorithm>

namespace mapweave::graph {

BundleEquations::BundleEquations(BundlePattern pattern) : pattern_(std::move(pattern)) {
  for (std::size_t point = 0; point + 1 < pattern_.first.size(); ++point) {
    std::size_t i = pattern_.first[point];
    while (i < pattern_.first[point + 1] && pattern_.column_of_sighting[i] < 0) ++i;
    first_free_.push_back(i);
  }
  find_blocks();
}

void BundleEquations::find_blocks() {
  const auto rows = static_cast<std::size_t>(pattern_.views);
  constexpr std::size_t kBits = 64;
  const std::size_t words = (rows + kBits - 1) / kBits;  // of a row: a bit for each column
  std::vector<std::uint64_t> meeting(rows * words, 0);
  const auto meet = [&](int row, int column) {
    const auto bit = static_cast<std::size_t>(column);
    meeting[static_cast<std::size_t>(row) * words + bit / kBits] |= std::uint64_t{1} << (bit % kBits);
  };
  const std::vector<int>& column_of = pattern_.column_of_sighting;
  for (std::size_t point = 0; point < first_free_.size(); ++point)
    for (std::size_t i = first_free_[point]; i < pattern_.first[point + 1]; ++i)
      for (std::size_t j = first_free_[point]; j < i; ++j) meet(column_of[i], column_of[j]);
  for (const auto& [one, other] : pattern_.view_pairs)
    if (const auto [column, row] = std::minmax(one, other); column >= 0) meet(row, column);
  for (std::size_t row = 0; row < rows; ++row) {
    row_begin_.push_back(columns_.size());
    for (std::size_t column = 0; column < row; ++column) {
      const std::uint64_t left = meeting[row * words + column / kBits] >> (column % kBits);
      if (left == 0) column |= kBits - 1;
      if ((left & 1) != 0) columns_.push_back(static_cast<std::int32_t>(column));
    }
  }
  row_begin_.push_back(columns_.size());
  for (std::size_t point = 0; point < first_free_.size(); ++point)
    for (std::size_t i = first_free_[point]; i < pattern_.first[point + 1]; ++i) {
      const auto row = static_cast<std::size_t>(column_of[i]);
      const auto end = columns_.begin() + static_cast<std::ptrdiff_t>(row_begin_[row + 1]);
      auto place = columns_.begin() + static_cast<std::ptrdiff_t>(row_begin_[row]);
      for (std::size_t j = first_free_[point]; j < i; ++j) {
        place = std::lower_bound(place, end, column_of[j]);
        block_of_pair_.push_back(static_cast<std::uint32_t>(place - columns_.begin()));
      }
    }
}

std::size_t BundleEquations::block(int row, int column) const {
  const auto begin = columns_.begin() + static_cast<std::ptrdiff_t>(row_begin_[static_cast<std::size_t>(row)]),
             end = columns_.begin() + static_cast<std::ptrdiff_t>(row_begin_[static_cast<std::size_t>(row) + 1]);
  return static_cast<std::size_t>(std::lower_bound(begin, end, column) - columns_.begin());
}

void BundleEquations::set_zero() {
  const auto views = static_cast<std::size_t>(pattern_.views);
  sums.views.assign(views, Matrix6::Zero());
  sums.views_gradient = Eigen::VectorXd::Zero(6 * pattern_.views);
  sums.points.assign(first_free_.size(), Eigen::Matrix3d::Zero());
  sums.points_gradient.assign(first_free_.size(), Eigen::Vector3d::Zero());
  sums.view_by_point.resize(pattern_.column_of_sighting.size());
  sums.used.assign(pattern_.column_of_sighting.size(), 0);
  sums.view_by_view.resize(pattern_.view_pairs.size());
  if (!pattern_.has_border) return;
  sums.border.setZero();
  sums.border_gradient.setZero();
  sums.border_by_view.assign(views, Eigen::Matrix<double, 2, 6>::Zero());
  sums.border_by_point.assign(first_free_.size(), Eigen::Matrix<double, 2, 3>::Zero());
}

namespace {

template <class Block>
void damp(Block& block, double damping, double least) {
  block.diagonal() *= 1.0 + damping;
  block.diagonal().array() += least;
}

// Of the diagonal: what nothing holds stays where it is instead of making the system singular. Of a point that two
// views see along one ray the depth is such; views are held by many.
constexpr double kLeastOfViews = 1e-9, kLeastOfPoints = 1e-6;

}  // namespace

std::optional<BundleStep> BundleEquations::solved(double damping) {
  std::vector<Matrix6> diagonal = sums.views, below(columns_.size(), Matrix6::Zero());
  for (Matrix6& block : diagonal) damp(block, damping, kLeastOfViews);
  for (std::size_t i = 0; i < pattern_.view_pairs.size(); ++i)
    if (const auto [column, row] = std::minmax(pattern_.view_pairs[i].first, pattern_.view_pairs[i].second);
        column >= 0)
      below[block(row, column)] += sums.view_by_view[i];
  inverse_.resize(sums.points.size());
  for (std::size_t point = 0; point < sums.points.size(); ++point) {
    Eigen::Matrix3d damped = sums.points[point];
    damp(damped, damping, kLeastOfPoints);
    inverse_[point] = damped.inverse();
    if (!pattern_.fixed_points.empty() && pattern_.fixed_points[point] != 0) inverse_[point].setZero();
  }
  BundleStep step;
  step.views = -sums.views_gradient;
  eliminate_points(diagonal.data(), below.data(), step.views.data());
  if (!cholesky_) cholesky_.emplace(row_begin_, columns_);
  if (!cholesky_->factorise(diagonal, below)) return std::nullopt;
  step.views = cholesky_->solved(step.views);
  if (pattern_.has_border && !solve_border(damping, step)) return std::nullopt;
  if (!step.views.allFinite()) return std::nullopt;
  step_points(step);
  return step;
}

// What the points that are left out change of the views' system.
MAPWEAVE_WIDE_CLONES void BundleEquations::eliminate_points(Matrix6* diagonal, Matrix6* below, double* right) const {
  const std::uint32_t* target = block_of_pair_.data();
  const int* const column_of = pattern_.column_of_sighting.data();
  for (std::size_t point = 0; point < first_free_.size(); ++point)
    for (std::size_t i = first_free_[point]; i < pattern_.first[point + 1]; ++i) {
      const int row = column_of[i];
      if (sums.used[i] == 0) {
        target += i - first_free_[point];
        continue;
      }
      const Matrix63 left = sums.view_by_point[i].lazyProduct(inverse_[point]);
      Eigen::Map<Vector6>(right + 6 * row).noalias() += left.lazyProduct(sums.points_gradient[point]);
      subtract_product<6, 3>(left.data(), sums.view_by_point[i].data(), diagonal[row].data());
      for (std::size_t j = first_free_[point]; j < i; ++j, ++target)
        if (sums.used[j] != 0 && column_of[j] != row)
          subtract_product<6, 3>(left.data(), sums.view_by_point[j].data(), below[*target].data());
    }
}

void BundleEquations::eliminate_points_from_border(Eigen::Matrix2d& corner,
                                                   std::vector<Eigen::Matrix<double, 2, 6>>& border,
                                                   Eigen::Vector2d& right) const {
  for (std::size_t point = 0; point < first_free_.size(); ++point) {
    const Eigen::Matrix<double, 2, 3> left = sums.border_by_point[point] * inverse_[point];
    right.noalias() += left * sums.points_gradient[point];
    corner.noalias() -= left * sums.border_by_point[point].transpose();
    for (std::size_t i = first_free_[point]; i < pattern_.first[point + 1]; ++i)
      if (sums.used[i] != 0)
        border[static_cast<std::size_t>(pattern_.column_of_sighting[i])].noalias() -=
            left * sums.view_by_point[i].transpose();
  }
}

// The views' step as if nothing were shared is known; what the border changes of it.
bool BundleEquations::solve_border(double damping, BundleStep& step) const {
  Eigen::Matrix2d corner = sums.border;
  damp(corner, damping, kLeastOfViews);
  std::vector<Eigen::Matrix<double, 2, 6>> border = sums.border_by_view;
  step.border = -sums.border_gradient;
  eliminate_points_from_border(corner, border, step.border);
  Eigen::Matrix<double, Eigen::Dynamic, 2> by_border(step.views.size(), 2), answer(step.views.size(), 2);
  for (std::size_t i = 0; i < border.size(); ++i)
    by_border.middleRows<6>(6 * static_cast<Eigen::Index>(i)) = border[i].transpose();
  for (int k = 0; k < 2; ++k) answer.col(k) = cholesky_->solved(by_border.col(k));
  corner.noalias() -= by_border.transpose() * answer;
  step.border.noalias() -= by_border.transpose() * step.views;
  step.border = corner.inverse() * step.border.eval();
  step.views.noalias() -= answer * step.border;
  return step.border.allFinite();
}

void BundleEquations::step_points(BundleStep& step) const {
  step.points.resize(first_free_.size());
  for (std::size_t point = 0; point < first_free_.size(); ++point) {
    Eigen::Vector3d sum = sums.points_gradient[point];
    if (pattern_.has_border) sum.noalias() += sums.border_by_point[point].transpose() * step.border;
    for (std::size_t i = first_free_[point]; i < pattern_.first[point + 1]; ++i)
      if (sums.used[i] != 0)
        sum.noalias() += sums.view_by_point[i].transpose() * step.views.segment<6>(6 * pattern_.column_of_sighting[i]);
    step.points[point] = -(inverse_[point] * sum);
  }
}

}  // namespace mapweave::graph
