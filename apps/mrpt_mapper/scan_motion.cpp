#include "scan_motion.h"

#include <cmath>

namespace mapweave::mrpt_mapper {
namespace {

constexpr double kPatience_s = 1.0;
constexpr std::size_t kMostWaiting = 200;  // where stamps do not go on

Pose2 interpolated(const Pose2& a, const Pose2& b, double share) {
  const Pose2 motion = between(a, b);
  return compose(a, {motion.x * share, motion.y * share, motion.phi * share});
}

}  // namespace

void ScanMotion::add_odometry(Stamp stamp, const Pose2& odometry_from_robot) {
  if (latest_ && stamp < latest_->stamp) return;
  earlier_ = latest_;
  latest_ = Reading{stamp, odometry_from_robot};
  while (!waiting_.empty() && waiting_.front().stamp <= stamp) {
    Waiting scan = std::move(waiting_.front());
    waiting_.pop_front();
    if (scan.stamp == stamp)
      release(std::move(scan), odometry_from_robot);
    else if (earlier_ && earlier_->stamp <= scan.stamp)
      release(std::move(scan),
              interpolated(earlier_->odometry_from_robot, odometry_from_robot,
                           seconds_between(earlier_->stamp, scan.stamp) / seconds_between(earlier_->stamp, stamp)));
    else
      release(std::move(scan), std::nullopt);
  }
}

void ScanMotion::add_scan(Stamp stamp, PackedScan scan) {
  while (!waiting_.empty() &&
         (seconds_between(waiting_.front().stamp, stamp) > kPatience_s || waiting_.size() >= kMostWaiting)) {
    Waiting old = std::move(waiting_.front());
    waiting_.pop_front();
    release(std::move(old), std::nullopt);
  }
  if (waiting_.empty() && latest_ && latest_->stamp == stamp)
    release({stamp, std::move(scan)}, latest_->odometry_from_robot);
  else
    waiting_.push_back({stamp, std::move(scan)});
}

void ScanMotion::finish() {
  for (; !waiting_.empty(); waiting_.pop_front()) {
    const bool near = latest_ && std::abs(seconds_between(latest_->stamp, waiting_.front().stamp)) < kPatience_s;
    release(std::move(waiting_.front()), near ? std::optional(latest_->odometry_from_robot) : std::nullopt);
  }
}

void ScanMotion::release(Waiting waiting, std::optional<Pose2> odometry_from_robot) {
  MovedScan moved{waiting.stamp, std::move(waiting.scan), nullptr, {}, false};
  moved.observation = observation_of(moved.scan, moved.stamp);
  moved.by_wheels = odometry_from_robot && last_odometry_;
  if (moved.by_wheels)
    moved.previous_from_this = between(*last_odometry_, *odometry_from_robot);
  else if (const auto matched = matcher_.place(*moved.observation, last_motion_))
    moved.previous_from_this = *matched;
  else if (released_any_)
    moved.previous_from_this = last_motion_;  // it goes on as it went
  if (odometry_from_robot) matcher_.forget();
  last_motion_ = moved.previous_from_this;
  last_odometry_ = odometry_from_robot;
  released_any_ = true;
  sink_(moved);
}

}  // namespace mapweave::mrpt_mapper
