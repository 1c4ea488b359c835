#pragma once
// Draws the grid of a map from its scans at the poses it believes in: a fused map is redrawn, never pasted.

#include <mapweave/core/worker_pool.h>
#include <mapweave/maps/map.h>

namespace mapweave::fusion {

struct ComposeOptions {
  double resolution_m = 0.05;
  double max_range_m = 30.0;      // rays are drawn up to here
  double hit_probability = 0.7;   // of a wall where a ray ends
  double miss_probability = 0.4;  // of a wall where a ray passes
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("resolution_m", resolution_m, 0.005, 1.0,
             "side in metres of a cell of the occupancy grid; larger values show less detail and need less memory");
    v.positive("max_range_m", max_range_m,
               "longest part of a laser ray, in metres, that is drawn into the occupancy grid; larger values draw more "
               "of each scan");
    v.number(
        "hit_probability", hit_probability, 0.5, 0.999,
        "probability that a cell is occupied when a ray ends in it; larger values make walls appear after fewer rays");
    v.number("miss_probability", miss_probability, 0.001, 0.5,
             "probability that a cell is occupied when a ray passes through it; larger values clear moving objects "
             "after more rays");
  }
};

// The grid covers all that was seen and no more. Frame: the map's. The same bytes for any number of threads. Throws
// Error(kBadInput) where the map extends farther than 2 km.
OccupancyGrid compose_grid(const Map&, const ComposeOptions&, WorkerPool&);

}  // namespace mapweave::fusion
