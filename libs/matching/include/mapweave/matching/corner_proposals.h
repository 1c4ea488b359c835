#pragma once
// Where one map of walls may lie on another, by their corners: a corner has a place, a direction and a kind (into the
// room or out of it), so that each pair of corners alike says how the maps lie. What many pairs say is laid on by
// PCL's planar estimation, then refined by its iterative closest point on wall points.

#include <mapweave/matching/grid_walls.h>

namespace mapweave::matching {

// Where two walls meet.
struct WallCorner {
  Point2f at;
  double direction_rad = 0.0;  // half way between the normals of the two walls: to the free side
  double opening_rad = 0.0;    // between the normals, 0 to pi
  bool is_outer = false;       // the walls stick out into the room
};

// The ones with the longest walls, at most `most`, in the frame of the walls.
std::vector<WallCorner> corners_of(const GridWalls&, std::size_t most = 300);

struct CornerProposal {
  Pose2 a_from_b;
  double score_m = 0.0;  // walls of the two that coincide, less those in the other's free space
};

// Distinct ones (2.5 m or 8 degrees apart), best first, at most `most`. `contradiction`: weight of walls that lie in
// free space. Takes about the product of the numbers of corners.
std::vector<CornerProposal> propose_by_corners(const GridWalls& a, const GridWalls& b, std::size_t most,
                                               double contradiction);

}  // namespace mapweave::matching
