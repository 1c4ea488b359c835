#include <mapweave/simulation/observations.h>

#include <mapweave/core/error.h>
#include <mapweave/rawlog/observation_stream.h>

#include <cmath>

namespace mapweave::simulation {

mrpt::obs::CObservationOdometry::Ptr odometry_observation(const SimulatedStep& step) {
  auto observation = mrpt::obs::CObservationOdometry::Create();
  observation->timestamp = rawlog::to_mrpt_time(step.stamp);
  observation->sensorLabel = "ODOM";
  observation->odometry = mrpt::poses::CPose2D(step.odometry_from_robot);
  return observation;
}

mrpt::obs::CObservation2DRangeScan::Ptr scan_observation(const SimulatedStep& step, const LaserOptions& options) {
  MAPWEAVE_EXPECT(step.ranges.size() == static_cast<std::size_t>(options.rays), "a scan has the laser's rays");
  auto observation = mrpt::obs::CObservation2DRangeScan::Create();
  observation->timestamp = rawlog::to_mrpt_time(step.stamp);
  observation->sensorLabel = "LASER";
  observation->aperture = static_cast<float>(options.field_of_view_deg * (M_PI / 180.0));
  observation->rightToLeft = true;
  observation->maxRange = static_cast<float>(options.max_range_m);
  observation->stdError = static_cast<float>(options.noise_m);
  observation->sensorPose =
      mrpt::poses::CPose3D(mrpt::math::TPose3D(options.x_m, options.y_m, 0.0, options.robot_from_laser().phi, 0.0, 0.0));
  observation->resizeScan(step.ranges.size());
  for (std::size_t ray = 0; ray < step.ranges.size(); ++ray) {
    observation->setScanRange(ray, step.ranges[ray]);
    observation->setScanRangeValidity(ray, step.ranges[ray] > 0.0f);
  }
  return observation;
}

}  // namespace mapweave::simulation
