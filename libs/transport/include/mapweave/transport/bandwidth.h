#pragma once
// What a link carries, measured by who sends over it.

#include <cstddef>
#include <optional>

namespace mapweave::transport {

struct Bandwidth {
  double bytes_per_s = 0.0;
  double at_s = 0.0;  // when it was measured last
};

// Bytes that were confirmed per second while more were on their path: when nothing waits, nothing is learned. Each
// measure begins with a confirmation, so that the first round trip does not count. Not thread-safe. Times are the
// caller's, in seconds, and never run backwards.
class BandwidthMeter {
 public:
  void sent(std::size_t bytes, double now_s);
  void confirmed(std::size_t bytes, double now_s);
  // What was on its path is sent again, or never.
  void lost();
  std::optional<Bandwidth> estimate() const { return estimate_; }

 private:
  void fold(double now_s);
  std::size_t on_path_ = 0;
  std::optional<double> since_s_;  // the confirmation that the measure began with
  double bytes_ = 0.0;             // confirmed since
  std::optional<Bandwidth> estimate_;
};

}  // namespace mapweave::transport
