#pragma once
// When the depth picture of an observation was taken. Many depth cameras take colour and depth at different instants;
// MRPT has one stamp for both, and it is the colour picture's here. The difference stands within the observation, so
// that it survives every rawlog.

#include <mapweave/core/stamp.h>
#include <mrpt/obs/CObservation3DRangeScan.h>

namespace mapweave::rawlog {

// Depth after colour, in nanoseconds; negative: before. 0 where the log does not say.
// Form: the range image layer "depth_delay_ns" of 2 x 2 cells, which hold the number's 64 bits, the low 16 first; none
// for 0. (A square, because MRPT swaps rows and columns of layers between writing and reading.)
std::int64_t depth_delay_ns(const mrpt::obs::CObservation3DRangeScan&);
void set_depth_delay_ns(mrpt::obs::CObservation3DRangeScan&, std::int64_t delay_ns);

}  // namespace mapweave::rawlog
