#include "bundle_equations.h"
#include "levenberg_marquardt.h"

#include <mapweave/core/error.h>
#include <mapweave/graph/bundle_adjustment.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace mapweave::graph {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

double soft_cost(double size, double soft) { return size <= soft ? size * size : soft * (2.0 * size - soft); }

// In sigmas: two of the pixel, one of the inverse depth. False behind the camera.
bool residual_of(const BundleSighting& seen, const Pinhole& camera, const SensorCalibration& calibration,
                 const Vector3d& p, Vector3d& value) {
  if (!(p.z() > kNearestSolved_m)) return false;
  const double z = 1.0 / p.z(), weight = 1.0 / seen.sigma_px;
  value = {weight * (camera.fx * p.x() * z + camera.cx - seen.pixel.x() + calibration.readout_s * seen.row_flow.x()),
           weight * (camera.fy * p.y() * z + camera.cy - seen.pixel.y() + calibration.readout_s * seen.row_flow.y()),
           0.0};
  const double depth_weight = seen.inverse_depth_sigma > 0.0 ? 1.0 / seen.inverse_depth_sigma : 0.0;
  value.z() = depth_weight * (z + calibration.inverse_depth_offset - seen.inverse_depth);
  return true;
}

// What differs from zero of the derivative by the point in the camera's frame.
struct Slope {
  double x, x_z, y, y_z, z;  // of the first, the second and the third residual
};
Slope slope_of(const BundleSighting& seen, const Pinhole& camera, const Vector3d& p) {
  const double z = 1.0 / p.z(), weight = 1.0 / seen.sigma_px;
  const double depth_weight = seen.inverse_depth_sigma > 0.0 ? 1.0 / seen.inverse_depth_sigma : 0.0;
  return {weight * camera.fx * z, -weight * camera.fx * p.x() * z * z, weight * camera.fy * z,
          -weight * camera.fy * p.y() * z * z, -depth_weight * z * z};
}

// How far the views are from what the constraint says, in sigmas; a small motion of `to` in its own frame.
Vector6 error_of(const RelativePoseConstraint& constraint, const View& from, const View& to) {
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
void linearise(const RelativePoseConstraint& constraint, const View& from, const View& to, Matrix6& by_from,
               Matrix6& by_to) {
  const Matrix3d to_from_from = to.rotation * from.rotation.transpose();
  const Vector3d t = to.translation - to_from_from * from.translation;
  Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  by_to.setZero();
  by_to.topLeftCorner<3, 3>() = Matrix3d::Identity() / constraint.sigma_m;
  by_to.topRightCorner<3, 3>() = -cross / constraint.sigma_m;
  by_to.bottomRightCorner<3, 3>() = Matrix3d::Identity() / constraint.sigma_rad;
  by_from.setZero();
  by_from.topLeftCorner<3, 3>() = -to_from_from / constraint.sigma_m;
  by_from.bottomRightCorner<3, 3>() = -to_from_from / constraint.sigma_rad;
}

// Of two numbers: (readout_s, inverse_depth_offset).
Vector2d values_of(const SensorCalibration& calibration) {
  return {calibration.readout_s, calibration.inverse_depth_offset};
}
// Information of the priors on readout and disparity offset: `step` on the change in one adjustment, `own` on the
// value; 0 if not estimated.
struct CalibrationInformation {
  Vector2d step = Vector2d::Zero(), own = Vector2d::Zero();
  explicit CalibrationInformation(const CalibrationPrior& prior) {
    const auto set = [&](int i, double step_sigma, double sigma) {
      if (!(step_sigma > 0.0)) return;
      step[i] = 1.0 / (step_sigma * step_sigma);
      own[i] = sigma > 0.0 ? 1.0 / (sigma * sigma) : 0.0;
    };
    set(0, prior.readout_step_s, prior.readout_s);
    set(1, prior.inverse_depth_step, prior.inverse_depth);
  }
};

// A problem of levenberg_marquardt.h.
class Adjustment {
 public:
  Adjustment(const Bundle& bundle, const BundleOptions& options)
      : bundle_(bundle), options_(options), information_(options.prior), equations_(pattern_of(bundle)) {
    for (const BundleView& view : bundle.views) now_.views.push_back(view.view);
    now_.points = bundle.points;
    now_.calibration = bundle.calibration;
  }

  double cost() const { return cost_of(now_); }

  void linearise() {
    equations_.set_zero();
    for (std::size_t i = 0; i < bundle_.relative_poses.size(); ++i) add(bundle_.relative_poses[i], i);
    Vector3d value;
    for (std::size_t i = 0; i < sightings_.size(); ++i) {
      const BundleSighting& seen = sightings_[i];
      const Vector3d p = now_.views[seen.view] * now_.points[seen.point];
      if (residual_of(seen, camera_of(seen), now_.calibration, p, value)) add(i, p, value);
    }
    if (!learns()) return;
    BundleSums& sums = equations_.sums;
    constexpr double kHeldFast = 1e30;
    for (int i = 0; i < 2; ++i)
      sums.border(i, i) += information_.step[i] > 0.0 ? information_.step[i] + information_.own[i] : kHeldFast;
    const Vector2d here = values_of(now_.calibration);
    sums.border_gradient +=
        information_.step.cwiseProduct(here - values_of(bundle_.calibration)) + information_.own.cwiseProduct(here);
  }

  std::optional<double> try_step(double damping) {
    const std::optional<BundleStep> step = equations_.solved(damping);
    if (!step) return std::nullopt;
    tried_ = now_;
    for (std::size_t i = 0; i < tried_.views.size(); ++i)
      if (column_[i] >= 0) tried_.views[i] = moved(tried_.views[i], step->views.segment<6>(6 * column_[i]));
    for (std::size_t i = 0; i < tried_.points.size(); ++i) tried_.points[i] += step->points[i];
    if (information_.step[0] > 0.0) tried_.calibration.readout_s += step->border[0];
    if (information_.step[1] > 0.0) tried_.calibration.inverse_depth_offset += step->border[1];
    return cost_of(tried_);
  }
  void take_step() { std::swap(now_, tried_); }

  void write_back(Bundle& bundle) const {
    for (std::size_t i = 0; i < now_.views.size(); ++i) bundle.views[i].view = now_.views[i];
    bundle.points = now_.points;
    bundle.calibration = now_.calibration;
    Vector3d value;
    for (BundleSighting& seen : bundle.sightings) {
      const Vector3d p = now_.views[seen.view] * now_.points[seen.point];
      seen.fits = residual_of(seen, camera_of(seen), now_.calibration, p, value) &&
                  value.head<2>().norm() < options_.gate_sigmas &&
                  (!options_.gates_inverse_depth || std::abs(value.z()) < options_.gate_sigmas);
    }
  }

 private:
  struct State {
    std::vector<View> views;
    std::vector<Vector3d> points;
    SensorCalibration calibration;
  };

  // Numbers the views and sorts the sightings.
  BundlePattern pattern_of(const Bundle& bundle) {
    BundlePattern pattern;
    for (const BundleView& view : bundle.views) {
      MAPWEAVE_EXPECT(view.camera < bundle.cameras.size(), "a view names a camera");
      column_.push_back(view.fixed ? -1 : pattern.views++);
    }
    const std::size_t count = bundle.points.size();
    MAPWEAVE_EXPECT(bundle.fixed_points.empty() || bundle.fixed_points.size() == count, "of each point");
    pattern.fixed_points = bundle.fixed_points;
    pattern.has_border = learns();
    pattern.first.resize(count + 1);
    std::size_t next = 0;
    for (std::size_t i = 0; i < bundle.sightings.size(); ++i) {
      const BundleSighting& seen = bundle.sightings[i];
      MAPWEAVE_EXPECT(seen.view < bundle.views.size() && seen.point < count &&
                          (i == 0 || bundle.sightings[i - 1].point <= seen.point),
                      "sightings name views and points, in order");
      while (next <= seen.point) pattern.first[next++] = sightings_.size();
      if (seen.fits) sightings_.push_back(seen);
    }
    while (next <= count) pattern.first[next++] = sightings_.size();
    const auto by_column = [&](const BundleSighting& a, const BundleSighting& b) {
      return column_[a.view] < column_[b.view];
    };
    for (std::size_t point = 0; point < count; ++point) {
      const auto begin = sightings_.begin() + static_cast<std::ptrdiff_t>(pattern.first[point]),
                 end = sightings_.begin() + static_cast<std::ptrdiff_t>(pattern.first[point + 1]);
      for (auto next_one = begin; next_one != end; ++next_one)  // few
        std::rotate(std::upper_bound(begin, next_one, *next_one, by_column), next_one, next_one + 1);
    }
    for (const BundleSighting& seen : sightings_) pattern.column_of_sighting.push_back(column_[seen.view]);
    for (const RelativePoseConstraint& constraint : bundle.relative_poses) {
      MAPWEAVE_EXPECT(constraint.from < bundle.views.size() && constraint.to < bundle.views.size() &&
                          constraint.from != constraint.to && constraint.sigma_m > 0.0 && constraint.sigma_rad > 0.0,
                      "a constraint names two views");
      pattern.view_pairs.emplace_back(column_[constraint.from], column_[constraint.to]);
    }
    return pattern;
  }

  bool learns() const { return information_.step.maxCoeff() > 0.0; }
  const Pinhole& camera_of(const BundleSighting& seen) const {
    return bundle_.cameras[bundle_.views[seen.view].camera];
  }

  double cost_of(const State& state) const {
    double sum = 0.0;
    Vector3d value;
    const double soft = options_.soft_sigmas;
    for (const BundleSighting& seen : sightings_) {
      const Vector3d p = state.views[seen.view] * state.points[seen.point];
      if (!residual_of(seen, camera_of(seen), state.calibration, p, value))
        sum += 100.0 * soft * soft;
      else
        sum += soft_cost(value.head<2>().norm(), soft) + soft_cost(std::abs(value.z()), soft);
    }
    for (const RelativePoseConstraint& constraint : bundle_.relative_poses)
      sum += error_of(constraint, state.views[constraint.from], state.views[constraint.to]).squaredNorm();
    const Vector2d here = values_of(state.calibration);
    return sum + information_.step.dot((here - values_of(bundle_.calibration)).cwiseAbs2()) +
           information_.own.dot(here.cwiseAbs2());
  }

  void add(const RelativePoseConstraint& constraint, std::size_t number) {
    const View &from = now_.views[constraint.from], &to = now_.views[constraint.to];
    const Vector6 error = error_of(constraint, from, to);
    Matrix6 by_from, by_to;
    graph::linearise(constraint, from, to, by_from, by_to);
    BundleSums& sums = equations_.sums;
    const auto add_view = [&](int column, const Matrix6& by) {
      if (column < 0) return;
      sums.views[static_cast<std::size_t>(column)].noalias() += by.transpose() * by;
      sums.views_gradient.segment<6>(6 * column).noalias() += by.transpose() * error;
    };
    add_view(column_[constraint.from], by_from);
    add_view(column_[constraint.to], by_to);
    const bool from_is_row = column_[constraint.from] > column_[constraint.to];
    sums.view_by_view[number] =
        from_is_row ? Matrix6(by_from.transpose() * by_to) : Matrix6(by_to.transpose() * by_from);
  }

  Vector3d weights_of(const Vector3d& value) const {
    const double pixels = value.head<2>().norm(), depth = std::abs(value.z()), soft = options_.soft_sigmas;
    const double w = pixels > soft ? soft / pixels : 1.0;
    return {w, w, depth > soft ? soft / depth : 1.0};
  }

  // How well the point is known in the camera's frame; a small motion (t, w) of the camera moves it by t + w x p.
  // Element by element: of the derivative by the point half is zero.
  void add(std::size_t number, const Vector3d& p, const Vector3d& value) {
    const BundleSighting& seen = sightings_[number];
    BundleSums& sums = equations_.sums;
    sums.used[number] = 1;
    const Slope by = slope_of(seen, camera_of(seen), p);
    const Vector3d weights = weights_of(value), weighted = weights.cwiseProduct(value);
    const Vector3d slope(by.x * weighted.x(), by.y * weighted.y(),
                         by.x_z * weighted.x() + by.y_z * weighted.y() + by.z * weighted.z());
    const double xx = weights.x() * by.x * by.x, xz = weights.x() * by.x * by.x_z, yy = weights.y() * by.y * by.y,
                 yz = weights.y() * by.y * by.y_z,
                 zz = weights.x() * by.x_z * by.x_z + weights.y() * by.y_z * by.y_z + weights.z() * by.z * by.z;
    const Matrix3d& rotation = now_.views[seen.view].rotation;
    Matrix3d& of_point = sums.points[seen.point];
    const int c = column_[seen.view];
#pragma GCC unroll 3
    for (int k = 0; k < 3; ++k) {
      const Vector3d axis = rotation.col(k);
      const Vector3d known(xx * axis.x() + xz * axis.z(), yy * axis.y() + yz * axis.z(),
                           xz * axis.x() + yz * axis.y() + zz * axis.z());
      of_point(0, k) += rotation.col(0).dot(known);
      of_point(1, k) += rotation.col(1).dot(known);
      of_point(2, k) += rotation.col(2).dot(known);
      sums.points_gradient[seen.point](k) += axis.dot(slope);
      if (c < 0) continue;
      sums.view_by_point[number].col(k).head<3>() = known;
      sums.view_by_point[number].col(k).tail<3>() = p.cross(known);
    }
    if (learns()) add_border(seen, by, p, value, weights);
    if (c < 0) return;
    const Vector3d first(p.y() * xz, p.z() * xx - p.x() * xz, -p.y() * xx),
        second(p.y() * yz - p.z() * yy, -p.x() * yz, p.x() * yy),
        third(p.y() * zz - p.z() * yz, p.z() * xz - p.x() * zz, p.x() * yz - p.y() * xz);
    Matrix6& hessian = sums.views[static_cast<std::size_t>(c)];
    hessian(0, 0) += xx;
    hessian(1, 1) += yy;
    hessian(2, 0) += xz;
    hessian(2, 1) += yz;
    hessian(2, 2) += zz;
#pragma GCC unroll 3
    for (int k = 0; k < 3; ++k) {
      const Vector3d turned(first(k), second(k), third(k)), of_turns = p.cross(turned);
      hessian(3 + k, 0) += turned.x();
      hessian(3 + k, 1) += turned.y();
      hessian(3 + k, 2) += turned.z();
      for (int row = k; row < 3; ++row) hessian(3 + row, 3 + k) += of_turns(row);
    }
    sums.views_gradient.segment<3>(6 * c) += slope;
    sums.views_gradient.segment<3>(6 * c + 3) += p.cross(slope);
  }

  // The readout moves the pixel by its flow, the offset the inverse depth.
  void add_border(const BundleSighting& seen, const Slope& by, const Vector3d& p, const Vector3d& value,
                  const Vector3d& weights) {
    BundleSums& sums = equations_.sums;
    const Vector2d flow = seen.row_flow / seen.sigma_px, weighted = weights.head<2>().cwiseProduct(flow);
    const double offset = seen.inverse_depth_sigma > 0.0 ? 1.0 / seen.inverse_depth_sigma : 0.0;
    sums.border(0, 0) += weighted.dot(flow);
    sums.border(1, 1) += weights.z() * offset * offset;
    sums.border_gradient += Vector2d(weighted.dot(value.head<2>()), weights.z() * offset * value.z());
    const std::array<Vector3d, 2> by_p{
        Vector3d(by.x * weighted.x(), by.y * weighted.y(), by.x_z * weighted.x() + by.y_z * weighted.y()),
        Vector3d(0.0, 0.0, by.z * weights.z() * offset)};
    const int c = column_[seen.view];
    for (int k = 0; k < 2; ++k) {
      const Vector3d& of = by_p[static_cast<std::size_t>(k)];
      sums.border_by_point[seen.point].row(k) += of.transpose() * now_.views[seen.view].rotation;
      if (c < 0) continue;
      sums.border_by_view[static_cast<std::size_t>(c)].row(k).head<3>() += of;
      sums.border_by_view[static_cast<std::size_t>(c)].row(k).tail<3>() += p.cross(of);
    }
  }

  const Bundle& bundle_;
  BundleOptions options_;
  CalibrationInformation information_;
  std::vector<BundleSighting> sightings_;  // that fit; by point, then column
  std::vector<int> column_;                // of each view; -1: fixed
  State now_, tried_;
  BundleEquations equations_;
};

}  // namespace

BundleReport adjust(Bundle& bundle, const BundleOptions& options) {
  Damping damping;
  damping.easier = 0.2;
  damping.harder = 8.0;
  damping.least = 1e-8;
  damping.most = 1e6;
  Adjustment adjustment(bundle, options);
  const Descent descent = descend(adjustment, options.iterations, options.least_gain, damping);
  adjustment.write_back(bundle);
  return {descent.cost_before, descent.cost, descent.iterations};
}

}  // namespace mapweave::graph
