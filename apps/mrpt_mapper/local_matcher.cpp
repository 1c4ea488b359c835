#include "local_matcher.h"

#include <mrpt/poses/CPosePDF.h>

#include <cmath>

namespace mapweave::mrpt_mapper {
namespace {

constexpr std::size_t kKeyScans = 12;
constexpr double kKeyDistance_m = 0.4, kKeyTurn_rad = 0.3, kPointDistance_m = 0.03;
constexpr double kGoodMatch = 0.75, kBearableMatch = 0.4;  // shares of paired points
constexpr double kTurns_rad[] = {0.0, 0.2, -0.2, 0.45, -0.45, 0.75, -0.75};

}  // namespace

std::optional<Pose2> LocalMatcher::place(const mrpt::obs::CObservation2DRangeScan& scan,
                                         const Pose2& last_from_this_guess) {
  auto points = points_of(scan, kPointDistance_m);
  const Pose2 guess = compose(local_from_last_, last_from_this_guess), before = local_from_last_;
  local_from_last_ = guess;
  if (points.empty()) return std::nullopt;
  if (key_scans_.empty()) {
    remember(guess, std::move(points));
    return std::nullopt;
  }
  auto parameters = icp_parameters({});
  parameters.skip_cov_calculation = true;
  mrpt::slam::CICP icp(parameters);
  double goodness = 0.0;
  for (const double turn : kTurns_rad) {
    mrpt::slam::CICP::TReturnInfo info;
    const auto answer = icp.Align(&reference_, &points, mrpt::poses::CPose2D(guess.x, guess.y, guess.phi + turn), info);
    const Pose2 pose = answer->getMeanVal().asTPose();
    if (info.goodness > goodness && is_finite(pose)) {
      local_from_last_ = pose;
      goodness = info.goodness;
    }
    if (goodness >= kGoodMatch || !search_turns_) break;
  }
  const bool fits = goodness >= kBearableMatch;
  if (!fits) local_from_last_ = guess;
  const Pose2 answer = between(before, local_from_last_);
  const Pose2 from_key = between(key_scans_.back().local_from_robot, local_from_last_);
  if (std::hypot(from_key.x, from_key.y) > kKeyDistance_m || std::abs(from_key.phi) > kKeyTurn_rad)
    remember(local_from_last_, std::move(points));
  if (!fits) return std::nullopt;
  return answer;
}

void LocalMatcher::remember(const Pose2& local_from_robot, mrpt::maps::CSimplePointsMap points) {
  key_scans_.push_back({local_from_robot, std::move(points)});
  if (key_scans_.size() > kKeyScans) key_scans_.pop_front();
  reference_.clear();
  for (const KeyScan& key : key_scans_)
    reference_.insertAnotherMap(&key.points, mrpt::poses::CPose3D(mrpt::poses::CPose2D(key.local_from_robot)));
}

void LocalMatcher::forget() {
  key_scans_.clear();
  local_from_last_ = {};
}

}  // namespace mapweave::mrpt_mapper
