#include "bundle.h"

#include "reduced_system.h"

#include <mapweave/core/error.h>

#include <Eigen/LU>
#include <algorithm>

namespace mapweave::visual {
namespace {

using Matrix63 = Eigen::Matrix<double, 6, 3>;

double soft_cost(double size, double soft) { return size <= soft ? size * size : soft * (2.0 * size - soft); }

using Vector2 = Eigen::Vector2d;

Vector2 values_of(const SensorCalibration& calibration) {
  return {calibration.readout_s, calibration.inverse_depth_offset};
}

// Information of the priors: of a step, and of being there at all.
Vector2 information_of(double readout, double inverse_depth) {
  return {readout > 0 ? 1.0 / (readout * readout) : 0.0,
          inverse_depth > 0 ? 1.0 / (inverse_depth * inverse_depth) : 0.0};
}

double cost_of(const WindowBundle& bundle, const SensorCalibration& calibration, const std::vector<View>& views,
               const std::vector<Eigen::Vector3d>& points, const Pinhole& camera, const WindowBundleOptions& options) {
  double sum = 0;
  for (const WindowBundleObservation& o : bundle.observations) {
    if (!o.fits) continue;
    const Eigen::Vector3d p = views[static_cast<std::size_t>(o.view)] * points[static_cast<std::size_t>(o.point)];
    if (!(p.z() > 0.02)) {
      sum += 100.0 * options.soft_sigmas * options.soft_sigmas;
      continue;
    }
    sum += soft_cost((camera.project(p) - o.sighting.pixel + calibration.readout_s * o.sighting.row_flow).norm() /
                         o.sighting.sigma_px,
                     options.soft_sigmas);
    if (o.sighting.inverse_depth_sigma > 0)
      sum += soft_cost(std::abs(1.0 / p.z() + calibration.inverse_depth_offset - o.sighting.inverse_depth) /
                           o.sighting.inverse_depth_sigma,
                       options.soft_sigmas);
  }
  return sum;
}

// Of free views that see a common point.
std::vector<std::pair<int, int>> pairs_of(const WindowBundle& bundle, const std::vector<int>& column) {
  std::vector<std::vector<int>> columns(bundle.views.size());
  for (std::size_t first = 0, last = 0; first < bundle.observations.size(); first = last) {
    while (last < bundle.observations.size() && bundle.observations[last].point == bundle.observations[first].point)
      ++last;
    for (std::size_t i = first; i < last; ++i)
      for (std::size_t j = first; j < last; ++j) {
        const int row = column[static_cast<std::size_t>(bundle.observations[i].view)],
                  other = column[static_cast<std::size_t>(bundle.observations[j].view)];
        if (other >= 0 && row > other) columns[static_cast<std::size_t>(row)].push_back(other);
      }
  }
  std::vector<std::pair<int, int>> pairs;
  for (std::size_t row = 0; row < columns.size(); ++row) {
    std::sort(columns[row].begin(), columns[row].end());
    columns[row].erase(std::unique(columns[row].begin(), columns[row].end()), columns[row].end());
    for (int other : columns[row]) pairs.emplace_back(static_cast<int>(row), other);
  }
  return pairs;
}

}  // namespace

void adjust(WindowBundle& bundle, const Pinhole& camera, const WindowBundleOptions& options) {
  std::vector<int> column(bundle.views.size(), -1);
  int free_views = 0;
  for (std::size_t i = 0; i < bundle.views.size(); ++i)
    if (!bundle.fixed[i]) column[i] = free_views++;
  const Eigen::Index calibration_at = 6 * free_views, size = calibration_at + 2;
  const Vector2 before = values_of(bundle.calibration),
                step_information = information_of(options.prior.readout_step_s, options.prior.inverse_depth_step),
                own_information = information_of(options.prior.readout_s, options.prior.inverse_depth);
  const auto prior_cost = [&](const SensorCalibration& calibration) {
    const Vector2 now = values_of(calibration);
    return step_information.dot((now - before).cwiseAbs2()) + own_information.dot(now.cwiseAbs2());
  };

  double lambda = 1e-4;
  double cost = cost_of(bundle, bundle.calibration, bundle.views, bundle.points, camera, options) +
                prior_cost(bundle.calibration);
  const std::size_t count = bundle.points.size();
  struct Link {
    int column;
    Matrix63 cross;
  };
  std::vector<Link> links;
  std::vector<std::size_t> first_link(count + 1);
  std::vector<Eigen::Matrix3d> point_hessian(count);
  std::vector<Eigen::Vector3d> point_gradient(count);
  std::vector<Eigen::Matrix<double, 2, 3>> calibration_by_point(count);
  const auto free = static_cast<std::size_t>(free_views);
  std::vector<ReducedSystem::Block> view_hessian(free);
  std::vector<ReducedSystem::Border> view_border(free);
  Eigen::Matrix2d calibration_hessian;
  ReducedSystem reduced(
      free_views, ReducedSystem::is_sparse(free_views) ? pairs_of(bundle, column) : std::vector<std::pair<int, int>>());
  Eigen::VectorXd views_gradient(size), right(size);
  Residual r;
  bool build = true;
  for (int step = 0; step < options.most_steps; ++step) {
    if (build) {
      links.clear();
      std::fill(view_hessian.begin(), view_hessian.end(), ReducedSystem::Block::Zero());
      std::fill(view_border.begin(), view_border.end(), ReducedSystem::Border::Zero());
      calibration_hessian.setZero(), views_gradient.setZero();
      for (int i = 0; i < 2; ++i) {
        // What is not learnt is held fast.
        calibration_hessian(i, i) = step_information[i] > 0 ? step_information[i] + own_information[i] : 1e30;
        const Vector2 now = values_of(bundle.calibration);
        views_gradient[calibration_at + i] =
            step_information[i] > 0 ? step_information[i] * (now[i] - before[i]) + own_information[i] * now[i] : 0.0;
      }
      std::size_t o = 0;
      for (std::size_t point = 0; point < count; ++point) {
        first_link[point] = links.size();
        point_hessian[point].setZero(), point_gradient[point].setZero(), calibration_by_point[point].setZero();
        for (; o < bundle.observations.size() && bundle.observations[o].point == static_cast<int>(point); ++o) {
          const WindowBundleObservation& seen = bundle.observations[o];
          if (!seen.fits) continue;
          const View& view = bundle.views[static_cast<std::size_t>(seen.view)];
          if (!residual_of(seen.sighting, view * bundle.points[point], camera, bundle.calibration, r)) continue;
          const double size_px = r.value.head<2>().norm(), size_depth = std::abs(r.value.z());
          Eigen::Vector3d weights(1, 1, 1);
          if (size_px > options.soft_sigmas) weights.head<2>().setConstant(options.soft_sigmas / size_px);
          if (size_depth > options.soft_sigmas) weights.z() = options.soft_sigmas / size_depth;
          const Eigen::Matrix3d by_point = r.by_point * view.rotation;
          const Eigen::Matrix3d weighted = weights.asDiagonal() * by_point;
          const Eigen::Vector3d weighted_value = weights.cwiseProduct(r.value);
          point_hessian[point].noalias() += by_point.transpose() * weighted;
          point_gradient[point].noalias() += by_point.transpose() * weighted_value;
          Eigen::Matrix<double, 3, 2> by_calibration = Eigen::Matrix<double, 3, 2>::Zero();
          by_calibration.topLeftCorner<2, 1>() = seen.sighting.row_flow / seen.sighting.sigma_px;
          if (seen.sighting.inverse_depth_sigma > 0) by_calibration(2, 1) = 1.0 / seen.sighting.inverse_depth_sigma;
          const Eigen::Matrix<double, 2, 3> calibration_weighted = by_calibration.transpose() * weights.asDiagonal();
          calibration_by_point[point].noalias() += calibration_weighted * by_point;
          calibration_hessian.noalias() += calibration_weighted * by_calibration;
          views_gradient.segment<2>(calibration_at).noalias() += calibration_weighted * r.value;
          const int c = column[static_cast<std::size_t>(seen.view)];
          if (c < 0) continue;
          view_hessian[static_cast<std::size_t>(c)].noalias() +=
              r.by_motion.transpose() * weights.asDiagonal() * r.by_motion;
          views_gradient.segment<6>(6 * c).noalias() += r.by_motion.transpose() * weighted_value;
          view_border[static_cast<std::size_t>(c)].noalias() += calibration_weighted * r.by_motion;
          links.push_back({c, r.by_motion.transpose() * weighted});
        }
      }
      first_link[count] = links.size();
    }
    reduced.set_zero();
    for (int i = 0; i < free_views; ++i) {
      ReducedSystem::Block& block = reduced.diagonal(i);
      block = view_hessian[static_cast<std::size_t>(i)];
      block.diagonal() *= 1.0 + lambda;
      block.diagonal().array() += 1e-9;
      reduced.border(i) = view_border[static_cast<std::size_t>(i)];
    }
    reduced.corner() = calibration_hessian;
    reduced.corner().diagonal() *= 1.0 + lambda;
    reduced.corner().diagonal().array() += 1e-9;
    right = -views_gradient;
    std::vector<Eigen::Matrix3d> inverse(count);
    for (std::size_t point = 0; point < count; ++point) {
      Eigen::Matrix3d damped = point_hessian[point];
      damped.diagonal() *= 1.0 + lambda;
      damped.diagonal().array() += 1e-6;
      const bool fixed = !bundle.fixed_points.empty() && bundle.fixed_points[point];
      inverse[point] = fixed ? Eigen::Matrix3d::Zero() : Eigen::Matrix3d(damped.inverse());
      const Eigen::Matrix<double, 2, 3> calibration_left = calibration_by_point[point] * inverse[point];
      right.segment<2>(calibration_at).noalias() += calibration_left * point_gradient[point];
      reduced.corner().noalias() -= calibration_left * calibration_by_point[point].transpose();
      for (std::size_t i = first_link[point]; i < first_link[point + 1]; ++i) {
        const int row = links[i].column;
        reduced.border(row).noalias() -= calibration_left * links[i].cross.transpose();
        const Matrix63 left = links[i].cross * inverse[point];
        right.segment<6>(6 * row).noalias() += left * point_gradient[point];
        reduced.diagonal(row).noalias() -= left * links[i].cross.transpose();
        for (std::size_t j = first_link[point]; j < first_link[point + 1]; ++j)
          if (links[j].column < row) reduced.below(row, links[j].column).noalias() -= left * links[j].cross.transpose();
      }
    }
    const Eigen::VectorXd change = reduced.solved(right);
    if (change.size() != size) break;
    if (!change.allFinite()) break;
    std::vector<View> views = bundle.views;
    for (std::size_t i = 0; i < views.size(); ++i)
      if (column[i] >= 0) views[i] = moved(views[i], change.segment<6>(6 * column[i]));
    std::vector<Eigen::Vector3d> points = bundle.points;
    for (std::size_t point = 0; point < count; ++point) {
      Eigen::Vector3d sum =
          point_gradient[point] + calibration_by_point[point].transpose() * change.segment<2>(calibration_at);
      for (std::size_t i = first_link[point]; i < first_link[point + 1]; ++i)
        sum.noalias() += links[i].cross.transpose() * change.segment<6>(6 * links[i].column);
      points[point] -= inverse[point] * sum;
    }
    SensorCalibration calibration = bundle.calibration;
    if (step_information[0] > 0) calibration.readout_s += change[calibration_at];
    if (step_information[1] > 0) calibration.inverse_depth_offset += change[calibration_at + 1];
    const double now = cost_of(bundle, calibration, views, points, camera, options) + prior_cost(calibration);
    build = now < cost;
    if (build) {
      const bool done = cost - now < 1e-4 * cost;
      bundle.calibration = calibration, bundle.views = std::move(views), bundle.points = std::move(points), cost = now;
      lambda = std::max(1e-7, lambda * 0.2);
      if (done) break;
    } else {
      lambda *= 8.0;
    }
  }
  for (WindowBundleObservation& o : bundle.observations) {
    const Eigen::Vector3d p =
        bundle.views[static_cast<std::size_t>(o.view)] * bundle.points[static_cast<std::size_t>(o.point)];
    o.fits = p.z() > 0.02 &&
             (camera.project(p) - o.sighting.pixel + bundle.calibration.readout_s * o.sighting.row_flow).norm() <
                 options.gate_sigmas * o.sighting.sigma_px;
  }
}

}  // namespace mapweave::visual
