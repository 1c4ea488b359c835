#pragma once
// An L-shaped room drawn as points, for matchers: no symmetry, so there is one answer.

#include <mapweave/matching/wall_field.h>

namespace mapweave::matching {

// Seen from inside.
inline std::vector<WallPoint> room(float step = 0.03F) {
  std::vector<WallPoint> points;
  const auto line = [&](float x0, float y0, float x1, float y1) {
    const float length = std::hypot(x1 - x0, y1 - y0);
    for (float t = 0; t < length; t += step)
      points.push_back(
          {x0 + (x1 - x0) * t / length, y0 + (y1 - y0) * t / length, (y0 - y1) / length, (x1 - x0) / length});
  };
  line(0, 0, 6, 0);
  line(6, 0, 6, 2.5F);
  line(6, 2.5F, 3, 2.5F);
  line(3, 2.5F, 3, 5);
  line(3, 5, 0, 5);
  line(0, 5, 0, 0);
  line(1, 1, 1.7F, 1.2F);
  return points;
}

// The room as seen from a robot at this pose in the room's frame.
inline std::vector<WallPoint> seen_from(const std::vector<WallPoint>& points, const Pose2& room_from_robot) {
  return placed(inverse(room_from_robot), points);
}

}  // namespace mapweave::matching
