#include "motion_tracks.h"

#include <algorithm>
#include <cmath>

namespace mapweave::laser {
namespace {

constexpr double kLongestExtrapolation_s = 0.5;
// Over which its speed is taken: readings that came in a bunch may be stamped microseconds apart.
constexpr double kShortestBase_s = 0.05;
constexpr double kLongestTurnAhead_s = 0.05;  // beyond the last reading: a robot begins to turn within less than 0.2 s
constexpr std::size_t kFewestReadings = 64;
constexpr double kKept_s = 2.0;  // before the latest reading: scans may be stamped late

Pose2 scaled(const Pose2& motion, double factor) { return {motion.x * factor, motion.y * factor, motion.phi * factor}; }

}  // namespace

void OdometryTrack::add(Stamp stamp, const Pose2& odometry_from_robot) {
  if (!readings_.empty() && !(readings_.back().first < stamp)) {
    if (readings_.back().first == stamp) readings_.back().second = odometry_from_robot;
    return;
  }
  readings_.emplace_back(stamp, odometry_from_robot);
  while (readings_.size() > kFewestReadings && seconds_between(readings_.front().first, stamp) > kKept_s)
    readings_.pop_front();
}

std::optional<Pose2> OdometryTrack::at(Stamp stamp) const {
  if (readings_.empty() || stamp < readings_.front().first) return std::nullopt;
  const auto after = std::lower_bound(readings_.begin(), readings_.end(), stamp,
                                      [](const auto& reading, Stamp s) { return reading.first < s; });
  if (after != readings_.end() && after->first == stamp) return after->second;
  if (after == readings_.end()) return ahead(stamp);
  const auto earlier = after - 1;
  const double span = seconds_between(earlier->first, after->first);
  return compose(earlier->second,
                 scaled(between(earlier->second, after->second), seconds_between(earlier->first, stamp) / span));
}

std::optional<Pose2> OdometryTrack::ahead(Stamp stamp) const {
  const auto& [last, pose] = readings_.back();
  if (seconds_between(last, stamp) > kLongestExtrapolation_s) return std::nullopt;
  auto earlier = readings_.end() - 1;
  double span = 0.0;
  while (earlier != readings_.begin() && span < kShortestBase_s) {
    --earlier;
    span = seconds_between(earlier->first, last);
  }
  // Going on as before only where "before" is recent.
  if (span < kShortestBase_s || span > kLongestExtrapolation_s) return pose;
  return compose(earlier->second,
                 scaled(between(earlier->second, pose), seconds_between(earlier->first, stamp) / span));
}

std::optional<Stamp> OdometryTrack::latest() const {
  return readings_.empty() ? std::nullopt : std::optional<Stamp>(readings_.back().first);
}

void InertialTrack::add(Stamp stamp, double yaw_rad) {
  if (!readings_.empty() && !(readings_.back().first < stamp)) return;
  readings_.emplace_back(stamp, yaw_rad);
  if (readings_.size() > 256) readings_.pop_front();
}

std::optional<double> InertialTrack::at(Stamp stamp) const {
  if (readings_.size() < 2 || stamp < readings_.front().first) return std::nullopt;
  auto later = std::lower_bound(readings_.begin(), readings_.end(), stamp,
                                [](const auto& reading, Stamp s) { return reading.first < s; });
  if (later == readings_.end()) {
    --later;
    if (seconds_between(later->first, stamp) > kLongestTurnAhead_s) return std::nullopt;
  }
  if (later == readings_.begin()) return later->second;
  const auto earlier = later - 1;
  const double span = seconds_between(earlier->first, later->first);
  if (span > kInertialGap_s) return std::nullopt;
  return earlier->second + (later->second - earlier->second) * seconds_between(earlier->first, stamp) / span;
}

std::optional<double> InertialTrack::turn(Stamp from, Stamp to) const {
  const auto before = at(from), after = at(to);
  return before && after ? std::optional(*after - *before) : std::nullopt;
}

std::optional<Stamp> InertialTrack::latest() const {
  return readings_.empty() ? std::nullopt : std::optional<Stamp>(readings_.back().first);
}

}  // namespace mapweave::laser
