#include "heading_quality.h"

#include <mapweave/core/geometry.h>
#include <mapweave/core/median.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace mapweave::laser {
namespace {

constexpr std::size_t kFewest = 6, kMost = 40;   // stretches
constexpr double kMedianOfNormal = 0.6745;       // of |x| where x is standard normal
constexpr double kLeast = 0.03, kLargest = 6.0;  // bounds of the factor, whatever few stretches say

}  // namespace

void HeadingQuality::add_step(double length_m, double turn_rad, double sigma_rad) {
  length_m_ += length_m;
  turn_rad_ += turn_rad;
  variance_ += sigma_rad * sigma_rad;
}

void HeadingQuality::add_heading(std::optional<double> heading_rad) {
  if (start_ && heading_rad && variance_ > 0) {
    ratios_.push_back(std::abs(wrap_angle(*heading_rad - *start_ - turn_rad_)) / std::sqrt(variance_));
    if (ratios_.size() > kMost) ratios_.pop_front();
    if (ratios_.size() >= kFewest) {
      factor_ =
          std::clamp(median(std::vector<double>(ratios_.begin(), ratios_.end())) / kMedianOfNormal, kLeast, kLargest);
    }
  }
  start_ = heading_rad;
  length_m_ = turn_rad_ = variance_ = 0.0;
}

}  // namespace mapweave::laser
