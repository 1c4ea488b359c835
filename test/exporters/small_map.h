#pragma once
// A tiny map to export: nodes of robots, some with a scan.

#include <mapweave/maps/map.h>

#include <memory>
#include <string>
#include <vector>

namespace mapweave::test {

inline NodeId node_id(const std::string& robot, std::uint32_t index, std::int64_t run = 7) {
  return NodeId{SessionId{ClientId{RobotId(robot), SensorId("laser")}, run}, index};
}

inline void add_pose(Map& map, const NodeId& id, std::int64_t stamp_ns, const Pose3& map_from_node,
                     std::shared_ptr<const Payload> payload = nullptr) {
  map.nodes.set(id, Node{id, Stamp{stamp_ns}, map_from_node, std::move(payload)});
}

// Four rays: ahead, left, behind, right; ranges in metres, 0: no return.
inline std::shared_ptr<const Payload> cross_scan(const std::vector<double>& ranges_m) {
  auto geometry = std::make_shared<ScanGeometry>();
  geometry->angle_step_rad = M_PI / 2;
  geometry->ray_count = 4;
  geometry->max_range_m = 60.0;
  PackedScan scan;
  scan.geometry = geometry;
  for (const double range_m : ranges_m)
    scan.ranges.push_back(static_cast<std::uint16_t>(std::lround(range_m / geometry->range_unit_m)));
  return std::make_shared<const Payload>(std::move(scan));
}

// '#' wall, '.' free, ' ' unknown; the first row is the highest y.
inline OccupancyGrid drawn_grid(const std::vector<std::string>& rows, double resolution_m = 0.05,
                                double origin_x_m = 0.0, double origin_y_m = 0.0) {
  OccupancyGrid grid;
  grid.resolution_m = resolution_m;
  grid.origin_x_m = origin_x_m;
  grid.origin_y_m = origin_y_m;
  grid.rows = static_cast<std::int32_t>(rows.size());
  grid.columns = static_cast<std::int32_t>(rows.front().size());
  for (auto row = rows.rbegin(); row != rows.rend(); ++row)
    for (const char c : *row) grid.log_odds.push_back(static_cast<std::int16_t>(c == '#' ? 200 : c == '.' ? -150 : 0));
  return grid;
}

// The grid as rows of letters again.
inline std::vector<std::string> letters_of(const OccupancyGrid& grid) {
  std::vector<std::string> rows;
  for (std::int32_t row = grid.rows - 1; row >= 0; --row) {
    rows.emplace_back();
    for (std::int32_t column = 0; column < grid.columns; ++column)
      rows.back() += grid.at(column, row) > 0 ? '#' : grid.at(column, row) < 0 ? '.' : ' ';
  }
  return rows;
}

}  // namespace mapweave::test
