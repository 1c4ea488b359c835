#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/fusion/compose_grid.h>

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr double kWidest_m = 2000.0;  // beyond that a pose is wrong; bounds memory
constexpr int kBandRows = 256;        // a band of rows is drawn by one worker

std::int16_t units(double probability) {
  return static_cast<std::int16_t>(
      std::lround(OccupancyGrid::kUnitsPerNat * std::log(probability / (1.0 - probability))));
}

struct Ray {
  float x, y;
};
struct DrawnScan {
  float eye_x, eye_y, low_y, high_y;
  std::size_t first, count;  // of rays
};

struct Extent {
  double low_x = 1e300, low_y = 1e300, high_x = -1e300, high_y = -1e300;
  void add(double x, double y) {
    low_x = std::min(low_x, x), low_y = std::min(low_y, y), high_x = std::max(high_x, x), high_y = std::max(high_y, y);
  }
};

void add_to(std::int16_t& cell, int change) {
  const int value = std::clamp(cell + change, -2000, 2000);
  // Zero means never seen: what was seen as often wall as free leans to the last word.
  cell = static_cast<std::int16_t>(value != 0 ? value : change > 0 ? 1 : -1);
}

}  // namespace

OccupancyGrid compose_grid(const Map& map, const ComposeOptions& options, WorkerPool& pool) {
  std::vector<Ray> rays;
  std::vector<DrawnScan> scans;
  struct Raster {
    const OccupancyGrid* grid;
    Pose2 map_from_grid;
    Extent extent;
  };
  std::vector<Raster> rasters;
  Extent extent;
  for (const auto& [id, node] : map.nodes) {
    if (!node.payload) continue;
    const Pose2 pose = planar(node.map_from_node);
    const double c = std::cos(pose.phi), s = std::sin(pose.phi);
    if (const auto* grid = std::get_if<OccupancyGrid>(node.payload.get())) {
      rasters.push_back({grid, pose, {}});
      for (const double gx : {0.0, grid->columns * grid->resolution_m})
        for (const double gy : {0.0, grid->rows * grid->resolution_m}) {
          const double x = grid->origin_x_m + gx, y = grid->origin_y_m + gy;
          extent.add(pose.x + c * x - s * y, pose.y + s * x + c * y);
          rasters.back().extent.add(pose.x + c * x - s * y, pose.y + s * x + c * y);
        }
      continue;
    }
    const auto* scan = std::get_if<PackedScan>(node.payload.get());
    if (scan == nullptr) continue;  // keyframes show no walls
    const auto& mount = scan->geometry->robot_from_laser.t;
    DrawnScan drawn{static_cast<float>(pose.x + c * mount.x() - s * mount.y()),
                    static_cast<float>(pose.y + s * mount.x() + c * mount.y()),
                    0,
                    0,
                    rays.size(),
                    0};
    drawn.low_y = drawn.high_y = drawn.eye_y;
    extent.add(drawn.eye_x, drawn.eye_y);
    for (const auto& p : points_in_robot(*scan, 0.0, options.max_range_m)) {
      const Ray ray{static_cast<float>(pose.x + c * p.x - s * p.y), static_cast<float>(pose.y + s * p.x + c * p.y)};
      extent.add(ray.x, ray.y);
      drawn.low_y = std::min(drawn.low_y, ray.y), drawn.high_y = std::max(drawn.high_y, ray.y);
      rays.push_back(ray);
    }
    drawn.count = rays.size() - drawn.first;
    scans.push_back(drawn);
  }
  OccupancyGrid grid;
  grid.resolution_m = options.resolution_m;
  // Rasters alone hold nothing finer than they are.
  double finest_m = 1e300;
  for (const auto& raster : rasters) finest_m = std::min(finest_m, raster.grid->resolution_m);
  if (scans.empty() && !rasters.empty()) grid.resolution_m = std::max(grid.resolution_m, finest_m);
  if (scans.empty() && rasters.empty()) return grid;
  if (extent.high_x - extent.low_x > kWidest_m || extent.high_y - extent.low_y > kWidest_m)
    throw Error(
        ErrorCode::kBadInput,
        "the map is " +
            std::to_string(static_cast<int>(std::max(extent.high_x - extent.low_x, extent.high_y - extent.low_y))) +
            " m wide; at most 2000 m are drawn",
        {}, "look for a robot whose trajectory ran away, or choose a coarser compose.resolution_m and cut the log");
  const double per_metre = 1.0 / grid.resolution_m;
  const auto lowest_column = static_cast<std::int64_t>(std::floor(extent.low_x * per_metre)) - 1,
             lowest_row = static_cast<std::int64_t>(std::floor(extent.low_y * per_metre)) - 1;
  grid.origin_x_m = static_cast<double>(lowest_column) * grid.resolution_m;
  grid.origin_y_m = static_cast<double>(lowest_row) * grid.resolution_m;
  grid.columns =
      static_cast<std::int32_t>(static_cast<std::int64_t>(std::floor(extent.high_x * per_metre)) + 2 - lowest_column);
  grid.rows =
      static_cast<std::int32_t>(static_cast<std::int64_t>(std::floor(extent.high_y * per_metre)) + 2 - lowest_row);
  grid.log_odds.assign(static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows),
                       OccupancyGrid::kUnknown);

  // Bands of rows are drawn side by side, each by all scans in order: the same sums whatever the number of threads.
  const int hit = units(options.hit_probability), miss = units(options.miss_probability);
  const auto bands = static_cast<std::size_t>((grid.rows + kBandRows - 1) / kBandRows);
  pool.for_each(bands, [&](std::size_t band) {
    throw_if_interrupted();
    const int low = static_cast<int>(band) * kBandRows, high = std::min(low + kBandRows, grid.rows);
    const double low_y = grid.origin_y_m + low * grid.resolution_m, high_y = grid.origin_y_m + high * grid.resolution_m;
    const auto cell = [&](int column, int row) -> std::int16_t& {
      return grid.log_odds[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.columns) +
                           static_cast<std::size_t>(column)];
    };
    for (const auto& raster : rasters) {
      if (raster.extent.high_y < low_y || raster.extent.low_y >= high_y) continue;
      const int first_column = std::max(0, static_cast<int>((raster.extent.low_x - grid.origin_x_m) * per_metre));
      const int last_column =
          std::min(grid.columns - 1, static_cast<int>((raster.extent.high_x - grid.origin_x_m) * per_metre));
      const int first_row = std::max(low, static_cast<int>((raster.extent.low_y - grid.origin_y_m) * per_metre));
      const int last_row = std::min(high - 1, static_cast<int>((raster.extent.high_y - grid.origin_y_m) * per_metre));
      throw_if_interrupted();
      const Pose2 raster_from_map = inverse(raster.map_from_grid);
      const double c = std::cos(raster_from_map.phi), s = std::sin(raster_from_map.phi);
      for (int row = first_row; row <= last_row; ++row)
        for (int column = first_column; column <= last_column; ++column) {
          const double x = grid.origin_x_m + (column + 0.5) * grid.resolution_m,
                       y = grid.origin_y_m + (row + 0.5) * grid.resolution_m;
          const double rx = raster_from_map.x + c * x - s * y - raster.grid->origin_x_m,
                       ry = raster_from_map.y + s * x + c * y - raster.grid->origin_y_m;
          const int i = static_cast<int>(std::floor(rx / raster.grid->resolution_m)),
                    j = static_cast<int>(std::floor(ry / raster.grid->resolution_m));
          if (!raster.grid->inside(i, j)) continue;
          const int value = raster.grid->at(i, j);
          if (value != OccupancyGrid::kUnknown) add_to(cell(column, row), value);
        }
    }
    for (const auto& scan : scans) {
      if (scan.high_y < low_y || scan.low_y >= high_y) continue;
      for (std::size_t k = scan.first; k < scan.first + scan.count; ++k) {
        const double x1 = (rays[k].x - grid.origin_x_m) * per_metre, y1 = (rays[k].y - grid.origin_y_m) * per_metre;
        const double x0 = (scan.eye_x - grid.origin_x_m) * per_metre, y0 = (scan.eye_y - grid.origin_y_m) * per_metre;
        if (std::max(y0, y1) < low || std::min(y0, y1) >= high) continue;
        const int last_column = static_cast<int>(x1), last_row = static_cast<int>(y1);
        // Along the ray, row by row within the band: of each row, the columns that the ray crosses.
        const int from = std::max(low, static_cast<int>(std::min(y0, y1))),
                  to = std::min(high - 1, static_cast<int>(std::max(y0, y1)));
        const double slope = y1 != y0 ? (x1 - x0) / (y1 - y0) : 0.0;
        for (int row = from; row <= to; ++row) {
          double left = x0, right = x1;
          if (static_cast<int>(y0) != static_cast<int>(y1)) {
            const double bottom = std::clamp(static_cast<double>(row), std::min(y0, y1), std::max(y0, y1));
            const double top = std::clamp(static_cast<double>(row + 1), std::min(y0, y1), std::max(y0, y1));
            left = x0 + (bottom - y0) * slope, right = x0 + (top - y0) * slope;
          }
          if (left > right) std::swap(left, right);
          const int first = std::clamp(static_cast<int>(left), 0, grid.columns - 1),
                    last = std::clamp(static_cast<int>(right), 0, grid.columns - 1);
          for (int column = first; column <= last; ++column)
            if (column != last_column || row != last_row) add_to(cell(column, row), miss);
        }
        if (last_row >= low && last_row < high) add_to(cell(last_column, last_row), hit);
      }
    }
  });
  return grid;
}

}  // namespace mapweave::fusion
