#pragma once
// What happens to a plan's furniture after the plan was made.

#include <mapweave/simulation/world_options.h>

namespace mapweave::simulation {

// Round pieces, and what changed since the first session. The building itself stays as it is, and so does the look of
// every other piece.
FloorPlan furnished(FloorPlan, const FurnitureOptions&, std::uint64_t seed);

}  // namespace mapweave::simulation
