#pragma once
// What was simulated, as recordings know it.

#include <mapweave/simulation/camera_recording.h>
#include <mapweave/simulation/imu.h>
#include <mapweave/simulation/world.h>

#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <string>

namespace mapweave::simulation {

mrpt::obs::CObservationOdometry::Ptr odometry_observation(const SimulatedStep&);
// Contract: the step has a scan of options.rays ranges.
mrpt::obs::CObservation2DRangeScan::Ptr scan_observation(const SimulatedStep&, const SimulatedLaserOptions& options);
mrpt::obs::CObservationIMU::Ptr imu_observation(const ImuReading&);

// Pictures are embedded, but for those whose file is given: then only its name is kept.
struct PictureFiles {
  std::string left, right;
};
// A CObservationImage, a CObservationStereoImages or a CObservation3DRangeScan. The camera's pose on the robot is that
// of its optical frame (z ahead) in the first two, and has x ahead in the third, as MRPT wants it. The stamp is the
// colour picture's.
mrpt::obs::CObservation::Ptr camera_observation(const CameraFrame&, const CameraOptions&,
                                                const PictureFiles& files = {});

}  // namespace mapweave::simulation
