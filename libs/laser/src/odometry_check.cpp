#include <mapweave/laser/odometry_check.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>

namespace mapweave::laser {
namespace {

constexpr int kMostTries = 60;
constexpr std::size_t kFewestPoints = 40, kMostPoints = 120, kToConfirm = 5, kToDoubt = 8, kMostPairs = 24;
constexpr double kThinning_m = 0.05, kMostApart_s = 4.0;
constexpr double kMove_m = 0.1, kTurn_rad = 0.06, kLargestTry_rad = 1.0;
constexpr double kWindow_m = 0.5, kWindow_rad = 0.4, kWindowStep_rad = 0.0175;
constexpr double kLeastInliers = 0.6, kLeastBalance = 0.1;
constexpr double kUsualRatio = 1.6, kDoubtfulRatio = 2.0, kAlike = 0.2, kMost = 0.75;
constexpr double kDegree = M_PI / 180.0, kTurnError_rad = 0.05, kDegreesError_rad = 0.6;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

template <class Values, class Predicate>
std::size_t count(const Values& values, const Predicate& is_one) {
  return static_cast<std::size_t>(std::count_if(values.begin(), values.end(), is_one));
}

rawlog::UnitDoubt doubt_of_moves(double ratio) {
  struct Unit {
    double per_m;
    const char* name;
  };
  char text[120];
  std::snprintf(text, sizeof text, "the odometry moves %.3g times as far as the laser's scans do", ratio);
  for (const Unit& unit : {Unit{1000.0, "millimetres"}, {100.0, "centimetres"}, {39.37, "inches"}, {3.281, "feet"}})
    if (std::abs(std::log(ratio / unit.per_m)) < kAlike)
      return {text, std::string("is the odometry in ") + unit.name + "?"};
  return {text, "is it in metres?"};
}

}  // namespace

void OdometryCheck::begin(Stamp stamp, const std::vector<matching::WallPoint>& points) {
  reference_.emplace(Reference{stamp, *odometry_from_robot_, {}, kMove_m, kTurn_rad});
  reference_->field.add(points);
  reference_->field.settle();
}

// The motion since the reference; nullopt where the scans do not show it.
std::optional<Pose2> OdometryCheck::match(const std::vector<matching::WallPoint>& points) const {
  const auto found = matching::correlate(reference_->field, points, {}, {kWindow_m, kWindow_rad, kWindowStep_rad},
                                         {kWindow_m, kWindow_rad});
  if (!found || found->at_border) return std::nullopt;
  const auto refined = matching::refine(reference_->field, points, found->field_from_scan, {}, nullptr);
  if (refined.inliers < kLeastInliers) return std::nullopt;
  const Eigen::Vector2d known =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(refined.information.topLeftCorner<2, 2>()).eigenvalues();
  if (known[0] < kLeastBalance * known[1]) return std::nullopt;  // a corridor
  return refined.field_from_scan;
}

std::optional<rawlog::UnitDoubt> OdometryCheck::add_scan(Stamp stamp, const PackedScan& scan) {
  if (tries_ == kMostTries || !odometry_from_robot_ || (moves_are_judged_ && turns_are_judged_)) return std::nullopt;
  if (reference_) {
    const Pose2 claimed = between(reference_->odometry_from_robot, *odometry_from_robot_);
    if (std::hypot(claimed.x, claimed.y) < reference_->try_m && std::abs(claimed.phi) < reference_->try_rad)
      return std::nullopt;
  }
  const auto points = matching::thinned(matching::wall_points(scan), kThinning_m, kMostPoints);
  if (points.size() < kFewestPoints) {
    reference_.reset();
    return std::nullopt;
  }
  if (!reference_ || seconds_between(reference_->stamp, stamp) > kMostApart_s) {
    begin(stamp, points);
    return std::nullopt;
  }
  ++tries_;
  const auto moved = match(points);
  const Pose2 claimed = between(reference_->odometry_from_robot, *odometry_from_robot_);
  const double moved_m = moved ? std::hypot(moved->x, moved->y) : 0.0, turned_rad = moved ? moved->phi : 0.0;
  if (moved && moved_m < 0.8 * kMove_m && std::abs(turned_rad) < 0.8 * kTurn_rad) {
    // Less than odometry claims. More of it makes a motion that can be measured, whatever the unit.
    reference_->try_m *= 2.0;
    reference_->try_rad = std::min(2.0 * reference_->try_rad, kLargestTry_rad);
    return std::nullopt;
  }
  if (moved_m >= 0.8 * kMove_m) ratios_.push_back(std::hypot(claimed.x, claimed.y) / moved_m);
  if (std::abs(turned_rad) >= 0.8 * kTurn_rad) turns_.push_back({claimed.phi, turned_rad});
  begin(stamp, points);
  return doubt();
}

std::optional<rawlog::UnitDoubt> OdometryCheck::doubt() {
  const auto is_usual = [](double ratio) { return ratio < kUsualRatio && ratio > 1.0 / kUsualRatio; };
  if (!moves_are_judged_ && count(ratios_, is_usual) >= kToConfirm) moves_are_judged_ = true;
  if (!moves_are_judged_ && ratios_.size() >= kToDoubt) {
    const double middle = median(ratios_);
    const auto is_alike = [&](double ratio) { return std::abs(std::log(ratio / middle)) < kAlike; };
    const bool is_constant =
        static_cast<double>(count(ratios_, is_alike)) >= kMost * static_cast<double>(ratios_.size());
    const bool is_doubtful = is_constant && middle > kDoubtfulRatio;
    moves_are_judged_ = is_doubtful || ratios_.size() >= kMostPairs;
    if (is_doubtful) return doubt_of_moves(middle);
  }
  const auto is_right = [](const Turn& turn) {
    return std::abs(wrap_angle(turn.claimed_rad - turn.matched_rad)) <
           kTurnError_rad + 0.3 * std::abs(turn.matched_rad);
  };
  const auto is_in_degrees = [](const Turn& turn) {
    return std::abs(wrap_angle(turn.claimed_rad - turn.matched_rad / kDegree)) < kDegreesError_rad;
  };
  if (!turns_are_judged_ && count(turns_, is_right) >= kToConfirm) turns_are_judged_ = true;
  if (!turns_are_judged_ && turns_.size() >= kToDoubt) {
    const double all = static_cast<double>(turns_.size());
    const bool is_doubtful = static_cast<double>(count(turns_, is_in_degrees)) >= kMost * all &&
                             static_cast<double>(count(turns_, is_right)) <= (1.0 - kMost) * all;
    turns_are_judged_ = is_doubtful || turns_.size() >= kMostPairs;
    if (is_doubtful)
      return rawlog::UnitDoubt{"the odometry turns otherwise than the laser's scans do, and as they do by degrees",
                               "are its headings in degrees?"};
  }
  return std::nullopt;
}

}  // namespace mapweave::laser
