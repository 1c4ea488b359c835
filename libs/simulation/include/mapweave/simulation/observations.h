#pragma once
// Simulated steps as recordings know them.

#include <mapweave/simulation/world.h>

#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationOdometry.h>

namespace mapweave::simulation {

mrpt::obs::CObservationOdometry::Ptr odometry_observation(const SimulatedStep&);
// Contract: the step has a scan of options.rays ranges.
mrpt::obs::CObservation2DRangeScan::Ptr scan_observation(const SimulatedStep&, const LaserOptions& options);

}  // namespace mapweave::simulation
