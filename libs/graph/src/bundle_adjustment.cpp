#include "block_kernels.h"

#include <mapweave/core/error.h>
#include <mapweave/core/processor_clones.h>
#include <mapweave/graph/block_cholesky.h>
#include <mapweave/graph/bundle_adjustment.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <optional>

namespace mapweave::graph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Matrix63 = Eigen::Matrix<double, 6, 3>;

constexpr double kNearest_m = 0.02;

struct View {  // camera_from_map
  Matrix3d rotation;
  Vector3d translation;
};

View view_of(const Pose3& map_from_camera) {
  const Matrix3d rotation = map_from_camera.q.conjugate().toRotationMatrix();
  return {rotation, -(rotation * map_from_camera.t)};
}

// exp of a small motion (translation, rotation vector) in the camera's frame, from the left.
View moved(const View& view, const Vector6& motion) {
  const Vector3d turn = motion.tail<3>();
  const double angle = turn.norm();
  const Matrix3d rotation =
      angle < 1e-12 ? Matrix3d::Identity() : Eigen::AngleAxisd(angle, turn / angle).toRotationMatrix();
  return {Eigen::Quaterniond(rotation * view.rotation).normalized().toRotationMatrix(),
          rotation * view.translation + motion.head<3>()};
}

double soft_cost(double size, double soft) { return size <= soft ? size * size : soft * (2.0 * size - soft); }

// In sigmas: two of the pixel, one of the inverse depth. False behind the camera.
bool residual_of(const BundleSighting& seen, const Pinhole& camera, const Vector3d& p, Vector3d& value,
                 Matrix3d* by_point) {
  if (!(p.z() > kNearest_m)) return false;
  const double z = 1.0 / p.z(), weight = 1.0 / seen.sigma_px;
  value = {weight * (camera.fx * p.x() * z + camera.cx - seen.pixel.x()),
           weight * (camera.fy * p.y() * z + camera.cy - seen.pixel.y()), 0.0};
  const double depth_weight = seen.inverse_depth_sigma > 0.0 ? 1.0 / seen.inverse_depth_sigma : 0.0;
  value.z() = depth_weight * (z - seen.inverse_depth);
  if (by_point != nullptr)
    *by_point << weight * camera.fx * z, 0, -weight * camera.fx * p.x() * z * z, 0, weight * camera.fy * z,
        -weight * camera.fy * p.y() * z * z, 0, 0, -depth_weight * z * z;
  return true;
}

class Adjustment {
 public:
  Adjustment(Bundle& bundle, const BundleOptions& options)
      : bundle_(bundle), options_(options), points_(bundle.points) {
    for (const BundleView& view : bundle.views) {
      MAPWEAVE_EXPECT(view.camera < bundle.cameras.size(), "a view names a camera");
      column_.push_back(view.fixed ? -1 : free_++);
      views_.push_back(view_of(view.map_from_camera));
    }
    first_.resize(bundle.points.size() + 1);
    std::size_t next = 0;
    for (std::size_t i = 0; i < bundle.sightings.size(); ++i) {
      const BundleSighting& seen = bundle.sightings[i];
      MAPWEAVE_EXPECT(seen.view < bundle.views.size() && seen.point < bundle.points.size() &&
                          (i == 0 || bundle.sightings[i - 1].point <= seen.point),
                      "sightings name views and points, in order");
      while (next <= seen.point) first_[next++] = sightings_.size();
      if (seen.fits) sightings_.push_back(seen);
    }
    while (next < first_.size()) first_[next++] = sightings_.size();
    const auto by_column = [&](const BundleSighting& a, const BundleSighting& b) {
      return column_[a.view] < column_[b.view];
    };
    for (std::size_t point = 0; point < points_.size(); ++point) {
      const auto begin = sightings_.begin() + static_cast<std::ptrdiff_t>(first_[point]),
                 end = sightings_.begin() + static_cast<std::ptrdiff_t>(first_[point + 1]);
      for (auto next_one = begin; next_one != end; ++next_one)  // few
        std::rotate(std::upper_bound(begin, next_one, *next_one, by_column), next_one, next_one + 1);
    }
    for (const BundleSighting& seen : sightings_) column_of_sighting_.push_back(column_[seen.view]);
    for (std::size_t point = 0; point < points_.size(); ++point) {
      first_free_.push_back(first_[point]);
      while (first_free_[point] < first_[point + 1] && column_of_sighting_[first_free_[point]] < 0)
        ++first_free_[point];
    }
    for (const RelativePoseConstraint& constraint : bundle.relative_poses)
      MAPWEAVE_EXPECT(constraint.from < bundle.views.size() && constraint.to < bundle.views.size() &&
                          constraint.from != constraint.to && constraint.sigma_m > 0.0 && constraint.sigma_rad > 0.0,
                      "a constraint names two views");
    find_blocks();
  }

  BundleReport run() {
    BundleReport report;
    double cost = cost_of(views_, points_), lambda = 1e-4;
    report.cost_before = cost;
    bool build = true;
    for (; report.iterations < options_.iterations && free_ > 0; ++report.iterations) {
      if (build) linearise();
      Eigen::VectorXd change;
      if (!solve(lambda, change)) break;
      std::vector<View> views = views_;
      for (std::size_t i = 0; i < views.size(); ++i)
        if (column_[i] >= 0) views[i] = moved(views[i], change.segment<6>(6 * column_[i]));
      std::vector<Vector3d> points = points_;
      for (std::size_t point = 0; point < points.size(); ++point) {
        Vector3d sum = gradient_of_point_[point];
        for (std::size_t i = first_free_[point]; i < first_[point + 1]; ++i)
          if (used_[i] != 0) sum.noalias() += cross_[i].transpose() * change.segment<6>(6 * column_of_sighting_[i]);
        points[point] -= inverse_[point] * sum;
      }
      const double now = cost_of(views, points);
      build = now < cost;
      if (build) {
        const bool done = cost - now < options_.least_gain * cost;
        views_ = std::move(views), points_ = std::move(points), cost = now;
        lambda = std::max(1e-8, 0.2 * lambda);
        if (done) break;
      } else {
        lambda *= 8.0;
        if (lambda > 1e6) break;
      }
    }
    report.cost_after = cost;
    write_back();
    return report;
  }

 private:
  // Blocks below the diagonal, by row, then column: of free views that see a common point.
  void find_blocks() {
    const auto rows = static_cast<std::size_t>(free_);
    constexpr std::size_t kBits = 64;
    const std::size_t words = (rows + kBits - 1) / kBits;  // of a row: a bit for each column
    std::vector<std::uint64_t> pattern(rows * words, 0);
    const auto meet = [&](int row, int column) {
      const auto bit = static_cast<std::size_t>(column);
      pattern[static_cast<std::size_t>(row) * words + bit / kBits] |= std::uint64_t{1} << (bit % kBits);
    };
    for (std::size_t point = 0; point < points_.size(); ++point)
      for (std::size_t i = first_free_[point]; i < first_[point + 1]; ++i)
        for (std::size_t j = first_free_[point]; j < i; ++j) meet(column_of_sighting_[i], column_of_sighting_[j]);
    for (const RelativePoseConstraint& constraint : bundle_.relative_poses)
      if (const auto [column, row] = std::minmax(column_[constraint.from], column_[constraint.to]); column >= 0)
        meet(row, column);
    for (std::size_t row = 0; row < rows; ++row) {
      row_begin_.push_back(columns_.size());
      for (std::size_t column = 0; column < row; ++column) {
        const std::uint64_t left = pattern[row * words + column / kBits] >> (column % kBits);
        if (left == 0) column |= kBits - 1;
        if ((left & 1) != 0) columns_.push_back(static_cast<std::int32_t>(column));
      }
    }
    row_begin_.push_back(columns_.size());
    for (std::size_t point = 0; point < points_.size(); ++point)
      for (std::size_t i = first_free_[point]; i < first_[point + 1]; ++i) {
        const auto row = static_cast<std::size_t>(column_of_sighting_[i]);
        const auto end = columns_.begin() + static_cast<std::ptrdiff_t>(row_begin_[row + 1]);
        auto place = columns_.begin() + static_cast<std::ptrdiff_t>(row_begin_[row]);
        for (std::size_t j = first_free_[point]; j < i; ++j) {
          place = std::lower_bound(place, end, column_of_sighting_[j]);
          block_of_pair_.push_back(static_cast<std::uint32_t>(place - columns_.begin()));
        }
      }
  }
  std::size_t block(int row, int column) const {
    const auto begin = columns_.begin() + static_cast<std::ptrdiff_t>(row_begin_[static_cast<std::size_t>(row)]),
               end = columns_.begin() + static_cast<std::ptrdiff_t>(row_begin_[static_cast<std::size_t>(row) + 1]);
    return static_cast<std::size_t>(std::lower_bound(begin, end, column) - columns_.begin());
  }

  Vector3d weights_of(const Vector3d& value) const {
    const double pixels = value.head<2>().norm(), depth = std::abs(value.z()), soft = options_.soft_sigmas;
    const double w = pixels > soft ? soft / pixels : 1.0;
    return {w, w, depth > soft ? soft / depth : 1.0};
  }

  double cost_of(const std::vector<View>& views, const std::vector<Vector3d>& points) const {
    double sum = 0.0;
    Vector3d value;
    for (const BundleSighting& seen : sightings_) {
      const View& view = views[seen.view];
      const Vector3d p = view.rotation * points[seen.point] + view.translation;
      if (!residual_of(seen, bundle_.cameras[bundle_.views[seen.view].camera], p, value, nullptr))
        sum += 100.0 * options_.soft_sigmas * options_.soft_sigmas;
      else
        sum += soft_cost(value.head<2>().norm(), options_.soft_sigmas) +
               soft_cost(std::abs(value.z()), options_.soft_sigmas);
    }
    for (const RelativePoseConstraint& constraint : bundle_.relative_poses)
      sum += error_of(constraint, views).squaredNorm();
    return sum;
  }

  // How far the views are from what the tie says, in sigmas; a small motion of `to` in its own frame.
  static Vector6 error_of(const RelativePoseConstraint& constraint, const std::vector<View>& views) {
    const View &from = views[constraint.from], &to = views[constraint.to];
    const Matrix3d measured = constraint.from_from_to.q.conjugate().toRotationMatrix();  // to_from_from
    const Matrix3d to_from_from = to.rotation * from.rotation.transpose();
    const Vector3d from_in_to = to.translation - to_from_from * from.translation;
    const Eigen::AngleAxisd turn(Matrix3d(to_from_from * measured.transpose()));
    const Vector3d expected = -(measured * constraint.from_from_to.t);
    Vector6 error;
    error << (from_in_to - expected) / constraint.sigma_m, turn.angle() * turn.axis() / constraint.sigma_rad;
    return error;
  }

  // Derivatives by small motions of the two cameras in their own frames, from the left, for small errors.
  void linearise(const RelativePoseConstraint& constraint, std::size_t number) {
    const Vector6 error = error_of(constraint, views_);
    const Matrix3d to_from_from = views_[constraint.to].rotation * views_[constraint.from].rotation.transpose();
    const Vector3d t = views_[constraint.to].translation - to_from_from * views_[constraint.from].translation;
    Matrix3d cross;
    cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
    Matrix6 by_to = Matrix6::Zero(), by_from = Matrix6::Zero();
    by_to.topLeftCorner<3, 3>() = Matrix3d::Identity() / constraint.sigma_m;
    by_to.topRightCorner<3, 3>() = -cross / constraint.sigma_m;
    by_to.bottomRightCorner<3, 3>() = Matrix3d::Identity() / constraint.sigma_rad;
    by_from.topLeftCorner<3, 3>() = -to_from_from / constraint.sigma_m;
    by_from.bottomRightCorner<3, 3>() = -to_from_from / constraint.sigma_rad;
    const auto add = [&](std::uint32_t view, const Matrix6& by) {
      if (const int c = column_[view]; c >= 0) {
        hessian_of_view_[static_cast<std::size_t>(c)].noalias() += by.transpose() * by;
        gradient_of_view_.segment<6>(6 * c).noalias() += by.transpose() * error;
      }
    };
    add(constraint.from, by_from), add(constraint.to, by_to);
    const bool from_is_row = column_[constraint.from] > column_[constraint.to];
    cross_of_constraint_[number] =
        from_is_row ? Matrix6(by_from.transpose() * by_to) : Matrix6(by_to.transpose() * by_from);
  }

  void linearise() {
    hessian_of_view_.assign(static_cast<std::size_t>(free_), Matrix6::Zero());
    gradient_of_view_ = Eigen::VectorXd::Zero(6 * free_);
    hessian_of_point_.assign(points_.size(), Matrix3d::Zero());
    gradient_of_point_.assign(points_.size(), Vector3d::Zero());
    cross_.resize(sightings_.size());
    used_.assign(sightings_.size(), 0);
    cross_of_constraint_.resize(bundle_.relative_poses.size());
    for (std::size_t i = 0; i < bundle_.relative_poses.size(); ++i) linearise(bundle_.relative_poses[i], i);
    Vector3d value;
    Matrix3d by_point = Matrix3d::Zero();  // in the camera's frame
    for (std::size_t i = 0; i < sightings_.size(); ++i) {
      const BundleSighting& seen = sightings_[i];
      const View& view = views_[seen.view];
      const Vector3d p = view.rotation * points_[seen.point] + view.translation;
      if (!residual_of(seen, bundle_.cameras[bundle_.views[seen.view].camera], p, value, &by_point)) continue;
      used_[i] = 1;
      // How well the point is known in the camera's frame; a small motion (t, w) of the camera moves it by t + w x p.
      // Element by element: of `by_point` the half is zero.
      const Vector3d weights = weights_of(value), slope = by_point.transpose() * weights.cwiseProduct(value);
      const double x = by_point(0, 0), x_z = by_point(0, 2), y = by_point(1, 1), y_z = by_point(1, 2),
                   z = by_point(2, 2);
      const double xx = weights.x() * x * x, xz = weights.x() * x * x_z, yy = weights.y() * y * y,
                   yz = weights.y() * y * y_z,
                   zz = weights.x() * x_z * x_z + weights.y() * y_z * y_z + weights.z() * z * z;
      const Matrix3d& rotation = view.rotation;
      Matrix3d& of_point = hessian_of_point_[seen.point];
      const int c = column_of_sighting_[i];
#pragma GCC unroll 3
      for (int k = 0; k < 3; ++k) {
        const Vector3d axis = rotation.col(k);
        const Vector3d known(xx * axis.x() + xz * axis.z(), yy * axis.y() + yz * axis.z(),
                             xz * axis.x() + yz * axis.y() + zz * axis.z());
        of_point(0, k) += rotation.col(0).dot(known), of_point(1, k) += rotation.col(1).dot(known);
        of_point(2, k) += rotation.col(2).dot(known);
        gradient_of_point_[seen.point](k) += axis.dot(slope);
        if (c >= 0) cross_[i].col(k).head<3>() = known, cross_[i].col(k).tail<3>() = p.cross(known);
      }
      if (c < 0) continue;
      const Vector3d first(p.y() * xz, p.z() * xx - p.x() * xz, -p.y() * xx),
          second(p.y() * yz - p.z() * yy, -p.x() * yz, p.x() * yy),
          third(p.y() * zz - p.z() * yz, p.z() * xz - p.x() * zz, p.x() * yz - p.y() * xz);
      Matrix6& hessian = hessian_of_view_[static_cast<std::size_t>(c)];  // the lower triangle
      hessian(0, 0) += xx, hessian(1, 1) += yy, hessian(2, 0) += xz, hessian(2, 1) += yz, hessian(2, 2) += zz;
#pragma GCC unroll 3
      for (int k = 0; k < 3; ++k) {
        const Vector3d turned(first(k), second(k), third(k)), of_turns = p.cross(turned);
        hessian(3 + k, 0) += turned.x(), hessian(3 + k, 1) += turned.y(), hessian(3 + k, 2) += turned.z();
        for (int row = k; row < 3; ++row) hessian(3 + row, 3 + k) += of_turns(row);
      }
      gradient_of_view_.segment<3>(6 * c) += slope, gradient_of_view_.segment<3>(6 * c + 3) += p.cross(slope);
    }
  }

  bool solve(double lambda, Eigen::VectorXd& change) {
    std::vector<Matrix6> diagonal = hessian_of_view_, below(columns_.size(), Matrix6::Zero());
    for (Matrix6& m : diagonal) {
      m.diagonal() *= 1.0 + lambda;
      m.diagonal().array() += 1e-9;
    }
    for (std::size_t i = 0; i < bundle_.relative_poses.size(); ++i) {
      const int one = column_[bundle_.relative_poses[i].from], other = column_[bundle_.relative_poses[i].to];
      if (one >= 0 && other >= 0) below[block(std::max(one, other), std::min(one, other))] += cross_of_constraint_[i];
    }
    inverse_.resize(points_.size());
    for (std::size_t point = 0; point < points_.size(); ++point) {
      Matrix3d damped = hessian_of_point_[point];
      damped.diagonal() *= 1.0 + lambda;
      damped.diagonal().array() += 1e-6;
      inverse_[point] = damped.inverse();
    }
    Eigen::VectorXd right = -gradient_of_view_;
    eliminate_points(diagonal.data(), below.data(), right.data());
    if (!cholesky_) cholesky_.emplace(row_begin_, columns_);
    if (!cholesky_->factorise(diagonal, below)) return false;
    change = cholesky_->solved(right);
    return change.allFinite();
  }

  // What the points that are left out change of the views' system.
  MAPWEAVE_WIDE_CLONES void eliminate_points(Matrix6* diagonal, Matrix6* below, double* right) const {
    const std::uint32_t* target = block_of_pair_.data();
    for (std::size_t point = 0; point < points_.size(); ++point)
      for (std::size_t i = first_free_[point]; i < first_[point + 1]; ++i) {
        const int row = column_of_sighting_[i];
        if (used_[i] == 0) {
          target += i - first_free_[point];
          continue;
        }
        const Matrix63 left = cross_[i].lazyProduct(inverse_[point]);
        Eigen::Map<Vector6>(right + 6 * row).noalias() += left.lazyProduct(gradient_of_point_[point]);
        subtract_product<6, 3>(left.data(), cross_[i].data(), diagonal[row].data());
        for (std::size_t j = first_free_[point]; j < i; ++j, ++target)
          if (used_[j] != 0 && column_of_sighting_[j] != row)
            subtract_product<6, 3>(left.data(), cross_[j].data(), below[*target].data());
      }
  }

  void write_back() {
    for (std::size_t i = 0; i < views_.size(); ++i)
      if (column_[i] >= 0)
        bundle_.views[i].map_from_camera = {-(views_[i].rotation.transpose() * views_[i].translation),
                                            Eigen::Quaterniond(views_[i].rotation.transpose()).normalized()};
    Vector3d value;
    for (BundleSighting& seen : bundle_.sightings) {
      const View& view = views_[seen.view];
      seen.fits = residual_of(seen, bundle_.cameras[bundle_.views[seen.view].camera],
                              view.rotation * points_[seen.point] + view.translation, value, nullptr) &&
                  value.head<2>().norm() < options_.gate_sigmas && std::abs(value.z()) < options_.gate_sigmas;
    }
    bundle_.points = points_;
  }

  Bundle& bundle_;
  BundleOptions options_;
  std::vector<View> views_;
  std::vector<Vector3d> points_;
  std::vector<BundleSighting> sightings_;         // that fit; by point, then column
  std::vector<int> column_, column_of_sighting_;  // of each view, and of the view of each sighting; -1: fixed
  int free_ = 0;
  std::vector<std::size_t> first_;       // sighting of each point, and the end
  std::vector<std::size_t> first_free_;  // of a view that is not fixed
  std::vector<std::size_t> row_begin_;
  std::vector<std::int32_t> columns_;
  std::vector<std::uint32_t> block_of_pair_;  // of two sightings of one point, in order
  std::vector<Matrix6> hessian_of_view_;
  Eigen::VectorXd gradient_of_view_;
  std::vector<Matrix3d> hessian_of_point_, inverse_;
  std::vector<Vector3d> gradient_of_point_;
  std::vector<Matrix63> cross_;               // of each sighting
  std::vector<Matrix6> cross_of_constraint_;  // the view of the higher column by the other
  std::vector<char> used_;
  std::optional<BlockCholesky<6>> cholesky_;
};

}  // namespace

BundleReport adjust(Bundle& bundle, const BundleOptions& options) { return Adjustment(bundle, options).run(); }

}  // namespace mapweave::graph
