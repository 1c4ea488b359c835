#include <mapweave/runtime/map_slabs.h>

#include <mapweave/fusion/compose_grid.h>

#include <cmath>
#include <map>
#include <utility>

namespace mapweave::runtime {
namespace {

// The lowest height of a layer's lasers, and what they saw.
struct Layer {
  double height_m = 0.0;
  Map map;
};

std::map<std::int64_t, Layer> layers_of(const Map& map, double resolution_m) {
  std::map<std::int64_t, Layer> layers;
  for (const auto& [id, node] : map.nodes) {
    const PackedScan* scan = node.payload ? std::get_if<PackedScan>(node.payload.get()) : nullptr;
    if (scan == nullptr) continue;
    const double height_m = compose(node.map_from_node, scan->geometry->robot_from_laser).t.z();
    const auto [layer, is_new] = layers.try_emplace(static_cast<std::int64_t>(std::floor(height_m / resolution_m)));
    if (is_new || height_m < layer->second.height_m) layer->second.height_m = height_m;
    layer->second.map.nodes.set(id, node);
  }
  for (const auto& [id, node] : map.nodes)
    if (node.payload && std::holds_alternative<OccupancyGrid>(*node.payload)) {
      if (layers.empty()) layers.try_emplace(0);
      layers.begin()->second.map.nodes.set(id, node);
    }
  return layers;
}

}  // namespace

std::vector<exporters::MapSlab> slabs_of(const Map& map, const OccupancyGrid& composed,
                                         const RunConfiguration& configuration, WorkerPool& pool) {
  auto layers = layers_of(map, configuration.output.dense.octomap.resolution_m);
  std::vector<exporters::MapSlab> slabs;
  for (auto& [number, layer] : layers) {
    const bool is_whole = layers.size() == 1 && !composed.empty();
    exporters::MapSlab slab{layer.height_m,
                            is_whole ? composed : fusion::compose_grid(layer.map, configuration.compose, pool)};
    if (!slab.grid.empty()) slabs.push_back(std::move(slab));
  }
  return slabs;
}

}  // namespace mapweave::runtime
