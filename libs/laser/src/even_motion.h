#pragma once
// A scan's motion is even while the laser turns (SweepMotion); robots speed up and brake meanwhile.

#include <mapweave/core/geometry.h>
#include <mapweave/maps/scan.h>

#include <functional>
#include <optional>

namespace mapweave::laser {

// Changes ranges so that they are what the laser would have measured of the same walls, had the robot moved as
// scan.motion says. `stamp_from_robot`: how it moved, at seconds after the stamp; nullopt where that is not known.
// Walls are taken to be straight from ray to ray; beside edges a ray takes the nearest reading, if one is near.
// Returns whether anything was changed: not where the motion is even as far as a match resolves, or not known.
bool even_out(PackedScan& scan, const std::function<std::optional<Pose2>(double)>& stamp_from_robot);

}  // namespace mapweave::laser
