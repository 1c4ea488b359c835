#pragma once
// The audit of a team map: what its robots saw of each other's walls, everywhere, by pairs and regions. Right maps
// agree in every region but for what moved; where one lies wrongly it draws ghosts, in one region first.

#include "wall_agreement.h"

#include <functional>
#include <optional>

namespace mapweave::fusion {

struct AuditedPair {
  std::size_t a = 0, b = 0;  // places of the maps in the team, a < b
  double coinciding_m = 0.0, contradicted_m = 0.0, unclear_m = 0.0;
  std::vector<Contradiction> contradictions;  // longest first; those over 0.6 m
  double ghosts_m = 0.0;                      // contradicted and unclear, in regions where they are too many
  double ghost_x_m = 0.0, ghost_y_m = 0.0;    // the middle of the region with most of them, team frame
};

struct TeamAudit {
  std::vector<AuditedPair> pairs;        // that saw something of each other's walls
  std::optional<std::size_t> taken_out;  // the map that is contradicted most, where there are ghosts
};

// A place at which one map would lie better elsewhere on another one.
struct BentRegion {
  std::size_t a = 0, b = 0;     // places of the maps in the team, a < b
  double x_m = 0.0, y_m = 0.0;  // middle, team frame
  Pose2 moved;                  // of the team's plane: what a's walls need to lie on b's there
};

// What is in doubt in one region from which it is a ghost: metres, and a share of what coincides. In regions of right
// team maps of public logs it is at most a tenth of what coincides, or 2 m, and a quarter where a partition was moved
// (fhw); where a map lies wrongly, 0.4 to 16 times what coincides.
struct GhostBounds {
  double length_m = 4.0, share = 0.25;
  // The same of what is contradicted in a small square, where a car or both faces of a partition that moved may be most
  // of what coincides: up to 12 m were seen in right team maps of public logs.
  double small_length_m = 12.0, small_share = 0.3;
};
// Of a team whose scans are still to be matched again, which mends small bends.
constexpr GhostBounds kGhostBeforeSolution{8.0, 0.5, 24.0, 0.6};

// Whether so much in one region is a ghost, not furniture or a door that moved.
bool is_ghost(const RegionAgreement& region, const GhostBounds& bounds = {});
// `walls_m`: of each map. Of two maps that are contradicted as much the one with fewer walls is taken out.
// A ghost is one in its region and in the region around the middle of what is in doubt, or in a small square of it.
// What is contradicted where no other place is better, amid more that coincides, moved: it is no ghost.
// Pairs of which `may_show_ghosts` is false are only described.
TeamAudit audit(const std::vector<std::vector<PlacedSubmap>>& maps, const std::vector<double>& walls_m,
                const SightOf& sight_of, const std::function<bool(std::size_t, std::size_t)>& may_show_ghosts,
                const GhostBounds& bounds = {});
struct BentRegions {
  std::vector<BentRegion> regions;
  double in_doubt_m = 0.0;  // in all regions of the team
};
// Regions as a whole; or also, where a tenth of what coincides there is in doubt, the region about the middle of the
// doubt and the small square with most of it.
enum class PlaceSizes { regions, all };
// Where the search for matches should go on: of each region of a pair at most one place.
BentRegions bent_regions(const std::vector<std::vector<PlacedSubmap>>& maps, const SightOf& sight_of,
                         const std::function<bool(std::size_t, std::size_t)>& may_be_bent, PlaceSizes sizes);

}  // namespace mapweave::fusion
