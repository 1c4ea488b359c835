#include "grid_stiffness.h"

#include <mapweave/core/error.h>
#include <mapweave/fusion/grid_map.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

namespace mapweave::fusion {
namespace {

constexpr int kTilesAcross = 3;      // a submap has up to 3 x 3 tiles,
constexpr int kTileStride = 2;       // and shares a row or column with the next
constexpr double kCoarsest_m = 2.0;  // a cell: coarser rasters show no walls

}  // namespace

Map map_of_grid(MapId id, const OccupancyGrid& grid) {
  if (grid.resolution_m > kCoarsest_m)
    throw Error(ErrorCode::kBadInput, "cells of " + std::to_string(grid.resolution_m) + " m show no walls; at most 2 m",
                id.str(), "check its resolution: metres per cell");
  Map map;
  map.id = id;
  const SessionId session{{RobotId(id.str()), SensorId("grid")}, 0};
  const int side = std::max(1, static_cast<int>(std::lround(kGridTile_m / grid.resolution_m)));
  std::map<std::pair<int, int>, NodeId> tiles;  // by row and column of tiles
  std::uint32_t next = 0;
  for (int row = 0; row * side < grid.rows; ++row)
    for (int column = 0; column * side < grid.columns; ++column) {
      OccupancyGrid tile;
      tile.resolution_m = grid.resolution_m;
      tile.columns = std::min(side, grid.columns - column * side);
      tile.rows = std::min(side, grid.rows - row * side);
      bool known = false;
      for (int y = 0; y < tile.rows; ++y)
        for (int x = 0; x < tile.columns; ++x) {
          tile.log_odds.push_back(grid.at(column * side + x, row * side + y));
          known = known || tile.log_odds.back() != OccupancyGrid::kUnknown;
        }
      if (!known) continue;
      const NodeId node{session, next++};
      const Pose2 map_from_node{grid.origin_x_m + column * side * grid.resolution_m,
                                grid.origin_y_m + row * side * grid.resolution_m, 0.0};
      map.nodes.set(node,
                    Node{node, Stamp{}, spatial(map_from_node), std::make_shared<const Payload>(std::move(tile))});
      tiles.emplace(std::make_pair(row, column), node);
    }
  if (tiles.empty())
    throw Error(ErrorCode::kBadInput, "every cell of the grid is unknown", id.str(), "check its thresholds");
  const auto pose = [&](const NodeId& node) { return planar(map.nodes.find(node)->map_from_node); };
  // Neighbours hold each other as firmly as real grids do; a tile without any to the left or below is held by the one
  // before it.
  const auto hold = [&](const NodeId& from, const NodeId& to) {
    const Pose2 step = between(pose(from), pose(to));
    const ConstraintId name{ConstraintKind::odometry, from, to, 0};
    map.constraints.set(name, planar_constraint(name, step, grid_stiffness(step.x, step.y)));
  };
  for (auto tile = std::next(tiles.begin()); tile != tiles.end(); ++tile) {
    const auto& [row, column] = tile->first;
    const auto left = tiles.find({row, column - 1}), below = tiles.find({row - 1, column});
    if (left != tiles.end()) hold(left->second, tile->second);
    if (below != tiles.end()) hold(below->second, tile->second);
    if (left == tiles.end() && below == tiles.end()) hold(std::prev(tile)->second, tile->second);
  }
  std::uint32_t submaps = 0;
  const int last_row = (grid.rows + side - 1) / side, last_column = (grid.columns + side - 1) / side;
  for (int row = 0; row < last_row; row += kTileStride)
    for (int column = 0; column < last_column; column += kTileStride) {
      Submap submap;
      submap.id = {session, submaps};
      for (int y = row; y < row + kTilesAcross; ++y)
        for (int x = column; x < column + kTilesAcross; ++x) {
          const auto tile = tiles.find({y, x});
          if (tile == tiles.end()) continue;
          const Pose2 anchor =
              submap.submap_from_node.empty() ? pose(tile->second) : pose(submap.submap_from_node.front().first);
          submap.submap_from_node.emplace_back(tile->second, spatial(between(anchor, pose(tile->second))));
        }
      if (submap.submap_from_node.empty()) continue;
      submap.frozen = true;
      submap.content = content_hash(submap, map.nodes);
      const SubmapId name = submap.id;
      map.submaps.set(name, std::move(submap));
      ++submaps;
    }
  return map;
}

bool is_grid(const Map& map) {
  return !map.nodes.empty() && std::all_of(map.nodes.begin(), map.nodes.end(), [](const auto& entry) {
    return entry.second.payload != nullptr && std::holds_alternative<OccupancyGrid>(*entry.second.payload);
  });
}

Map rescaled_grid(const Map& map, double scale) {
  if (scale == 1.0) return map;
  Map result = map;
  for (auto& [id, node] : result.nodes) {
    node.map_from_node.t *= scale;
    OccupancyGrid tile = std::get<OccupancyGrid>(*node.payload);
    tile.resolution_m *= scale;
    tile.origin_x_m *= scale;
    tile.origin_y_m *= scale;
    node.payload = std::make_shared<const Payload>(std::move(tile));
  }
  for (auto& [id, constraint] : result.constraints) constraint.from_from_to.pose.t *= scale;
  for (auto& [id, submap] : result.submaps) {
    for (auto& member : submap.submap_from_node) member.second.t *= scale;
    submap.content = content_hash(submap, result.nodes);
  }
  return result;
}

std::map<NodeId, Pose2> unbent_tiles(const Map& map) {
  std::map<NodeId, Pose2> poses;
  if (map.nodes.empty()) return poses;
  const auto& [first, node] = *map.nodes.begin();
  poses.emplace(first, planar(node.map_from_node));
  for (const auto& [id, constraint] : map.constraints) {  // by `to`; each tile is held by tiles before it
    if (id.kind != ConstraintKind::odometry) continue;
    const auto from = poses.find(id.from);
    if (from != poses.end()) poses.emplace(id.to, compose(from->second, planar(constraint.from_from_to.pose)));
  }
  return poses;
}

OccupancyGrid grid_of_map(const Map& map) {
  const auto poses = unbent_tiles(map);
  OccupancyGrid grid;
  double x0 = 1e300, y0 = 1e300, x1 = -1e300, y1 = -1e300;
  for (const auto& [id, pose] : poses) {
    const auto& payload = map.nodes.find(id)->payload;
    const auto* tile = payload == nullptr ? nullptr : std::get_if<OccupancyGrid>(payload.get());
    if (tile == nullptr || std::abs(pose.phi) > 1e-6) return {};
    grid.resolution_m = tile->resolution_m;
    x0 = std::min(x0, pose.x);
    x1 = std::max(x1, pose.x + tile->columns * tile->resolution_m);
    y0 = std::min(y0, pose.y);
    y1 = std::max(y1, pose.y + tile->rows * tile->resolution_m);
  }
  if (poses.empty()) return {};
  grid.origin_x_m = x0;
  grid.origin_y_m = y0;
  grid.columns = static_cast<std::int32_t>(std::lround((x1 - x0) / grid.resolution_m));
  grid.rows = static_cast<std::int32_t>(std::lround((y1 - y0) / grid.resolution_m));
  grid.log_odds.assign(static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows),
                       OccupancyGrid::kUnknown);
  for (const auto& [id, pose] : poses) {
    const auto& tile = std::get<OccupancyGrid>(*map.nodes.find(id)->payload);
    const auto column = std::lround((pose.x - x0) / grid.resolution_m),
               row = std::lround((pose.y - y0) / grid.resolution_m);
    for (std::int32_t y = 0; y < tile.rows; ++y)
      for (std::int32_t x = 0; x < tile.columns; ++x)
        if (grid.inside(static_cast<std::int32_t>(column) + x, static_cast<std::int32_t>(row) + y))
          grid.log_odds[static_cast<std::size_t>(row + y) * static_cast<std::size_t>(grid.columns) +
                        static_cast<std::size_t>(column + x)] = tile.at(x, y);
  }
  return grid;
}

}  // namespace mapweave::fusion
