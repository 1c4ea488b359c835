#include <mapweave/rawlog/depth_delay.h>

namespace mapweave::rawlog {
namespace {

constexpr const char* kLayer = "depth_delay_ns";
constexpr int kCells = 4, kBits = 16;

}  // namespace

std::int64_t depth_delay_ns(const mrpt::obs::CObservation3DRangeScan& scan) {
  const auto layer = scan.rangeImageOtherLayers.find(kLayer);
  if (layer == scan.rangeImageOtherLayers.end() || layer->second.rows() != 2 || layer->second.cols() != 2) return 0;
  std::uint64_t bits = 0;
  for (int i = kCells; i-- > 0;) bits = bits << kBits | layer->second(i / 2, i % 2);
  return static_cast<std::int64_t>(bits);
}

void set_depth_delay_ns(mrpt::obs::CObservation3DRangeScan& scan, std::int64_t delay_ns) {
  scan.rangeImageOtherLayers.erase(kLayer);
  if (delay_ns == 0) return;
  auto& cells = scan.rangeImageOtherLayers[kLayer];
  cells.resize(2, 2);
  auto bits = static_cast<std::uint64_t>(delay_ns);
  for (int i = 0; i < kCells; ++i, bits >>= kBits) cells(i / 2, i % 2) = static_cast<std::uint16_t>(bits & 0xffffU);
}

}  // namespace mapweave::rawlog
