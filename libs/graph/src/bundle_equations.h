#pragma once
// The normal equations of a bundle: six numbers of each free view, three of each point, and two that all views share
// (the border). Points are eliminated, then views, then the border is solved.

#include <mapweave/graph/block_cholesky.h>

#include <optional>
#include <utility>

namespace mapweave::graph {

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix63 = Eigen::Matrix<double, 6, 3>;

// Which numbers meet. A free view's number is its column; that of a fixed one is negative.
struct BundlePattern {
  int views = 0;                        // free ones
  std::vector<std::size_t> first;       // sighting of each point, and the end
  std::vector<int> column_of_sighting;  // rising among those of a point
  std::vector<char> fixed_points;       // of each point; empty: none is
  // Columns of the two views of each relative-pose constraint; negative where one is fixed.
  std::vector<std::pair<int, int>> view_pairs;
  bool has_border = false;
};

// J^T J of each part, and J^T r.
struct BundleSums {
  std::vector<Matrix6> views;  // lower triangles
  Eigen::VectorXd views_gradient;
  std::vector<Eigen::Matrix3d> points;
  std::vector<Eigen::Vector3d> points_gradient;
  std::vector<Matrix63> view_by_point;  // of each sighting
  std::vector<char> used;               // of each sighting
  std::vector<Matrix6> view_by_view;    // of each view pair, the view of the higher column by the other
  Eigen::Matrix2d border;
  Eigen::Vector2d border_gradient;
  std::vector<Eigen::Matrix<double, 2, 6>> border_by_view;
  std::vector<Eigen::Matrix<double, 2, 3>> border_by_point;
};

struct BundleStep {
  Eigen::VectorXd views;
  std::vector<Eigen::Vector3d> points;
  Eigen::Vector2d border = Eigen::Vector2d::Zero();
};

class BundleEquations {
 public:
  explicit BundleEquations(BundlePattern pattern);

  const BundlePattern& pattern() const { return pattern_; }
  void set_zero();
  BundleSums sums;
  // nullopt where the sums are not those of a minimum.
  std::optional<BundleStep> solved(double damping);

 private:
  void find_blocks();
  std::size_t block(int row, int column) const;
  void eliminate_points(Matrix6* diagonal, Matrix6* below, double* right) const;
  void eliminate_points_from_border(Eigen::Matrix2d& corner, std::vector<Eigen::Matrix<double, 2, 6>>& border,
                                    Eigen::Vector2d& right) const;
  bool solve_border(double damping, BundleStep& step) const;
  void step_points(BundleStep& step) const;

  BundlePattern pattern_;
  std::vector<std::size_t> first_free_;  // sighting of each point by a view that is not fixed
  // Blocks below the diagonal, by row, then column: of free views that see a common point or are a view pair.
  std::vector<std::size_t> row_begin_;
  std::vector<std::int32_t> columns_;
  std::vector<std::uint32_t> block_of_pair_;  // of two sightings of one point, in order
  std::vector<Eigen::Matrix3d> inverse_;      // of each point
  std::optional<BlockCholesky<6>> cholesky_;
};

}  // namespace mapweave::graph
