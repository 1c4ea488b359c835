#pragma once
// Ways of a robot's cameras that drives half a metre a second along x, 10 frames a second.

#include <mapweave/fusion/robot_way.h>

#include <algorithm>

namespace mapweave::test {

inline Stamp at(double seconds) { return stamp_from_seconds(1000.0 + seconds); }

// Aside: of double(double seconds); by how many metres to the left.
template <class Aside>
fusion::SeenWay straight_way(double begin_s, double end_s, Aside aside_m, double weight = 1.0) {
  fusion::SeenWay way;
  way.weight = weight;
  for (double t = begin_s; t < end_s - 1e-9; t += 0.1)
    way.frames.push_back({at(t), {{0.5 * t, aside_m(t), 0.0}, Eigen::Quaterniond::Identity()}});
  return way;
}

inline double longest_step_m(const std::vector<StampedPose>& way) {  // in a tenth of a second
  double longest = 0.0;
  for (std::size_t i = 1; i < way.size(); ++i)
    longest = std::max(
        longest, (way[i].map_from_robot.t - way[i - 1].map_from_robot.t).norm() / (10.0 * seconds_between(way[i - 1].stamp, way[i].stamp)));
  return longest;
}

inline double aside_m(const std::vector<StampedPose>& way, double seconds) { return pose_at(way, at(seconds), 0.25)->t.y(); }

}  // namespace mapweave::test
