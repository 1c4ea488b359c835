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

std::vector<StampedPose> by_stamp(std::vector<StampedPose> poses) {
  std::stable_sort(poses.begin(), poses.end(),
                   [](const StampedPose& a, const StampedPose& b) { return a.stamp < b.stamp; });
  return poses;
}

}  // namespace

std::string tum_text(const std::vector<StampedPose>& poses) {
  struct Line {
    std::int64_t stamp_us;
    const Pose3* map_from_robot;
  };
  std::vector<Line> lines;
  for (const auto& pose : poses) lines.push_back({microseconds(pose.stamp), &pose.map_from_robot});
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

std::string tum_text(const Map& map, RobotId robot) {
  std::vector<StampedPose> poses;
  for (const SessionTrajectory& session : session_trajectories(map))
    if (session.session.client.robot == robot) poses.insert(poses.end(), session.poses.begin(), session.poses.end());
  return tum_text(poses);
}

std::string kitti_text(const std::vector<StampedPose>& poses) {
  std::string text;
  for (const StampedPose& pose : by_stamp(poses)) {
    const Eigen::Matrix3d rotation = pose.map_from_robot.q.toRotationMatrix();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        append_fixed(text, rotation(row, column), 9);
        text += ' ';
      }
      append_fixed(text, pose.map_from_robot.t[row], 6);
      text += row < 2 ? ' ' : '\n';
    }
  }
  return text;
}

std::string kitti_times_text(const std::vector<StampedPose>& poses) {
  std::string text;
  for (const StampedPose& pose : by_stamp(poses)) {
    append_stamp(text, microseconds(pose.stamp));
    text += '\n';
  }
  return text;
}

std::string euroc_text(const std::vector<StampedPose>& poses) {
  std::string text =
      "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], p_RS_R_z [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []\n";
  for (const StampedPose& pose : by_stamp(poses)) {
    const Eigen::Vector3d& t = pose.map_from_robot.t;
    const Eigen::Quaterniond& q = pose.map_from_robot.q;
    text += std::to_string(pose.stamp.ns);
    for (const double value : {t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()}) {
      text += ',';
      append_fixed(text, value, 6);
    }
    text += '\n';
  }
  return text;
}

}  // namespace mapweave::exporters
