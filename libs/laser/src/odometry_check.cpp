#include <mapweave/core/median.h>
#include <mapweave/laser/odometry_check.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <cstdio>

namespace mapweave::laser {
namespace {

constexpr int kMostTries = 60;  // searches: bounds the time where scans never show a motion
// Of a scan: fewer points match by chance, more only take longer. The thinning is a cell of the field's likelihood.
constexpr std::size_t kFewestPoints = 40, kMostPoints = 120;
constexpr double kThinning_m = 0.05;
// Of pairs of scans: so many as usual end the check; of fewer than kToDoubt two wrong matches would decide;
// where kMostPairs have said neither, more will not.
constexpr std::size_t kToConfirm = 5, kToDoubt = 8, kMostPairs = 24;
constexpr double kMostApart_s = 4.0;  // between the scans of a pair: later, what stood around may have moved
// What odometry claims before a pair is matched: two cells of the search, and as much at 1.7 m. Smaller motions drown
// in the errors of a match, larger ones leave the window.
constexpr double kMove_m = 0.1, kTurn_rad = 0.06;
constexpr double kClear = 0.8;           // of that, by the scans: less is too little to form a ratio of
constexpr double kLargestTry_rad = 1.0;  // to claim: well below pi, which a wrapped turn never exceeds
// Around no motion at all, for odometry may be in any unit: what a robot does between two scans, in steps of a degree.
constexpr double kWindow_m = 0.5, kWindow_rad = 0.4, kWindowStep_rad = 0.0175;
constexpr double kLeastInliers = 0.6;  // the front end believes 0.35; a wrong match here would accuse the odometry
constexpr double kLeastBalance = 0.1;  // of the information along the worse direction to that along the better one
// The nearest other unit are feet, 3.28: up to the first, either way, odometry is bad but in metres; from the second on
// it is in another unit, if it always errs alike; between them nothing is said.
constexpr double kUsualRatio = 1.6, kDoubtfulRatio = 2.0;
constexpr double kAlike = 0.2;  // of logarithms: one ratio. Units are farther apart: feet from metres by 1.2
constexpr double kMost = 0.75;  // of the pairs: a quarter may be matched wrongly
constexpr double kDegree = M_PI / 180.0;
// Of a turn: in radians, what wheels miss standing and in proportion; in degrees, what a hundredth of a radian that the
// match is off comes to (0.57). A heading that has nothing to do with the turn passes in one of five cases.
constexpr double kTurnError_rad = 0.05, kTurnErrorShare = 0.3, kDegreesError_rad = 0.6;

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
  const auto found = matching::correlate(reference_->field.likelihood(), points, {},
                                         {kWindow_m, kWindow_rad, kWindowStep_rad}, {kWindow_m, kWindow_rad});
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
  if (moved && moved_m < kClear * kMove_m && std::abs(turned_rad) < kClear * kTurn_rad) {
    // Less than odometry claims. More of it makes a motion that can be measured, whatever the unit.
    reference_->try_m *= 2.0;
    reference_->try_rad = std::min(2.0 * reference_->try_rad, kLargestTry_rad);
    return std::nullopt;
  }
  if (moved_m >= kClear * kMove_m) ratios_.push_back(std::hypot(claimed.x, claimed.y) / moved_m);
  if (std::abs(turned_rad) >= kClear * kTurn_rad) turns_.push_back({claimed.phi, turned_rad});
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
           kTurnError_rad + kTurnErrorShare * std::abs(turn.matched_rad);
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
