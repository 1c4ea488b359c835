#pragma once
// Where a region of one map would lie on another one if it lay elsewhere: distinguishes maps that are bent, or lie
// wrongly, from walls that moved.

#include "wall_agreement.h"

#include <map>
#include <optional>

namespace mapweave::fusion {

struct PlaneBox;

// Of maps that lie so. Keeps what it looked at of a region, so the pairs of one region are best asked about one after
// the other.
class RegionDisplacement {
 public:
  // Both must outlive it.
  RegionDisplacement(const std::vector<std::vector<PlacedSubmap>>& maps, const SightOf& sight_of);
  ~RegionDisplacement();
  RegionDisplacement(const RegionDisplacement&) = delete;
  RegionDisplacement& operator=(const RegionDisplacement&) = delete;

  // A motion of the team's plane, up to 2 m and 7 degrees at the middle of the region, by which the walls of `region.a`
  // there would lie on those of `region.b` clearly better than they do: at most half would be in doubt, and no fewer
  // would coincide, facing the same way. Of places that are as good the nearest. None where they lie best as they are.
  std::optional<Pose2> better_place(const RegionAgreement& region);

 private:
  struct Side;
  const Side& side(std::size_t map, const PlaneBox& box);

  const std::vector<std::vector<PlacedSubmap>>& maps_;
  const SightOf& sight_of_;
  double x_m_ = 0.0, y_m_ = 0.0, side_m_ = 0.0;  // of the region that is kept
  std::map<std::size_t, Side> sides_;
};

}  // namespace mapweave::fusion
