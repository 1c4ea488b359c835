#include "pose_from_points.h"

#include <Eigen/Cholesky>
#include <algorithm>

namespace mapweave::visual {

bool residual_of(const Sighting& sighting, const Eigen::Vector3d& p, const Pinhole& camera,
                 const SensorCalibration& calibration, Residual& out) {
  if (!(p.z() > kNearestSolved_m)) return false;
  const double z = 1.0 / p.z(), z2 = z * z, weight = 1.0 / sighting.sigma_px;
  out.value.head<2>() = weight * (camera.project(p) - sighting.pixel + calibration.readout_s * sighting.row_flow);
  out.by_point << weight * camera.fx * z, 0, -weight * camera.fx * p.x() * z2, 0, weight * camera.fy * z,
      -weight * camera.fy * p.y() * z2, 0, 0, 0;
  const double slack = sighting.slack_px.squaredNorm();
  if (slack > 0.0) {  // whitened by sigma^2 I + slack slack^T
    const double kept = sighting.sigma_px / std::sqrt(sighting.sigma_px * sighting.sigma_px + slack);
    const Eigen::Matrix2d white =
        Eigen::Matrix2d::Identity() - (1.0 - kept) / slack * sighting.slack_px * sighting.slack_px.transpose();
    out.value.head<2>() = white * out.value.head<2>().eval();
    out.by_point.topRows<2>() = white * out.by_point.topRows<2>().eval();
  }
  out.value.z() = 0;
  if (sighting.inverse_depth_sigma > 0) {
    out.value.z() = (z + calibration.inverse_depth_offset - sighting.inverse_depth) / sighting.inverse_depth_sigma;
    out.by_point(2, 2) = -z2 / sighting.inverse_depth_sigma;
  }
  Eigen::Matrix3d cross;
  cross << 0, p.z(), -p.y(), -p.z(), 0, p.x(), p.y(), -p.x(), 0;  // -[p]x
  out.by_motion.leftCols<3>() = out.by_point;
  out.by_motion.rightCols<3>() = out.by_point * cross;
  return true;
}

PoseFromPoints pose_from_points(const std::vector<Sighting>& sightings, const Pinhole& camera, const View& guess,
                                const SensorCalibration& calibration, double gate, double first_gate) {
  PoseFromPoints result;
  result.view = guess;
  Residual r;
  result.fits.assign(sightings.size(), 1);
  if (first_gate < std::numeric_limits<double>::infinity())
    for (std::size_t i = 0; i < sightings.size(); ++i)
      result.fits[i] = residual_of(sightings[i], guess * sightings[i].point_in_map, camera, calibration, r) &&
                       r.value.head<2>().norm() < first_gate;
  for (int round = 0; round < 2; ++round) {
    const double soft = round == 0 ? 2.0 : 1.5;
    for (int step = 0; step < 10; ++step) {
      Eigen::Matrix<double, 6, 6> hessian = Eigen::Matrix<double, 6, 6>::Zero();
      Eigen::Matrix<double, 6, 1> gradient = Eigen::Matrix<double, 6, 1>::Zero();
      int used = 0;
      for (std::size_t i = 0; i < sightings.size(); ++i) {
        if (!result.fits[i]) continue;
        if (!residual_of(sightings[i], result.view * sightings[i].point_in_map, camera, calibration, r)) continue;
        ++used;
        const double size = r.value.head<2>().norm(), depth = std::abs(r.value.z());
        Eigen::Vector3d weights(1, 1, 1);
        if (size > soft) weights.head<2>().setConstant(soft / size);
        if (depth > soft) weights.z() = soft / depth;
        hessian += r.by_motion.transpose() * weights.asDiagonal() * r.by_motion;
        gradient += r.by_motion.transpose() * weights.cwiseProduct(r.value);
      }
      if (used < 4) break;
      hessian.diagonal().array() += 1e-6;
      const Eigen::Matrix<double, 6, 1> change = -hessian.ldlt().solve(gradient);
      if (!change.allFinite()) break;
      result.view = moved(result.view, change);
      if (change.head<3>().norm() < 1e-6 && change.tail<3>().norm() < 1e-6) break;
    }
    result.fits.assign(sightings.size(), 0);
    result.count = 0;
    double sum = 0;
    for (std::size_t i = 0; i < sightings.size(); ++i) {
      if (!residual_of(sightings[i], result.view * sightings[i].point_in_map, camera, calibration, r)) continue;
      const double square = r.value.head<2>().squaredNorm();
      if (square > gate * gate) continue;
      result.fits[i] = 1;
      ++result.count;
      sum += square;
    }
    result.rms_sigma = result.count > 0 ? std::sqrt(sum / (2.0 * result.count)) : 0.0;
  }
  return result;
}

}  // namespace mapweave::visual
