#pragma once
// What planar sensors saw, as slabs of an OctoMap: at the heights at which they looked.

#include <mapweave/core/worker_pool.h>
#include <mapweave/exporters/octo_map.h>
#include <mapweave/maps/map.h>
#include <mapweave/runtime/run_configuration.h>

#include <vector>

namespace mapweave::runtime {

// Scans of one layer of cells (output.dense.octomap.resolution_m) make one slab, drawn as map.pgm is, the lowest first;
// none where nothing was seen. Grids of other programs do not say their height: they are drawn into the lowest one, at
// 0 where there are no scans. `composed`: the grid of the whole map, where it is known; it is the slab where all scans
// have one height. Throws what compose_grid() throws.
std::vector<exporters::MapSlab> slabs_of(const Map&, const OccupancyGrid& composed, const RunConfiguration&,
                                         WorkerPool&);

}  // namespace mapweave::runtime
