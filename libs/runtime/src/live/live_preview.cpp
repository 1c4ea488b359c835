#include <mapweave/runtime/live_preview.h>

#include <mapweave/core/error.h>
#include <mapweave/report/live_page.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <limits>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kMostScans = 3000;
constexpr double kMostCells = 1500.0;  // of a side

// At most kMostScans of its scans, evenly picked.
Map thinned(const Map& map) {
  const std::size_t step = map.nodes.size() / kMostScans + 1;
  Map thin;
  std::size_t place = 0;
  for (const auto& [id, node] : map.nodes)
    if (place++ % step == 0) thin.nodes.set(id, node);
  return thin;
}

OccupancyGrid drawn(const Map& map, fusion::ComposeOptions options) {
  double low_x = std::numeric_limits<double>::infinity(), low_y = low_x, high_x = -low_x, high_y = -low_x;
  for (const auto& entry : map.nodes) {
    const Eigen::Vector3d& place = entry.second.map_from_node.t;
    low_x = std::min(low_x, place.x());
    high_x = std::max(high_x, place.x());
    low_y = std::min(low_y, place.y());
    high_y = std::max(high_y, place.y());
  }
  const double side_m = std::max(high_x - low_x, high_y - low_y) + options.max_range_m;
  options.resolution_m = std::max(options.resolution_m, side_m / kMostCells);
  WorkerPool alone(1);
  try {
    return fusion::compose_grid(thinned(map), options, alone);
  } catch (const Error&) {  // it extends too far; its trajectories are drawn
    return {};
  }
}

}  // namespace

std::shared_ptr<const LivePreview> preview_of(const fusion::FusionResult& result, std::uint64_t number) {
  auto preview = std::make_shared<LivePreview>();
  preview->number = number;
  for (const fusion::Component& component : result.components) {
    LivePreview::Part& part = preview->parts.emplace_back();
    part.members = component.members;
    part.map.nodes = component.map.nodes;
    part.map.constraints = component.map.constraints;
  }
  return preview;
}

nlohmann::ordered_json preview_json(const LivePreview& preview, const std::vector<std::string>& robots,
                                    const fusion::ComposeOptions& options) {
  nlohmann::ordered_json maps = nlohmann::ordered_json::array();
  for (const LivePreview::Part& part : preview.parts) {
    std::string title;
    for (const MapId& id : part.members) title += (title.empty() ? "" : " + ") + id.str();
    maps.push_back(report::live_map(title, part.map, drawn(part.map, options), robots));
  }
  return {{"number", preview.number}, {"maps", std::move(maps)}};
}

}  // namespace mapweave::runtime
