#pragma once
// Do two occupancy grids of other makers show the same place, and how do they lie? Proposals are refined, bent and
// compared by all the walls of both grids: with each other, and with how well one grid fits the other's mirror image,
// which shows what chance can do in such a building.

#include <mapweave/maps/judgement.h>
#include <mapweave/maps/map.h>
#include <mapweave/matching/grid_proposals.h>

#include <memory>
#include <string>
#include <vector>

namespace mapweave::fusion {

struct GridPairOptions {
  matching::GridProposalOptions proposals;
  int mirrored = 12;
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("proposals", proposals, "search for alignments of two occupancy grids");
    v.integer("mirrored", mirrored, 1, 100,
              "number of alignments of the mirrored grid, wrong by construction, that the best alignment must beat; "
              "larger values judge "
              "chance agreement better and take longer");
  }
};

// One proposal, refined and bent. Lengths of wall in metres; first of a's walls, then of b's.
struct GridVerification {
  matching::PlanarSimilarity a_from_b;     // refined, before bending
  double fit_m[2] = {0.0, 0.0};            // that coincide with walls of the other, seen from the same side
  double conflict_m[2] = {0.0, 0.0};       // that lie in free space of the other
  double contradiction_m[2] = {0.0, 0.0};  // the most of it within one tile of 5 m
  double overlap = 0.0;    // of the smaller grid's walls, the share that lies where the other knows something
  double bend_chi2 = 0.0;  // of the bends that it took, under the stiffness of real grids
  // What fits, each piece of wall by how seldom it does so under the other placements, less what conflicts, by how
  // little of it the best placements need.
  double support_m = 0.0;
  double probability = 0.0;  // by itself, whatever rivals there are
  std::vector<PairHypothesis::ContradictedWall>
      conflicts;  // walls of either that lie in free space of the other, in a's frame; longest first
  double mean_fit_m() const { return 0.5 * (fit_m[0] + fit_m[1]); }
  double mean_conflict_m() const { return 0.5 * (conflict_m[0] + conflict_m[1]); }
};

// What holds the two grids together at one place, for a joint graph that bends both.
struct GridConstraint {
  Eigen::Vector2d place_in_b;
  Pose2 a_from_place;           // b's axes there
  Eigen::Matrix3d information;  // x, y, yaw in the axes of b at the place
};

struct GridPairResult {
  std::optional<Alignment>
      alignment;  // the best, also where it is not believed; rigid, right in the middle of what is shared
  double probability = 0.0;
  Reason reason = Reason::none;  // none: the grids are merged
  std::string note;              // the reason in words, with numbers
  Evidence evidence;
  double wall_m = 0.0;                           // of the grid that shows less of it
  std::vector<GridConstraint> grid_constraints;  // where the grids join
  std::vector<GridVerification> hypotheses;      // best first
  std::vector<GridVerification> images;          // of the mirror image, best first
};

struct PreparedGrid;
// Thread-safe once made.
std::shared_ptr<const PreparedGrid> prepare_grid(const OccupancyGrid&);
// The same from either side, but for the direction of the transform. Pure; one thread. Grids join from
// `merge_probability` on.
GridPairResult align_grids(const PreparedGrid& a, const PreparedGrid& b, const GridPairOptions& options = {},
                           double merge_probability = 0.95);
GridPairResult align_grids(const OccupancyGrid& a, const OccupancyGrid& b, const GridPairOptions& options = {},
                           double merge_probability = 0.95);
// How well the walls fit where others (a third grid) say that b lies, to 1.5 m. Without support_m.
GridVerification verify_alignment(const PreparedGrid& a, const PreparedGrid& b,
                                  const matching::PlanarSimilarity& a_from_b, const GridPairOptions& options = {});

// The constraints between two maps that map_of_grid() made, between the nodes that hold the places; of kind
// between_maps.
std::vector<Constraint> constraints_of(const std::vector<GridConstraint>& grid_constraints, const Map& a, const Map& b,
                                       const Hash& because);

}  // namespace mapweave::fusion
