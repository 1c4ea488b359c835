#pragma once
// An L-shaped room drawn as points, for matchers: no symmetry, so there is one answer.

#include <mapweave/matching/wall_field.h>

namespace mapweave::matching {

inline std::vector<Point2f> room(float step = 0.03F) {
  std::vector<Point2f> points;
  const auto line = [&](float x0, float y0, float x1, float y1) {
    const float length = std::hypot(x1 - x0, y1 - y0);
    for (float t = 0; t < length; t += step) points.push_back({x0 + (x1 - x0) * t / length, y0 + (y1 - y0) * t / length});
  };
  line(0, 0, 6, 0), line(6, 0, 6, 2.5F), line(6, 2.5F, 3, 2.5F), line(3, 2.5F, 3, 5), line(3, 5, 0, 5), line(0, 5, 0, 0), line(1, 1, 1.7F, 1.2F);
  return points;
}

// The room as seen from a robot at this pose in the room's frame.
inline std::vector<Point2f> seen_from(const std::vector<Point2f>& points, const Pose2& room_from_robot) {
  const Pose2 robot_from_room = inverse(room_from_robot);
  const double c = std::cos(robot_from_room.phi), s = std::sin(robot_from_room.phi);
  std::vector<Point2f> seen;
  for (const auto& p : points)
    seen.push_back({static_cast<float>(robot_from_room.x + c * p.x - s * p.y), static_cast<float>(robot_from_room.y + s * p.x + c * p.y)});
  return seen;
}

}  // namespace mapweave::matching
