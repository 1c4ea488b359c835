#include "sweep_estimator.h"
#include "motion_tracks.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace mapweave::laser {
namespace {

constexpr double kWindow_s = 1.5;                   // scans that are compared lie this near in time,
constexpr double kNear_m = 0.6, kTurned_rad = 1.0;  // and see the same walls
constexpr double kClearlyOther_rad_s = 0.2;         // between two turn rates
constexpr double kSpacing_s = 0.08;                 // between pairs
constexpr std::size_t kMostKept = 100;              // scans at once
// Of a scan: bounds of time, and of what a fit needs.
constexpr std::size_t kMostPoints = 120, kFewestPoints = 30;
// Pairs for an answer and for the first look at them; pairs and scans after which it stops.
constexpr std::size_t kFewestPairs = 24, kFirstEvaluation = 40, kMostPairs = 320, kMostScans = 8000;
constexpr std::size_t kBlocks = 12;  // of pairs: neighbours err alike
// Of readings: the robot's own body; rays at a flat angle.
constexpr double kNearest_m = 0.1, kFarthest_m = 30.0;
constexpr float kBeforeFirst_rad = 1e-3F;   // the first ray's angle, rounded, may lie before it
constexpr int kRounds = 6;                  // of reweighted least squares
constexpr double kSigma_m = 0.04;           // of a wall point's distance, from where it weighs less
constexpr double kTurnSigma_rad = 0.03;     // of odometry's turn against the matched one
constexpr float kReach_m = 0.25F;           // of a pair of points
constexpr double kLongestEstimate_s = 1.0;  // stands for an error where nothing is known
// Searched both ways; steps; half the time that a turn rate is taken over.
constexpr double kLongestDelay_s = 0.4, kDelayStep_s = 0.02, kMotion_s = 0.05;
constexpr double kOdometryGap_s = 0.5;  // that is interpolated over
constexpr double kAgreeing = 0.3;       // share of pairs that odometry must turn alike
constexpr double kClearlyMore = 2.0;    // of true delays of 120 to 160 ms: 3.4 and more; of false ones up to 1.6

double robust(double residual, double sigma) {
  const double odd = 1.0 + residual * residual / (sigma * sigma);
  return 1.0 / (odd * odd);
}

}  // namespace

void SweepEstimator::add_odometry(Stamp stamp, const Pose2& odometry_from_robot) {
  if (decided_ || (!odometry_.empty() && !(odometry_.back().first < stamp))) return;
  Pose2 pose = odometry_from_robot;
  if (!odometry_.empty()) pose.phi = odometry_.back().second.phi + wrap_angle(pose.phi - odometry_.back().second.phi);
  odometry_.emplace_back(stamp, pose);
}

void SweepEstimator::add(Stamp stamp, const PackedScan& scan, const Pose2& local_from_robot, bool matched) {
  if (decided_) return;
  ++scans_;
  if (!seen_.empty() && !(seen_.back().stamp < stamp)) return;
  seen_.push_back({stamp, scan, local_from_robot, matched, std::nullopt});
  // The velocity at a scan is that from the scan before to the scan after it.
  if (seen_.size() >= 3) {
    const SeenScan& before = seen_[seen_.size() - 3];
    SeenScan& middle = seen_[seen_.size() - 2];
    const double seconds = seconds_between(before.stamp, stamp);
    if (before.matched && middle.matched && matched && seconds < 2.0 * kLongestStep_s &&
        *before.scan.geometry == *scan.geometry) {
      const Pose2 motion = between(middle.local_from_robot, local_from_robot),
                  earlier = between(before.local_from_robot, middle.local_from_robot);
      middle.velocity = Pose2((motion.x + earlier.x) / seconds, (motion.y + earlier.y) / seconds,
                              (motion.phi + earlier.phi) / seconds);
      add_pair();
    }
  }
  while (seen_.size() > kMostKept || seconds_between(seen_.front().stamp, stamp) > kWindow_s) seen_.pop_front();
  if (scans_ >= kMostScans || pairs_.size() >= kMostPairs)
    decide(true);
  else if (pairs_.size() >= std::max(kFirstEvaluation, next_evaluation_))
    decide(false);
}

void SweepEstimator::finish() {
  if (!decided_) decide(true);
}

// The newest scan whose velocity is known, with the one before it whose turn rate differs most.
void SweepEstimator::add_pair() {
  const SeenScan& second = seen_[seen_.size() - 2];
  if (last_pair_ && seconds_between(*last_pair_, second.stamp) < kSpacing_s) return;
  const SeenScan* first = nullptr;
  double most = kClearlyOther_rad_s;
  for (std::size_t i = 0; i + 2 < seen_.size(); ++i) {
    const SeenScan& candidate = seen_[i];
    if (!candidate.velocity || seconds_between(candidate.stamp, second.stamp) > kWindow_s) continue;
    const Pose2 apart = between(candidate.local_from_robot, second.local_from_robot);
    if (std::hypot(apart.x, apart.y) > kNear_m || std::abs(apart.phi) > kTurned_rad) continue;
    const double other = std::abs(candidate.velocity->phi - second.velocity->phi);
    if (other > most) {
      most = other;
      first = &candidate;
    }
  }
  if (first == nullptr) return;
  Pair pair{side_of(*first, 100000), side_of(second, kMostPoints), Fan(*first->scan.geometry),
            between(first->local_from_robot, second.local_from_robot)};
  if (pair.first.points.size() < kFewestPoints || pair.second.points.size() < kFewestPoints) return;
  pairs_.push_back(std::move(pair));
  last_pair_ = second.stamp;
}

SweepEstimator::Fan::Fan(const ScanGeometry& geometry)
    : laser_from_robot(geometry.robot_from_laser.q.toRotationMatrix().topLeftCorner<2, 2>().inverse().cast<float>()),
      origin(geometry.robot_from_laser.t.head<2>().cast<float>()),
      first_rad(static_cast<float>(geometry.first_angle_rad)),
      direction(geometry.angle_step_rad > 0.0 ? 1.0F : -1.0F),
      span_rad(static_cast<float>(std::abs(geometry.angle_step_rad) * (geometry.ray_count - 1))) {}

float SweepEstimator::Fan::turned_rad(float x, float y) const {
  constexpr auto kTurn = static_cast<float>(2.0 * M_PI);
  const Eigen::Vector2f ray = laser_from_robot * (Eigen::Vector2f(x, y) - origin);
  const float turned = direction * (std::atan2(ray.y(), ray.x()) - first_rad);
  return turned - kTurn * std::floor((turned + kBeforeFirst_rad) / kTurn);
}

SweepEstimator::Side SweepEstimator::side_of(const SeenScan& seen, std::size_t most) {
  const Fan fan(*seen.scan.geometry);
  auto points = matching::wall_points(seen.scan, kNearest_m, kFarthest_m);
  if (most < points.size()) points = matching::thinned_evenly(points, 0.05, most);
  Side side{seen.stamp, *seen.velocity, {}};
  side.points.reserve(points.size());
  for (const auto& p : points) {
    const float turned = fan.turned_rad(p.x, p.y);
    side.points.push_back({p.x, p.y, p.normal_x, p.normal_y, turned, turned / fan.span_rad - 0.5F});
  }
  std::sort(side.points.begin(), side.points.end(),
            [](const RayPoint& a, const RayPoint& b) { return a.turned_rad < b.turned_rad; });
  return side;
}

// Point to line, each point to the nearest of the other scan, as seen with `sweep_s`; the pose of the pair is kept for
// the next time.
SweepEstimator::Vote SweepEstimator::vote(Pair& pair, double sweep_s, int steps) {
  const auto s = static_cast<float>(sweep_s);
  const auto shift = [](const Side& side, const RayPoint& p) {  // per second of sweep
    const auto vx = static_cast<float>(side.velocity.x), vy = static_cast<float>(side.velocity.y),
               turn = static_cast<float>(side.velocity.phi);
    return Eigen::Vector2f(p.part * (vx - turn * p.y), p.part * (vy + turn * p.x));
  };
  std::vector<Eigen::Vector2f> shifts, places;  // of the first scan's points
  for (const RayPoint& q : pair.first.points) {
    shifts.push_back(shift(pair.first, q));
    places.emplace_back(Eigen::Vector2f(q.x, q.y) + s * shifts.back());
  }
  Vote result;
  for (int step = 0; step < steps; ++step) {
    const Pose2 pose = pair.first_from_second;
    const Eigen::Matrix2f rotation = Eigen::Rotation2Df(static_cast<float>(pose.phi)).toRotationMatrix();
    const Eigen::Vector2f origin(static_cast<float>(pose.x), static_cast<float>(pose.y));
    Eigen::Matrix4d information = Eigen::Matrix4d::Zero();
    Eigen::Vector4d gain = Eigen::Vector4d::Zero();
    std::size_t used = 0;
    for (const RayPoint& p : pair.second.points) {
      const Eigen::Vector2f bent = shift(pair.second, p), turned = rotation * (Eigen::Vector2f(p.x, p.y) + s * bent),
                            place = turned + origin, normal = rotation * Eigen::Vector2f(p.normal_x, p.normal_y);
      const float angle = pair.fan.turned_rad(place.x(), place.y()), range = (place - pair.fan.origin).norm();
      const float window = std::min(1.2F * kReach_m / std::max(range, kReach_m), 0.5F);
      auto at = std::lower_bound(pair.first.points.begin(), pair.first.points.end(), angle - window,
                                 [](const RayPoint& point, float limit) { return point.turned_rad < limit; });
      std::optional<std::size_t> nearest;
      float best = kReach_m * kReach_m;
      for (; at != pair.first.points.end() && at->turned_rad < angle + window; ++at) {
        const auto i = static_cast<std::size_t>(at - pair.first.points.begin());
        const float square = (places[i] - place).squaredNorm();
        if (square < best && at->normal_x * normal.x() + at->normal_y * normal.y() > 0.7F) {
          best = square;
          nearest = i;
        }
      }
      if (!nearest) continue;
      const Eigen::Vector2f across(pair.first.points[*nearest].normal_x, pair.first.points[*nearest].normal_y);
      const double r = across.dot(place - places[*nearest]);
      Eigen::Vector4d slope;
      slope << across.x(), across.y(), across.y() * turned.x() - across.x() * turned.y(),
          across.dot(rotation * bent - shifts[*nearest]);
      const double weight = robust(r, kSigma_m);
      information += weight * slope * slope.transpose();
      gain -= weight * r * slope;
      ++used;
    }
    pair.fits = used >= kFewestPoints;
    if (!pair.fits) return {};
    // A little of a prior: along bare corridors the pose is not determined by the walls.
    information.topLeftCorner<3, 3>() += Eigen::Vector3d(0.1, 0.1, 0.1).asDiagonal();
    const auto solver = information.topLeftCorner<3, 3>().ldlt();
    const Eigen::Vector3d eliminated = solver.solve(information.topRightCorner<3, 1>());
    result.information = information(3, 3) - eliminated.dot(information.topRightCorner<3, 1>());
    result.gain = gain(3) - eliminated.dot(gain.head<3>());
    if (step + 1 == steps) break;
    const Eigen::Vector3d better = solver.solve(gain.head<3>());
    pair.first_from_second = {pose.x + better.x(), pose.y + better.y(), wrap_angle(pose.phi + better.z())};
  }
  return result;
}

// The change that the votes ask for, and how it differs where a block of them is missing.
Estimated SweepEstimator::summed(double value, const std::vector<Vote>& votes) {
  std::vector<Vote> blocks(kBlocks);
  Vote all;
  for (std::size_t i = 0; i < votes.size(); ++i) {
    Vote& block = blocks[i * kBlocks / votes.size()];
    block.information += votes[i].information;
    block.gain += votes[i].gain;
    all.information += votes[i].information;
    all.gain += votes[i].gain;
  }
  if (!(all.information > 1e-9) || !std::isfinite(all.gain)) return {0.0, kLongestEstimate_s};
  double square = 0.0;
  for (const Vote& block : blocks) {
    const double rest = all.information - block.information;
    const double moved = rest > 1e-9 ? (all.gain - block.gain) / rest - all.gain / all.information : kLongestEstimate_s;
    square += moved * moved;
  }
  return {std::clamp(value + all.gain / all.information, -kLongestEstimate_s, kLongestEstimate_s),
          std::sqrt(square * (kBlocks - 1.0) / kBlocks)};
}

std::optional<Pose2> SweepEstimator::odometry_at(Stamp stamp) const {
  const auto later = std::lower_bound(odometry_.begin(), odometry_.end(), stamp,
                                      [](const auto& reading, Stamp s) { return reading.first < s; });
  if (later == odometry_.begin() || later == odometry_.end()) return std::nullopt;
  const auto& [from, before] = *(later - 1);
  const auto& [to, after] = *later;
  const double span = seconds_between(from, to), part = seconds_between(from, stamp) / span;
  if (span > kOdometryGap_s) return std::nullopt;
  return Pose2(before.x + part * (after.x - before.x), before.y + part * (after.y - before.y),
               before.phi + part * (after.phi - before.phi));
}

std::optional<Pose2> SweepEstimator::odometry_velocity(Stamp stamp) const {
  const auto half = static_cast<std::int64_t>(kMotion_s * 1e9);
  const auto before = odometry_at({stamp.ns - half}), after = odometry_at({stamp.ns + half});
  if (!before || !after) return std::nullopt;
  const double turn = after->phi - before->phi, middle = 0.5 * (before->phi + after->phi), dx = after->x - before->x,
               dy = after->y - before->y;
  const double c = std::cos(middle), s = std::sin(middle), rate = 0.5 / kMotion_s;
  return Pose2(rate * (c * dx + s * dy), rate * (c * dy - s * dx), rate * turn);
}

std::optional<double> SweepEstimator::odometry_turn(const Pair& pair, double delay_s) const {
  const auto shift = static_cast<std::int64_t>(delay_s * 1e9);
  const auto first = odometry_at({pair.first.stamp.ns - shift}), second = odometry_at({pair.second.stamp.ns - shift});
  return first && second ? std::optional(second->phi - first->phi) : std::nullopt;
}

// Pairs that odometry turns alike, those without odometry are none of them.
double SweepEstimator::agreement(double delay_s, double turn_scale) const {
  double sum = 0.0;
  for (const Pair& pair : pairs_)
    if (const auto turn = pair.fits ? odometry_turn(pair, delay_s) : std::nullopt)
      sum += robust(wrap_angle(pair.first_from_second.phi - turn_scale * *turn), kTurnSigma_rad);
  return sum;
}

// The delay with which odometry turns as most of the pairs do.
std::optional<double> SweepEstimator::likeliest_delay() const {
  double best_s = 0.0, most = agreement(0.0, 1.0);
  for (double delay_s = -kLongestDelay_s; delay_s <= kLongestDelay_s; delay_s += kDelayStep_s)
    if (const double sum = agreement(delay_s, 1.0); sum > most) {
      most = sum;
      best_s = delay_s;
    }
  return most >= kAgreeing * static_cast<double>(pairs_.size()) ? std::optional(best_s) : std::nullopt;
}

// A delay has to explain many more pairs than none does: where odometry has gaps or slips, a few wrong pairs agree on
// any.
std::optional<SweepEstimate::ByOdometry> SweepEstimator::compare_with_odometry() const {
  const auto start = likeliest_delay();
  if (!start) return std::nullopt;
  const auto late = fitted(*start, true), in_time = fitted(0.0, false);
  if (!late || !in_time) return in_time;
  const double of_late = agreement(late->delay_s.value, late->turn_scale.value),
               of_none = agreement(0.0, in_time->turn_scale.value);
  return of_late > kClearlyMore * of_none ? late : in_time;
}

// Turns of pairs against those of odometry: their delay, if wanted, and their scale together, by Gauss-Newton.
std::optional<SweepEstimate::ByOdometry> SweepEstimator::fitted(double delay_s, bool with_delay) const {
  struct Equations {
    Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
    Eigen::Vector2d gain = Eigen::Vector2d::Zero();
    void operator+=(const Equations& other) {
      information += other.information;
      gain += other.gain;
    }
    Eigen::Vector2d solved() const { return (information + 1e-9 * Eigen::Matrix2d::Identity()).ldlt().solve(gain); }
  };
  Eigen::Vector2d value(delay_s, 1.0), sigma;
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Equations> blocks(kBlocks);
    Equations all;
    for (std::size_t i = 0; i < pairs_.size(); ++i) {
      const Pair& pair = pairs_[i];
      const auto turn = odometry_turn(pair, value.x()), sooner = odometry_turn(pair, value.x() - kMotion_s),
                 later = odometry_turn(pair, value.x() + kMotion_s);
      if (!pair.fits || !turn || (with_delay && !(sooner && later))) continue;
      const Eigen::Vector2d slope(with_delay ? value.y() * 0.5 * (*later - *sooner) / kMotion_s : 0.0, *turn);
      const double missed = wrap_angle(pair.first_from_second.phi - value.y() * *turn),
                   weight = robust(missed, kTurnSigma_rad);
      Equations one;
      one.information = weight * slope * slope.transpose();
      one.gain = weight * missed * slope;
      blocks[i * kBlocks / pairs_.size()] += one;
      all += one;
    }
    const Eigen::Vector2d change = all.solved();
    if (!change.allFinite()) return std::nullopt;
    Eigen::Vector2d square = Eigen::Vector2d::Zero();
    for (const Equations& block : blocks) {
      Equations rest = all;
      rest.information -= block.information;
      rest.gain -= block.gain;
      square += (rest.solved() - change).cwiseAbs2();
    }
    value += change;
    value.x() = std::clamp(value.x(), -kLongestDelay_s, kLongestDelay_s);
    value.y() = std::clamp(value.y(), 0.5, 2.0);
    sigma = (square * ((kBlocks - 1.0) / kBlocks)).cwiseSqrt();
  }
  return SweepEstimate::ByOdometry{{value.x(), sigma.x()}, {value.y(), sigma.y()}};
}

void SweepEstimator::take_velocities_from_odometry(double delay_s, double turn_scale) {
  const auto shift = static_cast<std::int64_t>(delay_s * 1e9);
  for (Pair& pair : pairs_)
    for (Side* side : {&pair.first, &pair.second})
      if (const auto velocity = odometry_velocity({side->stamp.ns - shift})) {
        side->velocity = *velocity;
        side->velocity.phi *= turn_scale;
      }
}

void SweepEstimator::evaluate() {
  estimate_ = {};
  estimate_.pairs = static_cast<int>(pairs_.size());
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Vote> votes;
    for (Pair& pair : pairs_) votes.push_back(vote(pair, estimate_.sweep_s.value, round == 0 ? 6 : 2));
    estimate_.sweep_s = summed(estimate_.sweep_s.value, votes);
    estimate_.by_odometry = compare_with_odometry();
    if (const auto& known = estimate_.by_odometry)
      take_velocities_from_odometry(known->delay_s.value, known->turn_scale.value);
  }
}

void SweepEstimator::decide(bool is_last) {
  enum class Finding { unclear, nothing, something };
  const auto finding = [&](const Estimated& one) {
    const double size = std::abs(one.value);
    if (size >= options_.shortest_s && size > options_.min_sigmas * one.sigma) return Finding::something;
    return size + 3.0 * one.sigma < options_.shortest_s ? Finding::nothing : Finding::unclear;
  };
  decided_ = is_last;
  if (pairs_.size() >= kFewestPairs) {
    evaluate();
    const Finding sweep = finding(estimate_.sweep_s);
    const Finding delay = estimate_.by_odometry ? finding(estimate_.by_odometry->delay_s)
                          : odometry_.empty()   ? Finding::nothing
                                                : Finding::unclear;
    decided_ = is_last || (sweep != Finding::unclear && delay != Finding::unclear);
    if (decided_ && sweep == Finding::something) sweep_s_ = estimate_.sweep_s.value;
    if (decided_ && delay == Finding::something) delay_s_ = estimate_.by_odometry->delay_s.value;
    next_evaluation_ = 2 * pairs_.size();
  }
  if (decided_) {
    pairs_ = {};
    seen_.clear();
    odometry_ = {};
  }
}

}  // namespace mapweave::laser
