#include "trajectory_policy.h"

#include <algorithm>

namespace mapweave::rig {

Pose3 mean(const std::vector<CameraVote>& votes) {
  Eigen::Vector3d t = Eigen::Vector3d::Zero();
  Eigen::Vector4d q = Eigen::Vector4d::Zero();
  double sum = 0.0;
  for (const CameraVote& vote : votes) {
    const Eigen::Vector4d turn = vote.pose.q.coeffs();
    t += vote.weight * vote.pose.t;
    sum += vote.weight;
    q += vote.weight * (turn.dot(votes.front().pose.q.coeffs()) < 0.0 ? -turn : turn);
  }
  return {t / sum, Eigen::Quaterniond(q.normalized())};
}

std::vector<CameraVote> TrajectoryPolicy::believed(Stamp stamp, const std::vector<CameraVote>& votes,
                                                   const OdometryAt& odometry) {
  std::vector<CameraVote> chosen = votes;
  double widest = 0.0;
  for (const CameraVote& a : votes)
    for (const CameraVote& b : votes) widest = std::max(widest, apart(a.pose, b.pose));
  if (widest > 1.0) chosen = majority(stamp, votes, odometry);
  const StampedPose now{stamp, mean(chosen)};
  constexpr double kClose = 0.5;  // of the doubt: cameras agree clearly
  if (widest < kClose || !agreed_) agreed_ = now;
  before_last_ = last_;
  last_ = now;
  return chosen;
}

double TrajectoryPolicy::apart(const Pose3& a, const Pose3& b) const {
  return std::max((a.t - b.t).norm() / options_.doubt_m, a.q.angularDistance(b.q) / options_.doubt_rad);
}

// The largest group that agrees with one of them; where that is no majority, those around the one nearest to the
// expected pose.
std::vector<CameraVote> TrajectoryPolicy::majority(Stamp stamp, const std::vector<CameraVote>& votes,
                                                   const OdometryAt& odometry) const {
  std::vector<std::vector<CameraVote>> around(votes.size());
  for (std::size_t i = 0; i < votes.size(); ++i)
    for (const CameraVote& other : votes)
      if (apart(votes[i].pose, other.pose) <= 1.0) around[i].push_back(other);
  std::size_t best = 0;
  for (std::size_t i = 1; i < votes.size(); ++i)
    if (around[i].size() > around[best].size()) best = i;
  if (2 * around[best].size() > votes.size()) return around[best];
  if (const auto there = expected(stamp, odometry))
    for (std::size_t i = 0; i < votes.size(); ++i)
      if (apart(votes[i].pose, *there) < apart(votes[best].pose, *there)) best = i;
  return around[best];
}

std::optional<Pose3> TrajectoryPolicy::expected(Stamp stamp, const OdometryAt& odometry) const {
  if (agreed_ && seconds_between(agreed_->stamp, stamp) < options_.odometry_s) {
    const auto then = odometry(agreed_->stamp), now = odometry(stamp);
    if (then && now) return compose(agreed_->map_from_robot, between(*then, *now));
  }
  if (!last_) return std::nullopt;
  if (!before_last_) return last_->map_from_robot;
  const double span = seconds_between(before_last_->stamp, last_->stamp),
               further = seconds_between(last_->stamp, stamp);
  if (further > options_.longest_gap_s) return last_->map_from_robot;
  return interpolated(before_last_->map_from_robot, last_->map_from_robot, 1.0 + further / span);
}

}  // namespace mapweave::rig
