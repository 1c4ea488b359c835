#include <mapweave/rawlog/scan_sweep.h>

namespace mapweave::rawlog {
namespace {

constexpr int kMark = 0x5357'4550;  // "SWEP"
constexpr std::int64_t kLongest_ns = 2'000'000'000;

}  // namespace

std::int64_t sweep_ns(const mrpt::obs::CObservation2DRangeScan& scan) {
  if (!scan.hasIntensity() || scan.getScanSize() < 2 || scan.getScanIntensity(0) != kMark) return 0;
  const std::int64_t duration_ns = scan.getScanIntensity(1);
  return duration_ns > 0 && duration_ns < kLongest_ns ? duration_ns : 0;
}

void set_sweep_ns(mrpt::obs::CObservation2DRangeScan& scan, std::int64_t sweep_ns) {
  if (scan.getScanSize() < 2 || sweep_ns <= 0 || sweep_ns >= kLongest_ns) return;
  scan.setScanHasIntensity(true);
  for (std::size_t ray = 2; ray < scan.getScanSize(); ++ray) scan.setScanIntensity(ray, 0);
  scan.setScanIntensity(0, kMark);
  scan.setScanIntensity(1, static_cast<int>(sweep_ns));
}

}  // namespace mapweave::rawlog
