#include <mapweave/maps/occupancy_grid.h>

#include <cmath>

namespace mapweave {

double probability(std::int16_t log_odds) { return 1.0 / (1.0 + std::exp(-log_odds / OccupancyGrid::kUnitsPerNat)); }

}  // namespace mapweave
