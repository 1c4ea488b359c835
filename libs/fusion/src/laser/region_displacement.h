#pragma once
// Where a region of one map would lie on another one if it lay elsewhere: tells maps that are bent, or lie wrongly, from walls that moved.

#include "wall_agreement.h"

#include <optional>

namespace mapweave::fusion {

// A motion of the team's plane, up to 2 m and 7 degrees at the middle of the region, by which the walls of `a` there would lie on those of `b`
// clearly better than they do: at most half would be in doubt, and no fewer would coincide, facing the same way. Of places that are as good the
// nearest. None where they lie best as they are.
std::optional<Pose2> better_place(const std::vector<PlacedSubmap>& a, const std::vector<PlacedSubmap>& b, const RegionAgreement& region,
                                  const SightOf& sight_of);

}  // namespace mapweave::fusion
