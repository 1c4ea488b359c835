#include "motion_tracks.h"

#include <algorithm>
#include <cmath>

namespace mapweave::laser {
namespace {

constexpr double kLongestExtrapolation_s = 0.5;
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
  const auto later = after != readings_.end() ? after : readings_.end() - 1;
  if (after == readings_.end() &&
      (readings_.size() < 2 || seconds_between(later->first, stamp) > kLongestExtrapolation_s)) {
    return seconds_between(later->first, stamp) <= kLongestExtrapolation_s ? std::optional<Pose2>(later->second)
                                                                           : std::nullopt;
  }
  const auto earlier = later - 1;
  const double span = seconds_between(earlier->first, later->first);
  const double share = seconds_between(earlier->first, stamp) / span;
  // Going on as before only where "before" is recent.
  if (after == readings_.end() && span > kLongestExtrapolation_s) return later->second;
  return compose(earlier->second, scaled(between(earlier->second, later->second), share));
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
