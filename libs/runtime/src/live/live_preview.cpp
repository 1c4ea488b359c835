#include <mapweave/runtime/live_preview.h>

#include <mapweave/core/error.h>
#include <mapweave/exporters/session_trajectories.h>
#include <mapweave/report/live_page.h>
#include <mapweave/tiers/round_merger.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <limits>
#include <optional>

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

std::optional<Pose3> part_from_own(const Map& own, const Map& part) {
  for (auto node = own.nodes.end(); node != own.nodes.begin();)
    if (const Node* there = part.nodes.find((--node)->first))
      return compose(there->map_from_node, inverse(node->second.map_from_node));
  return std::nullopt;
}

// Of a robot's map.
void add_start(const Map& own, LivePreview::JointMap& part) {
  const auto pose = part_from_own(own, part.map);
  if (!pose) return;
  for (const auto& [robot, trajectory] : exporters::robot_trajectories(own))
    part.part_from_start[robot] = compose(*pose, trajectory.front().map_from_robot);
}

}  // namespace

std::shared_ptr<const LivePreview> preview_of(const tiers::RoundMerger& rounds, std::uint64_t number) {
  auto preview = std::make_shared<LivePreview>();
  preview->number = number;
  for (const fusion::Component& component : rounds.result().components) {
    LivePreview::JointMap& part = preview->parts.emplace_back();
    part.members = component.members;
    part.map.nodes = component.map.nodes;
    part.map.constraints = component.map.constraints;
    for (const MapId& member : part.members)
      if (const Map* own = rounds.map(member)) add_start(*own, part);
  }
  return preview;
}

std::map<RobotId, Stamp> newest_scans(const tiers::RoundMerger& rounds) {
  std::map<RobotId, Stamp> newest;
  for (const fusion::Component& component : rounds.result().components)
    for (const auto& [id, node] : component.map.nodes) {
      const auto place = newest.emplace(id.session.client.robot, node.stamp).first;
      place->second = std::max(place->second, node.stamp);
    }
  return newest;
}

nlohmann::ordered_json preview_json(const LivePreview& preview, const std::vector<std::string>& robots,
                                    const fusion::ComposeOptions& options) {
  nlohmann::ordered_json maps = nlohmann::ordered_json::array();
  for (const LivePreview::JointMap& part : preview.parts) {
    std::string title;
    for (const MapId& id : part.members) title += (title.empty() ? "" : " + ") + id.str();
    maps.push_back(report::live_map(title, part.map, drawn(part.map, options), robots));
  }
  return {{"number", preview.number}, {"maps", std::move(maps)}};
}

}  // namespace mapweave::runtime
