#pragma once
// The frame of a team's map. It is chosen after the map was solved: a rigid motion of the whole, which changes nothing
// else.

#include <mapweave/fusion/fuse.h>

#include <optional>

namespace mapweave::fusion {

// Component number `team` of the result in another frame: its nodes, where its members lie, and the places of conflicts
// that are in its frame.
void move_frame(FusionResult&, std::size_t team, const Pose3& new_from_old);

// The direction of most walls that scans and grids show, in radians in the map's frame, within [-pi/4, pi/4]: walls
// stand at right angles. Nothing where no direction stands out, and for maps of cameras alone.
std::optional<double> direction_of_walls(const Map&);

}  // namespace mapweave::fusion
