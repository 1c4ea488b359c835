#pragma once
// How long a laser took for one scan. MRPT's scans do not say, ROS's do; it stands within the observation, so that it
// survives every rawlog.

#include <mrpt/obs/CObservation2DRangeScan.h>

#include <cstdint>

namespace mapweave::rawlog {

// From the first ray of the scan to its last one, in nanoseconds; the first was measured at the scan's stamp. 0 where
// the log does not say.
// Form: the scan's intensities, a number that marks them, then the duration, then zeros. Intensities of other logs are
// not taken for it.
std::int64_t sweep_ns(const mrpt::obs::CObservation2DRangeScan&);
// Durations above 0 and below 2 s, of scans of two rays and more, are kept.
void set_sweep_ns(mrpt::obs::CObservation2DRangeScan&, std::int64_t sweep_ns);

}  // namespace mapweave::rawlog
