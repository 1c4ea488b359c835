#pragma once
// Depth cameras as planar scans, for the laser engines.

#include <mapweave/rawlog/observation_stream.h>

#include <memory>

namespace mapweave::laser {

// The records of `log` with planar scans, of the same label and pose, instead of depth pictures: what a camera that
// looks about level sees ahead. A ray each half degree; its range is the median of the depths within 2 degrees above
// and below the picture's centre, and unknown where there are none. Records of planar lasers are left out. Throws what
// `log` throws, what reading a picture throws, Error(kBadInput) for a depth picture without calibration, and at the end
// for a log without depth pictures.
std::unique_ptr<rawlog::ObservationStream> depth_scans(std::unique_ptr<rawlog::ObservationStream> log);

}  // namespace mapweave::laser
