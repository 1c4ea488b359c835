#include <mapweave/core/error.h>
#include <mapweave/fusion/grid_map.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <utility>

namespace mapweave::fusion {
namespace {

constexpr double kTile_m = 5.0;
constexpr int kTilesAcross = 3;  // a submap has up to 3 x 3 tiles,
constexpr int kTileStride = 2;   // and shares a row or column with the next
constexpr double kCoarsest_m = 2.0;
constexpr double kStiffness = 1e6;  // 1/m^2: a raster does not bend, but for what a joint graph must give

}  // namespace

Map map_of_grid(MapId id, const OccupancyGrid& grid) {
  if (grid.resolution_m > kCoarsest_m)
    throw Error(ErrorCode::kBadInput, "cells of " + std::to_string(grid.resolution_m) + " m show no walls; at most 2 m", id.str(),
                "check its resolution: metres per cell");
  Map map;
  map.id = id;
  const SessionId session{{RobotId(id.str()), SensorId("grid")}, 0};
  const int side = std::max(1, static_cast<int>(std::lround(kTile_m / grid.resolution_m)));
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
      const Pose2 map_from_node{grid.origin_x_m + column * side * grid.resolution_m, grid.origin_y_m + row * side * grid.resolution_m, 0.0};
      map.nodes.set(node, Node{node, Stamp{}, spatial(map_from_node), std::make_shared<const Payload>(std::move(tile))});
      tiles.emplace(std::make_pair(row, column), node);
    }
  if (tiles.empty()) throw Error(ErrorCode::kBadInput, "every cell of the grid is unknown", id.str(), "check its thresholds");
  const auto pose = [&](const NodeId& node) { return planar(map.nodes.find(node)->map_from_node); };
  // Each tile is held by its neighbour to the left, else by the one below, else by the one before it.
  for (auto tile = std::next(tiles.begin()); tile != tiles.end(); ++tile) {
    const auto& [row, column] = tile->first;
    auto holder = std::prev(tile);
    const auto left = tiles.find({row, column - 1}), below = tiles.find({row - 1, column});
    if (left != tiles.end())
      holder = left;
    else if (below != tiles.end())
      holder = below;
    const ConstraintId name{ConstraintKind::odometry, holder->second, tile->second, 0};
    map.constraints.set(name, planar_constraint(name, between(pose(holder->second), pose(tile->second)),
                                                Eigen::Vector3d(kStiffness, kStiffness, kStiffness).asDiagonal()));
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
          const Pose2 anchor = submap.submap_from_node.empty() ? pose(tile->second) : pose(submap.submap_from_node.front().first);
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

}  // namespace mapweave::fusion
