#pragma once
// What may still go over a wire that is bounded on the mean.

#include <mapweave/core/stamp.h>

#include <algorithm>
#include <optional>

namespace mapweave::tiers {

class ByteAllowance {
 public:
  static constexpr double kBurst_s = 2.0;
  // Time by data; it saves up what the wire carries in two seconds, at most. An earlier stamp changes nothing.
  void wait_until(Stamp now, double bytes_per_s) {
    if (last_)
      bytes_ = std::min(bytes_ + bytes_per_s * std::max(0.0, seconds_between(*last_, now)), kBurst_s * bytes_per_s);
    if (!last_ || *last_ < now) last_ = now;
  }
  void spend(std::size_t bytes) { bytes_ -= static_cast<double>(bytes); }
  void give_back(std::size_t bytes) { bytes_ += static_cast<double>(bytes); }
  double bytes() const { return bytes_; }  // below zero: in debt

 private:
  double bytes_ = 0.0;
  std::optional<Stamp> last_;
};

}  // namespace mapweave::tiers
