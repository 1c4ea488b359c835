#include <mapweave/exporters/trajectory_files.h>

#include "number_text.h"

#include <mapweave/exporters/session_trajectories.h>

#include <algorithm>

namespace mapweave::exporters {
namespace {

// To the nearest microsecond, halves away from zero.
std::int64_t microseconds(Stamp stamp) { return (stamp.ns + (stamp.ns < 0 ? -500 : 500)) / 1000; }

void append_stamp(std::string& text, std::int64_t stamp_us) {
  if (stamp_us < 0) text += '-';
  const std::int64_t size_us = stamp_us < 0 ? -stamp_us : stamp_us;
  const std::string fraction = std::to_string(size_us % 1000000);
  text += std::to_string(size_us / 1000000) + '.' + std::string(6 - fraction.size(), '0') + fraction;
}

std::string text_of(const std::vector<SessionTrajectory>& trajectories) {
  struct Line {
    std::int64_t stamp_us;
    const Pose3* map_from_robot;
  };
  std::vector<Line> lines;
  for (const auto& trajectory : trajectories)
    for (const auto& pose : trajectory.poses) lines.push_back({microseconds(pose.stamp), &pose.map_from_robot});
  // Sessions came in the order of robots: on equal stamps the lower RobotId stays in front.
  std::stable_sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.stamp_us < b.stamp_us; });
  lines.erase(
      std::unique(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.stamp_us == b.stamp_us; }),
      lines.end());

  std::string text;
  for (const auto& line : lines) {
    const Eigen::Vector3d& t = line.map_from_robot->t;
    Eigen::Quaterniond q = line.map_from_robot->q;
    if (q.w() < 0.0) q.coeffs() = -q.coeffs();  // one of the two that mean the same turn
    append_stamp(text, line.stamp_us);
    for (const double value : {t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w()}) {
      text += ' ';
      append_fixed(text, value, 6);
    }
    text += '\n';
  }
  return text;
}

}  // namespace

std::string tum_text(const Map& map) { return text_of(session_trajectories(map)); }

std::string tum_text(const Map& map, RobotId robot) {
  auto trajectories = session_trajectories(map);
  trajectories.erase(
      std::remove_if(trajectories.begin(), trajectories.end(),
                     [&](const SessionTrajectory& trajectory) { return trajectory.session.client.robot != robot; }),
      trajectories.end());
  return text_of(trajectories);
}

std::string tum_text(const std::vector<SessionTrajectory>& trajectories) { return text_of(trajectories); }

std::string tum_text(const std::vector<StampedPose>& poses) { return text_of({{SessionId(), poses}}); }

}  // namespace mapweave::exporters
