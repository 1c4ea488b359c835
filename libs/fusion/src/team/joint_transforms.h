#pragma once
// Stage 4, first half: where all maps of a component lie in one frame, and which joins contradict the others. A small
// non-linear program: poses of the maps, and for each join a switch between 0 and 1 that can turn it off at a price
// (Suenderhauf and Protzel, IROS 2012), solved by Ipopt.

#include <mapweave/core/geometry.h>

#include <cstddef>
#include <vector>

namespace mapweave::fusion {

// What a join says, at one place: point b of map b lies on point a of map a, and b's frame is turned by yaw in a's.
struct JoinTerm {
  double a_x, a_y, b_x, b_y, yaw;
  double weight;  // 1/m^2; of the yaw: times 1 m^2 / (0.2 rad)^2
};

struct Join {
  std::size_t a = 0, b = 0;  // numbers of maps
  double strength = 1.0;     // price of turning it off
  std::vector<JoinTerm> terms;
};

struct JointTransforms {
  std::vector<Pose2> team_from_map;
  std::vector<double> switches;  // per join, 0..1
  bool converged = false;
};

// Map 0 stays at the origin. Every map is reached from it through joins (contract). Ipopt is not re-entrant here: calls
// are serialised within.
JointTransforms solve_joint_transforms(std::size_t maps, const std::vector<Join>& joins,
                                       const std::vector<Pose2>& start);

}  // namespace mapweave::fusion
