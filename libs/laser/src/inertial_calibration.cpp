#include "inertial_calibration.h"

#include <mapweave/core/error.h>
#include <mapweave/core/format.h>
#include <mapweave/core/geometry.h>
#include <mapweave/core/median.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

namespace mapweave::laser {
namespace {

// Of a stretch, whichever comes first: its turn is 60 times what two headings by matching are off; a bias as usual
// shows by 0.3 rad. Longer ones are fewer, and a heading between them is lost more often (DECISIONS.md, 90).
constexpr double kStretch_rad = 0.35, kStretch_s = 3.0;
constexpr double kMatch_rad = 0.004;                           // standard deviation of a heading by matching alone
constexpr double kUsualBias_rad_s = 0.1;                       // standard deviation before anything is known
constexpr std::size_t kFewest = 8, kMost = 80;                 // stretches
constexpr double kEnoughTurning = 0.6;                         // square radians
constexpr double kLeastScale = 0.8, kLargestScale = 1.25;      // of a unit that is believed
constexpr double kScaleSigma = 0.05, kBiasSigma_rad_s = 0.03;  // known well enough
constexpr double kUnexplained = 0.15;                          // of the turns: such a unit measures something else
constexpr double kLeastFactor = 0.5, kLargestFactor = 6.0;     // of the noise, whatever few stretches say
constexpr double kDead = 0.2;                                  // scale of a unit that does not turn along
constexpr double kScaleShare = 0.1;                            // standard deviation of a scale that is named
constexpr double kDegreesPerRadian = 57.29577951308232;

}  // namespace

void InertialCalibration::add_step(double seconds, double measured_turn_rad, double matched_turn_rad) {
  current_.seconds += seconds;
  current_.measured_rad += measured_turn_rad;
  current_.matched_rad += matched_turn_rad;
  const double sigma = sigma_rad_ + sigma_per_rad_ * std::abs(matched_turn_rad);
  current_.variance += sigma * sigma;
}

bool InertialCalibration::wants_heading() const {
  const double measured_rad = std::abs(current_.measured_rad) / std::max(1.0, std::abs(scale_));
  return !start_ || measured_rad >= kStretch_rad || std::abs(current_.matched_rad) >= kStretch_rad ||
         current_.seconds >= kStretch_s;
}

void InertialCalibration::add_heading(std::optional<double> heading_rad) {
  if (start_ && heading_rad && current_.seconds > 0.0) close(*heading_rad);
  start_ = heading_rad;
  current_ = {};
}

// Headings are known but for whole circles, which follow from the steps between them.
void InertialCalibration::close(double heading_rad) {
  Stretch stretch = current_;
  stretch.matched_rad += wrap_angle(heading_rad - *start_ - current_.matched_rad);
  stretch.variance += 2.0 * kMatch_rad * kMatch_rad;
  if (!std::isfinite(stretch.measured_rad + stretch.matched_rad)) return;
  stretches_.push_back(stretch);
  if (stretches_.size() > kMost) stretches_.pop_front();
  learn();
}

double InertialCalibration::residual_rad(const Stretch& stretch) const {
  return stretch.measured_rad - scale_ * stretch.matched_rad - bias_rad_s_ * stretch.seconds;
}

// Least squares of scale and bias; stretches that fit badly count less with each round (Huber).
void InertialCalibration::learn() {
  constexpr int kRounds = 8;  // weights hardly change in later ones
  constexpr double kHuber =
      1.5;  // standard deviations, from where a stretch counts less; nearly all of noise lies within
  turned_ = 0.0;
  for (const Stretch& stretch : stretches_) turned_ += stretch.matched_rad * stretch.matched_rad;
  std::vector<double> weights(stretches_.size(), 1.0);
  for (int round = 0; round < kRounds; ++round) {
    Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
    Eigen::Vector2d right = Eigen::Vector2d::Zero();
    normal(1, 1) = 1.0 / (kUsualBias_rad_s * kUsualBias_rad_s);
    normal(0, 0) = 1e-6;
    for (std::size_t i = 0; i < stretches_.size(); ++i) {
      const Eigen::Vector2d row(stretches_[i].matched_rad, stretches_[i].seconds);
      const double weight = weights[i] / stretches_[i].variance;
      normal += weight * row * row.transpose();
      right += weight * stretches_[i].measured_rad * row;
    }
    const Eigen::Matrix2d covariance = normal.inverse();
    const Eigen::Vector2d solution = covariance * right;
    scale_ = solution.x();
    bias_rad_s_ = solution.y();
    scale_sigma_ = std::sqrt(covariance(0, 0));
    bias_sigma_rad_s_ = std::sqrt(covariance(1, 1));
    std::vector<double> ratios;
    for (const Stretch& stretch : stretches_)
      ratios.push_back(std::abs(residual_rad(stretch)) / std::sqrt(stretch.variance));
    noise_factor_ = median(ratios) / kMedianOfNormal;
    const double bound = kHuber * std::max(noise_factor_, 1e-9);
    for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = ratios[i] > bound ? bound / ratios[i] : 1.0;
  }
  scale_sigma_ *= noise_factor_;
  bias_sigma_rad_s_ *= noise_factor_;
  weigh();
}

double InertialCalibration::share_of_turns() const {
  double measured = 0.0;
  std::vector<double> missed;
  for (const Stretch& stretch : stretches_) {
    measured += stretch.measured_rad * stretch.measured_rad;
    missed.push_back(std::abs(residual_rad(stretch)));
  }
  if (!(measured > 0.0)) return 1.0;
  return median(missed) / kMedianOfNormal / std::sqrt(measured / static_cast<double>(stretches_.size()));
}

void InertialCalibration::weigh() {
  const double size = std::abs(scale_);
  is_believed_ = stretches_.size() >= kFewest && turned_ >= kEnoughTurning && size > kLeastScale &&
                 size < kLargestScale && scale_sigma_ < kScaleSigma && bias_sigma_rad_s_ < kBiasSigma_rad_s &&
                 noise_factor_ < kLargestFactor && share_of_turns() < kUnexplained;
}

double InertialCalibration::turn_rad(double seconds, double measured_turn_rad) const {
  MAPWEAVE_EXPECT(is_believed_, "the unit is believed");
  return (measured_turn_rad - bias_rad_s_ * seconds) / scale_;
}

double InertialCalibration::turn_sigma_rad(double seconds, double turn_rad) const {
  const double own = std::max(noise_factor_, kLeastFactor) * (sigma_rad_ + sigma_per_rad_ * std::abs(turn_rad));
  return std::hypot(own, bias_sigma_rad_s_ * seconds, scale_sigma_ * turn_rad);
}

std::optional<std::string> InertialCalibration::doubt() const {
  if (stretches_.size() < kFewest || turned_ < kEnoughTurning) return std::nullopt;
  const double size = std::abs(scale_);
  if (is_believed_) {
    if (scale_ > 0.0) return std::nullopt;
    return "its turns are the other way round: it hangs upside down, or its sign is wrong; that is corrected (say so "
           "in the log, as the pose of the sensor)";
  }
  const std::string times = format("its turns are %.2f times those of the scans", scale_);
  if (size < kDead)
    return "it does not turn with the robot (" + times +
           "): it is dead, or mounted on its side; it is not believed. Its axis z must point up or down, or the log "
           "must say how it is mounted";
  const bool is_scale_known = scale_sigma_ < kScaleShare * size;
  if (is_scale_known && size > 0.7 * kDegreesPerRadian && size < 1.4 * kDegreesPerRadian)
    return times + ": degrees per second? It is not believed; logs hold radians";
  if (is_scale_known && (size < kLeastScale || size > kLargestScale))
    return times + "; it is not believed. Its unit or its scale is wrong";
  if (share_of_turns() < kUnexplained && noise_factor_ < kLargestFactor) return std::nullopt;
  return format("it contradicts the scans (%.0f %% of its turns are not explained by them); it is not believed",
                100.0 * share_of_turns());
}

std::string InertialCalibration::described() const {
  return format("%s: scale %.3f +- %.3f, bias %.4f +- %.4f rad/s, noise %.1f times as expected, from %zu stretches",
                is_believed_ ? "believed" : "not believed", scale_, scale_sigma_, bias_rad_s_, bias_sigma_rad_s_,
                noise_factor_, stretches_.size());
}

}  // namespace mapweave::laser
