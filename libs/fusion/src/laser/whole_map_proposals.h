#pragma once
// Where two laser maps may lie on each other, as whole images: what shares too little with any one submap to be found
// by submaps. The same proposals as for grids of other makers (matching/grid_proposals.h), at the maps' own scale,
// after those of corners (matching/corner_proposals.h); submaps that they lay on each other are judged.

#include "seen_raster.h"
#include "submap_judge.h"

#include <mapweave/matching/grid_proposals.h>

#include <map>

namespace mapweave::fusion {

class WholeMapProposals {
 public:
  // Everything must outlive it.
  WholeMapProposals(const std::vector<PreparedMap>& maps, const SubmapGraph& graph) : maps_(maps), graph_(graph) {}
  // Narrow questions about the submaps of two maps, those of the best proposal first. Submaps lie as their own map has
  // them. `whole_maps` leaves out what `corners` proposed before.
  std::vector<SubmapQuestion> questions(std::size_t a, std::size_t b, Proposer proposer,
                                        const std::vector<PlacedSubmap>& submaps_a,
                                        const std::vector<PlacedSubmap>& submaps_b, const SightOf& sight_of);
  // About the submaps that share most walls if the frame of those of b lies so in that of those of a, at most six:
  // narrow ones around that.
  std::vector<SubmapQuestion> of_most_shared(const std::vector<PlacedSubmap>& submaps_a,
                                             const std::vector<PlacedSubmap>& submaps_b, const Pose2& a_from_b,
                                             double radius_m, double yaw_rad, const SightOf& sight_of) const;

 private:
  const Hash& fingerprint_of(std::size_t submap) const {
    return maps_[graph_.map_of(submap)].fingerprints[graph_.submap_of(submap)];
  }
  // Where the second map lies in the frame of the first one.
  std::vector<Pose2> proposed(Proposer proposer, std::pair<std::size_t, std::size_t> pair,
                              const matching::GridWalls& first, const matching::GridWalls& second);
  const matching::GridWalls& walls(std::size_t map, const std::vector<PlacedSubmap>& submaps, const SightOf& sight_of);

  const std::vector<PreparedMap>& maps_;
  const SubmapGraph& graph_;
  std::map<std::size_t, matching::GridWalls> walls_;
  std::map<std::pair<std::size_t, std::size_t>, std::vector<Pose2>> by_corners_;
};

}  // namespace mapweave::fusion
