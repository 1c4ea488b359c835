#include <mapweave/transport/bandwidth.h>

#include <algorithm>

namespace mapweave::transport {
namespace {

// A measure is long enough after that, with so many bytes; one that ends before must have seen more of them.
constexpr double kMeasure_s = 0.25, kLeastBytes = 16e3, kLeastBurstBytes = 64e3, kLeastBurst_s = 1e-4;
constexpr double kNewShare = 0.3;

}  // namespace

void BandwidthMeter::sent(std::size_t bytes, double) { on_path_ += bytes; }

void BandwidthMeter::confirmed(std::size_t bytes, double now_s) {
  on_path_ -= std::min(on_path_, bytes);
  if (since_s_) {
    bytes_ += static_cast<double>(bytes);
    const double passed_s = now_s - *since_s_;
    const bool is_end = on_path_ == 0;
    if ((passed_s >= kMeasure_s && bytes_ >= kLeastBytes) ||
        (is_end && passed_s >= kLeastBurst_s && bytes_ >= kLeastBurstBytes))
      fold(now_s);
  }
  if (on_path_ == 0) {
    since_s_.reset();
  } else if (!since_s_) {
    since_s_ = now_s;
    bytes_ = 0.0;
  }
}

void BandwidthMeter::lost() {
  on_path_ = 0;
  since_s_.reset();
}

void BandwidthMeter::fold(double now_s) {
  const double measured = bytes_ / (now_s - *since_s_);
  estimate_ =
      Bandwidth{estimate_ ? (1.0 - kNewShare) * estimate_->bytes_per_s + kNewShare * measured : measured, now_s};
  since_s_ = now_s;
  bytes_ = 0.0;
}

}  // namespace mapweave::transport
