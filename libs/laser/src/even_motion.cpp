#include "even_motion.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

namespace mapweave::laser {
namespace {

constexpr int kKnots = 20;                                  // of the motion during a sweep
constexpr double kMatters_rad = 0.002, kMatters_m = 0.004;  // half of what a match resolves
constexpr double kEdge = 0.1;                               // of the range, from ray to ray
constexpr double kFarthest_rays = 40.0;                     // that a ray may move; farther, odometry is absurd

// How the robot moved during a sweep: straight from knot to knot.
class SweepTrack {
 public:
  SweepTrack(const ScanGeometry& geometry, const std::function<std::optional<Pose2>(double)>& stamp_from_robot)
      : first_s_(geometry.ray_time_s(0)),
        step_s_((geometry.ray_time_s(geometry.ray_count - 1) - first_s_) / (kKnots - 1)) {
    for (int i = 0; i < kKnots; ++i) {
      const auto knot = stamp_from_robot(first_s_ + i * step_s_);
      if (!knot || !is_finite(*knot)) return;
      knots_.push_back(*knot);
    }
    is_known_ = true;
  }

  bool is_known() const { return is_known_; }

  bool is_even(const SweepMotion& motion) const {
    for (int i = 0; i < kKnots; ++i) {
      const Pose2 apart = between(moved(motion, first_s_ + i * step_s_), knots_[static_cast<std::size_t>(i)]);
      if (std::abs(apart.phi) > kMatters_rad || std::hypot(apart.x, apart.y) > kMatters_m) return false;
    }
    return true;
  }

  Pose2 at(double seconds) const {
    const double place = std::clamp((seconds - first_s_) / step_s_, 0.0, kKnots - 1.0);
    const auto knot = std::min(static_cast<std::size_t>(place), std::size_t{kKnots - 2});
    const double share = place - static_cast<double>(knot);
    const Pose2 &a = knots_[knot], &b = knots_[knot + 1];
    return {a.x + share * (b.x - a.x), a.y + share * (b.y - a.y), a.phi + share * wrap_angle(b.phi - a.phi)};
  }

 private:
  double first_s_, step_s_;
  std::vector<Pose2> knots_;
  bool is_known_ = false;
};

Eigen::Vector2d placed(const Pose2& pose, const Eigen::Vector2d& point) {
  return Eigen::Vector2d(pose.x, pose.y) + Eigen::Rotation2Dd(pose.phi) * point;
}

// A reading as even motion would have brought it.
struct Reading {
  double ray = 0.0, range_m = 0.0;
};

class Evening {
 public:
  Evening(const PackedScan& scan, const SweepTrack& track)
      : scan_(scan),
        geometry_(*scan.geometry),
        track_(track),
        robot_from_laser_(geometry_.robot_from_laser.q.toRotationMatrix().topLeftCorner<2, 2>()),
        laser_from_robot_(robot_from_laser_.inverse()),
        laser_in_robot_(geometry_.robot_from_laser.t.head<2>()) {}

  Reading reading(std::size_t ray) const {
    const double range = scan_.ranges[ray] * geometry_.range_unit_m, angle = angle_of(static_cast<double>(ray));
    const Eigen::Vector2d in_robot =
        laser_in_robot_ + robot_from_laser_ * (range * Eigen::Vector2d(std::cos(angle), std::sin(angle)));
    const Eigen::Vector2d at_stamp = placed(track_.at(geometry_.ray_time_s(ray)), in_robot);
    Reading result{static_cast<double>(ray), range};
    for (int round = 0; round < 2; ++round) {  // the ray that sees it is measured at another time
      const double seconds = geometry_.first_ray_s + result.ray * geometry_.ray_step_s;
      const Eigen::Vector2d point =
          laser_from_robot_ * (placed(inverse(moved(scan_.motion, seconds)), at_stamp) - laser_in_robot_);
      result.range_m = point.norm();
      result.ray =
          static_cast<double>(ray) + wrap_angle(std::atan2(point.y(), point.x()) - angle) / geometry_.angle_step_rad;
    }
    return result;
  }

 private:
  double angle_of(double ray) const { return geometry_.first_angle_rad + ray * geometry_.angle_step_rad; }

  const PackedScan& scan_;
  const ScanGeometry& geometry_;
  const SweepTrack& track_;
  Eigen::Matrix2d robot_from_laser_, laser_from_robot_;
  Eigen::Vector2d laser_in_robot_;
};

// The ranges of a scan, filled by readings between its rays.
class Refilled {
 public:
  explicit Refilled(const ScanGeometry& geometry) : geometry_(geometry), ranges_(geometry.ray_count, 0) {}

  void add(const Reading& reading) {
    const double nearest = std::round(reading.ray);
    set(nearest, reading.range_m);
  }

  // A wall from one reading to the next: the inverse of the range is nearly linear along it.
  void add_wall(Reading one, Reading other) {
    if (std::abs(one.range_m - other.range_m) > kEdge * std::min(one.range_m, other.range_m)) return;
    if (other.ray < one.ray) std::swap(one, other);
    for (double ray = std::ceil(one.ray); ray <= other.ray; ++ray) {
      const double share = other.ray > one.ray ? (ray - one.ray) / (other.ray - one.ray) : 0.0;
      set(ray, 1.0 / ((1.0 - share) / one.range_m + share / other.range_m));
    }
  }

  std::vector<std::uint16_t> ranges() && { return std::move(ranges_); }

 private:
  void set(double ray, double range_m) {
    if (!(ray >= 0.0 && ray < static_cast<double>(ranges_.size())) || !(range_m < geometry_.max_range_m)) return;
    ranges_[static_cast<std::size_t>(ray)] =
        static_cast<std::uint16_t>(std::clamp(std::round(range_m / geometry_.range_unit_m), 1.0, 65535.0));
  }

  const ScanGeometry& geometry_;
  std::vector<std::uint16_t> ranges_;
};

}  // namespace

bool even_out(PackedScan& scan, const std::function<std::optional<Pose2>(double)>& stamp_from_robot) {
  const ScanGeometry& geometry = *scan.geometry;
  if (!geometry.has_sweep() || geometry.ray_count < 2 || geometry.ray_step_s == 0.0) return false;
  const SweepTrack track(geometry, stamp_from_robot);
  if (!track.is_known() || track.is_even(scan.motion)) return false;
  const Evening evening(scan, track);
  std::vector<std::optional<Reading>> readings(scan.ranges.size());
  Refilled refilled(geometry);
  for (std::size_t ray = 0; ray < readings.size(); ++ray) {
    if (scan.ranges[ray] == 0) continue;
    readings[ray] = evening.reading(ray);
    if (!(std::abs(readings[ray]->ray - static_cast<double>(ray)) < kFarthest_rays)) return false;
    refilled.add(*readings[ray]);
  }
  for (std::size_t ray = 0; ray + 1 < readings.size(); ++ray)
    if (readings[ray] && readings[ray + 1]) refilled.add_wall(*readings[ray], *readings[ray + 1]);
  scan.ranges = std::move(refilled).ranges();
  return true;
}

}  // namespace mapweave::laser
