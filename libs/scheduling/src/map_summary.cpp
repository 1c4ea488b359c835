#include "summary_cells.h"

#include <mapweave/scheduling/overlap_estimate.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace mapweave::scheduling {
namespace {

using Cell = MapSummary::Cell;
using Point = CellPoint;

// Gathers what rays say of cells: those that end at a wall pass what is free.
class Sketch {
 public:
  void add(const Point& from, const Point& to) {
    constexpr double kFarthest_m = 100.0;  // of a ray: one wrong reading must not make the summary large
    if (std::hypot(to.x - from.x, to.y - from.y) < kFarthest_m) {
      rays_.push_back({from, to});
      reach(from);
      reach(to);
    }
  }
  void see(const Point& where, bool is_wall) {
    seen_.push_back({where, is_wall});
    reach(where);
  }

  MapSummary summary(const std::vector<Point>& path) const {
    MapSummary result;
    if (!(low_.x <= high_.x)) return result;
    const double columns = std::floor(high_.x / kCell_m) - std::floor(low_.x / kCell_m) + 1.0,
                 rows = std::floor(high_.y / kCell_m) - std::floor(low_.y / kCell_m) + 1.0;
    constexpr double kFarthest_m = 1e6;  // from the frame's origin
    if (!(columns * rows <= static_cast<double>(MapSummary::kMostCells)) ||
        !(std::max({-low_.x, -low_.y, high_.x, high_.y}) < kFarthest_m))
      return result;
    result.left = cell_of(low_.x);
    result.bottom = cell_of(low_.y);
    result.columns = static_cast<std::int32_t>(columns);
    result.rows = static_cast<std::int32_t>(rows);
    std::vector<Count> counts(static_cast<std::size_t>(columns * rows));
    const auto at = [&](double x, double y) -> Count& {
      return counts[static_cast<std::size_t>(std::int64_t{cell_of(y) - result.bottom} * result.columns + cell_of(x) -
                                             result.left)];
    };
    for (const auto& [from, to] : rays_) {
      const double length = std::hypot(to.x - from.x, to.y - from.y);
      constexpr double kStep_m = 0.5 * kCell_m;  // no cell that a ray passes is left out, but for corners
      for (double path_m = 0.0; path_m < length - kStep_m; path_m += kStep_m)
        ++at(from.x + (to.x - from.x) * path_m / length, from.y + (to.y - from.y) * path_m / length).passed;
      ++at(to.x, to.y).hit;
    }
    for (const auto& [where, is_wall] : seen_) is_wall ? ++at(where.x, where.y).hit : ++at(where.x, where.y).passed;
    for (const Count& count : counts)
      result.cells.push_back(count.passed + count.hit == 0               ? Cell::unknown
                             : kPassesOfAWall * count.hit > count.passed ? Cell::wall
                                                                         : Cell::free);
    describe(path, result);
    return result;
  }

 private:
  static constexpr double kCell_m = MapSummary::kCell_m;
  static constexpr std::uint32_t kPassesOfAWall = 4;  // a wall fills a part of its cell: rays pass beside it
  struct Count {
    std::uint32_t passed = 0, hit = 0;
  };
  void reach(const Point& point) {
    low_ = {std::min(low_.x, point.x), std::min(low_.y, point.y)};
    high_ = {std::max(high_.x, point.x), std::max(high_.y, point.y)};
  }

  // Looks from a few points that are spread over the path.
  static void describe(const std::vector<Point>& path, MapSummary& summary) {
    using Look = MapSummary::Look;
    constexpr double kApart_m = 3.0;  // a third of what a look reaches: nearer ones see the same walls
    const std::vector<Point> walls = walls_of(summary);
    std::vector<Point> from;
    for (const Point& point : path)
      if (std::none_of(from.begin(), from.end(),
                       [&](const Point& p) { return std::hypot(p.x - point.x, p.y - point.y) < kApart_m; }))
        from.push_back(point);
    const std::size_t step = (from.size() + MapSummary::kMostLooks - 1) / MapSummary::kMostLooks;
    for (std::size_t i = 0; i < from.size(); i += step) {
      const auto centimetres = [](double metres) { return static_cast<std::int32_t>(std::lround(100.0 * metres)); };
      Look look{centimetres(from[i].x), centimetres(from[i].y), {}};
      for (const Point& wall : walls)
        if (const auto ring = static_cast<int>(std::hypot(wall.x - from[i].x, wall.y - from[i].y) / Look::kRing_m);
            ring < Look::kRings)
          look.walls[static_cast<std::size_t>(ring)] =
              static_cast<std::uint8_t>(std::min(255, look.walls[static_cast<std::size_t>(ring)] + 1));
      summary.looks.push_back(look);
    }
  }

  std::vector<std::pair<Point, Point>> rays_;
  std::vector<std::pair<Point, bool>> seen_;
  Point low_{1e300, 1e300}, high_{-1e300, -1e300};
};

void see(const Node& node, const PackedScan& scan, Sketch& sketch) {
  const Pose2 from = planar(node.map_from_node);
  const double c = std::cos(from.phi), s = std::sin(from.phi);
  for (const ScanPoint& point : points_in_robot(scan))
    sketch.add({from.x, from.y}, {from.x + c * point.x - s * point.y, from.y + s * point.x + c * point.y});
}

void see(const Node& node, const OccupancyGrid& grid, Sketch& sketch) {
  const Pose2 from = planar(node.map_from_node);
  const double c = std::cos(from.phi), s = std::sin(from.phi);
  for (std::int32_t row = 0; row < grid.rows; ++row)
    for (std::int32_t column = 0; column < grid.columns; ++column) {
      const std::int16_t odds = grid.at(column, row);
      if (odds == OccupancyGrid::kUnknown) continue;
      const double x = grid.origin_x_m + (column + 0.5) * grid.resolution_m,
                   y = grid.origin_y_m + (row + 0.5) * grid.resolution_m;
      sketch.see({from.x + c * x - s * y, from.y + s * x + c * y}, odds > 0);
    }
}

// Of a wall, what stands between knee and ceiling.
void see(const Map& map, const Landmark& landmark, Sketch& sketch) {
  constexpr double kLowest_m = 0.15, kHighest_m = 2.2;
  const Node* anchor = map.nodes.find(landmark.anchor);
  if (anchor == nullptr) return;
  const Eigen::Vector3d point = transformed(landmark.point_in_anchor(), anchor->map_from_node);
  const double height = point.z() - anchor->map_from_node.t.z();
  if (height > kLowest_m && height < kHighest_m)
    sketch.add({anchor->map_from_node.t.x(), anchor->map_from_node.t.y()}, {point.x(), point.y()});
}

}  // namespace

MapSummary summary_of(const Map& map) {
  Sketch sketch;
  std::vector<Point> path;
  constexpr double kMoved_m = 0.4, kTurned_rad = 0.5;  // nodes between add little
  std::optional<Pose2> last;
  for (const auto& [id, node] : map.nodes) {
    if (node.payload == nullptr) continue;
    const Pose2 pose = planar(node.map_from_node);
    if (const auto* grid = std::get_if<OccupancyGrid>(node.payload.get())) {
      see(node, *grid, sketch);
    } else {
      if (last && std::hypot(pose.x - last->x, pose.y - last->y) < kMoved_m &&
          std::abs(wrap_angle(pose.phi - last->phi)) < kTurned_rad)
        continue;
      if (const auto* scan = std::get_if<PackedScan>(node.payload.get())) see(node, *scan, sketch);
    }
    last = pose;
    path.push_back({pose.x, pose.y});
  }
  for (const auto& [id, landmark] : map.landmarks) see(map, landmark, sketch);
  return sketch.summary(path);
}

MapSummary summary_of_route(const std::vector<Waypoint>& route, double range_m) {
  MapSummary summary;
  summary.is_in_team_frame = true;
  if (route.empty()) return summary;
  double low_x = route[0].x_m, high_x = low_x, low_y = route[0].y_m, high_y = low_y;
  for (const Waypoint& point : route) {
    low_x = std::min(low_x, point.x_m);
    high_x = std::max(high_x, point.x_m);
    low_y = std::min(low_y, point.y_m);
    high_y = std::max(high_y, point.y_m);
  }
  constexpr double kCell_m = MapSummary::kCell_m, kFarthest_m = 1e6;  // farther out, numbers of cells might not fit
  if (!(std::max({-low_x, -low_y, high_x, high_y, range_m}) < kFarthest_m)) return summary;
  const std::int32_t left = cell_of(low_x - range_m), bottom = cell_of(low_y - range_m);
  const std::int32_t columns = cell_of(high_x + range_m) - left + 1, rows = cell_of(high_y + range_m) - bottom + 1;
  if (std::int64_t{columns} * rows > MapSummary::kMostCells) return summary;
  summary.left = left;
  summary.bottom = bottom;
  summary.columns = columns;
  summary.rows = rows;
  summary.cells.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), Cell::unknown);
  for (std::size_t i = 0; i < route.size(); ++i) {  // around each leg
    const Waypoint &from = route[i == 0 ? 0 : i - 1], &to = route[i];
    const double dx = to.x_m - from.x_m, dy = to.y_m - from.y_m, squared = dx * dx + dy * dy;
    for (std::int32_t row = cell_of(std::min(from.y_m, to.y_m) - range_m);
         row <= cell_of(std::max(from.y_m, to.y_m) + range_m); ++row)
      for (std::int32_t column = cell_of(std::min(from.x_m, to.x_m) - range_m);
           column <= cell_of(std::max(from.x_m, to.x_m) + range_m); ++column) {
        const double x = (column + 0.5) * kCell_m - from.x_m, y = (row + 0.5) * kCell_m - from.y_m;
        const double along = squared > 0.0 ? std::clamp((x * dx + y * dy) / squared, 0.0, 1.0) : 0.0;
        if (std::hypot(x - along * dx, y - along * dy) <= range_m)
          summary.cells[static_cast<std::size_t>(row - bottom) * static_cast<std::size_t>(columns) +
                        static_cast<std::size_t>(column - left)] = Cell::free;
      }
  }
  return summary;
}

}  // namespace mapweave::scheduling
