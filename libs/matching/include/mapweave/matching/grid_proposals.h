#pragma once
// Where one occupancy grid may lie on another that somebody else made: similarity transforms, best first. Rotations
// come from the directions of walls (Carpin 2008), for each of them and each scale all shifts are weighed at once by
// Fourier transforms: walls seen from the same side speak for a shift, walls in the other's free space against it.

#include <mapweave/matching/grid_walls.h>

namespace mapweave::matching {

struct PlanarSimilarity {  // point_in_a = scale * R(pose.phi) * point_in_b + (pose.x, pose.y)
  Pose2 pose;
  double scale = 1.0;
};
Point2f transformed(const PlanarSimilarity& a_from_b, Point2f point_in_b);

struct GridProposalOptions {
  double scale_range = 0.15;  // either way from 1
  double scale_step = 0.03;
  int rotations = 8;
  int most = 12;  // proposals
  double contradiction = 0.5;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("scale_range", scale_range, 0.0, 0.3,
             "largest error of a grid's stated resolution that is searched, as a share up or down; larger values align "
             "grids with worse resolutions and take longer; 0 searches one scale alone");
    v.number("scale_step", scale_step, 0.005, 0.1,
             "step between two scales that are searched, as a share; larger values are faster and may miss the scale");
    v.integer("rotations", rotations, 1, 72,
              "number of rotations of one grid against the other that are searched: those that best explain the "
              "directions of walls in both; larger values miss fewer alignments and take longer");
    v.non_negative("contradiction", contradiction,
                   "weight of a wall that lies in the other grid's free space, relative to one that lies on a wall; "
                   "larger values suit grids of one day, where furniture has not moved");
    v.integer("most", most, 1, 100,
              "number of proposed alignments that are refined and verified for each pair of grids; larger values miss "
              "fewer places and "
              "take longer");
  }
};

struct GridProposal {
  PlanarSimilarity a_from_b;
  double score = 0.0;  // faces that coincide less those that contradict; comparable for one pair of grids
};

// Distinct ones: 2.5 m or 8 degrees apart. Fourier transforms of at most 1024 x 1024, whatever the extent of the grids.
std::vector<GridProposal> propose_alignments(const GridWalls& a, const GridWalls& b,
                                             const GridProposalOptions& options = {});

}  // namespace mapweave::matching
