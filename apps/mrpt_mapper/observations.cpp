#include "observations.h"

#include <algorithm>
#include <cmath>

namespace mapweave::mrpt_mapper {

mrpt::obs::CObservation2DRangeScan::Ptr observation_of(const PackedScan& scan, Stamp stamp) {
  const ScanGeometry& geometry = *scan.geometry;
  auto observation = mrpt::obs::CObservation2DRangeScan::Create();
  const double span_rad = geometry.angle_step_rad * (geometry.ray_count - 1);
  const double middle_rad = geometry.first_angle_rad + 0.5 * span_rad;
  observation->aperture = static_cast<float>(std::abs(span_rad));
  observation->rightToLeft = geometry.angle_step_rad > 0.0;
  observation->maxRange = static_cast<float>(geometry.max_range_m);
  observation->sensorLabel = "laser";
  observation->timestamp = mrpt::Clock::fromDouble(stamp.seconds());

  const auto& [t, q] = geometry.robot_from_laser;
  const bool upside_down = (q * Eigen::Vector3d::UnitZ()).z() < 0.0;
  const Eigen::Vector3d middle = q * Eigen::Vector3d(std::cos(middle_rad), std::sin(middle_rad), 0.0);
  observation->sensorPose =
      mrpt::poses::CPose3D(t.x(), t.y(), 0.0, std::atan2(middle.y(), middle.x()), 0.0, upside_down ? M_PI : 0.0);

  observation->resizeScanAndAssign(geometry.ray_count, observation->maxRange, false);
  for (std::uint32_t ray = 0; ray < geometry.ray_count; ++ray) {
    if (scan.ranges[ray] == 0) continue;
    observation->setScanRange(ray, static_cast<float>(scan.ranges[ray] * geometry.range_unit_m));
    observation->setScanRangeValidity(ray, true);
  }
  return observation;
}

int returns_in(const PackedScan& scan) {
  return static_cast<int>(std::count_if(scan.ranges.begin(), scan.ranges.end(), [](auto range) { return range > 0; }));
}

mrpt::slam::CICP::TConfigParams icp_parameters(const laser::IcpSearchOptions& options) {
  mrpt::slam::CICP::TConfigParams parameters;
  parameters.ICP_algorithm = mrpt::slam::icpClassic;
  parameters.maxIterations = static_cast<unsigned>(options.iterations);
  parameters.thresholdDist = options.match_distance_m;
  parameters.thresholdAng =
      0.0;  // its pivot is wrong before MRPT 2.6: the reach would grow with the distance from the map's origin
  parameters.onlyUniqueRobust = true;
  parameters.smallestThresholdDist = std::min(options.final_match_distance_m, options.match_distance_m);
  parameters.ALFA = options.shrink;
  parameters.corresponding_points_decimation = static_cast<std::uint32_t>(options.point_decimation);
  return parameters;
}

mrpt::maps::CSimplePointsMap points_of(const mrpt::obs::CObservation2DRangeScan& observation, double point_distance_m) {
  mrpt::maps::CSimplePointsMap points;
  points.insertionOptions.minDistBetweenLaserPoints = static_cast<float>(point_distance_m);
  points.insertObservation(observation);
  return points;
}

}  // namespace mapweave::mrpt_mapper
