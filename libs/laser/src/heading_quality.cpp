#include "heading_quality.h"

#include <mapweave/core/geometry.h>
#include <mapweave/core/median.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace mapweave::laser {
namespace {

constexpr double kStretch_m = 5.0;  // of path between two headings that are compared
constexpr double kStep_m = 0.02;    // a robot that stands sees the same points again, with the same errors
// Stretches. Half of the first steps' variance is taken for noise of matches: that needs more of them.
constexpr std::size_t kFewest = 6, kFewestFirstSteps = 12, kMost = 40;
constexpr double kLeast = 0.03, kLargest = 6.0;  // bounds of the factor, whatever few stretches say

template <class Value>
void keep_latest(std::deque<Value>& values, const Value& value) {
  values.push_back(value);
  if (values.size() > kMost) values.pop_front();
}

}  // namespace

void HeadingQuality::add_step(double length_m, double turn_rad, double sigma_rad) {
  length_m_ += length_m;
  turn_rad_ += turn_rad;
  variance_ += sigma_rad * sigma_rad;
}

bool HeadingQuality::wants_heading() const {
  return !start_rad_ || length_m_ >= kStretch_m || (!first_step_is_taken_ && length_m_ >= kStep_m);
}

double HeadingQuality::apart_rad(const MatchedHeading& matched) const {
  return std::abs(wrap_angle(matched.heading_rad - *start_rad_ - turn_rad_));
}

void HeadingQuality::add_first_step(const MatchedHeading& matched) {
  keep_latest(first_steps_, {apart_rad(matched), variance_, matched.sigma_rad * matched.sigma_rad});
  if (first_steps_.size() < kFewestFirstSteps) return;
  const auto median_of = [&](double FirstStep::*member) {
    std::vector<double> values;
    for (const FirstStep& step : first_steps_) values.push_back(step.*member);
    return median(std::move(values));
  };
  const double apart = median_of(&FirstStep::apart_rad) / kMedianOfNormal;
  const double by_odometry = factor_ * factor_ * median_of(&FirstStep::odometry_variance);
  const double measured = 0.5 * (apart * apart - by_odometry), expected = median_of(&FirstStep::match_variance);
  match_information_ = measured > expected ? expected / measured : 1.0;
}

void HeadingQuality::add_heading(std::optional<MatchedHeading> matched) {
  if (start_rad_ && length_m_ < kStretch_m) {
    first_step_is_taken_ = true;
    if (matched) add_first_step(*matched);
    return;
  }
  if (start_rad_ && matched && variance_ > 0) {
    keep_latest(ratios_, apart_rad(*matched) / std::sqrt(variance_));
    if (ratios_.size() >= kFewest) {
      factor_ =
          std::clamp(median(std::vector<double>(ratios_.begin(), ratios_.end())) / kMedianOfNormal, kLeast, kLargest);
    }
  }
  start_rad_.reset();
  if (matched) start_rad_ = matched->heading_rad;
  length_m_ = turn_rad_ = variance_ = 0.0;
  first_step_is_taken_ = false;
}

}  // namespace mapweave::laser
