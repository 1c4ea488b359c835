#pragma once
// What fuse() found of maps of rigs (rig/robot_rigs.h), as a result of the maps of single cameras that were given to
// it.

#include <mapweave/fusion/fuse.h>
#include <mapweave/rig/robot_rigs.h>

#include <vector>

namespace mapweave::fusion {

// In each component the members of a rig take the place of the rig's map, each with its own transform and scale.
// `maps`: the members' own.
void split_rigs(FusionResult& result, const std::vector<rig::RobotRigs::Rig>& all, const std::vector<Map>& maps);

}  // namespace mapweave::fusion
