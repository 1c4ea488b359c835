#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/fusion/growing_grid.h>

#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

constexpr double kWidest_m = 2000.0;  // beyond that a pose is wrong; bounds memory
constexpr int kBandRows = 256;        // a band of rows is drawn by one worker
constexpr double kFarWall_m = 10.0;   // that may be drawn off by a cell where its scan turned a little

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
    low_x = std::min(low_x, x);
    low_y = std::min(low_y, y);
    high_x = std::max(high_x, x);
    high_y = std::max(high_y, y);
  }
};

struct DrawnRaster {
  const OccupancyGrid* grid;
  Pose2 map_from_grid;
  Extent extent;
};

// What is to be drawn, in the map's frame.
struct Content {
  std::vector<Ray> rays;
  std::vector<DrawnScan> scans;
  std::vector<DrawnRaster> rasters;
  Extent extent;

  void add(const OccupancyGrid& grid, const Pose2& pose) {
    const double c = std::cos(pose.phi), s = std::sin(pose.phi);
    rasters.push_back({&grid, pose, {}});
    for (const double gx : {0.0, grid.columns * grid.resolution_m})
      for (const double gy : {0.0, grid.rows * grid.resolution_m}) {
        const double x = grid.origin_x_m + gx, y = grid.origin_y_m + gy;
        extent.add(pose.x + c * x - s * y, pose.y + s * x + c * y);
        rasters.back().extent.add(pose.x + c * x - s * y, pose.y + s * x + c * y);
      }
  }
  void add(const PackedScan& scan, const Pose2& pose, double max_range_m) {
    const double c = std::cos(pose.phi), s = std::sin(pose.phi);
    const auto& mount = scan.geometry->robot_from_laser.t;
    DrawnScan drawn{static_cast<float>(pose.x + c * mount.x() - s * mount.y()),
                    static_cast<float>(pose.y + s * mount.x() + c * mount.y()),
                    0,
                    0,
                    rays.size(),
                    0};
    drawn.low_y = drawn.high_y = drawn.eye_y;
    extent.add(drawn.eye_x, drawn.eye_y);
    for (const auto& p : points_in_robot(scan, 0.0, max_range_m)) {
      const Ray ray{static_cast<float>(pose.x + c * p.x - s * p.y), static_cast<float>(pose.y + s * p.x + c * p.y)};
      extent.add(ray.x, ray.y);
      drawn.low_y = std::min(drawn.low_y, ray.y);
      drawn.high_y = std::max(drawn.high_y, ray.y);
      rays.push_back(ray);
    }
    drawn.count = rays.size() - drawn.first;
    scans.push_back(drawn);
  }
  void add(const Node& node, double max_range_m) {
    if (!node.payload) return;
    const Pose2 pose = planar(node.map_from_node);
    if (const auto* grid = std::get_if<OccupancyGrid>(node.payload.get()))
      add(*grid, pose);
    else if (const auto* scan = std::get_if<PackedScan>(node.payload.get()))
      add(*scan, pose, max_range_m);  // keyframes show no walls
  }
  bool empty() const { return scans.empty() && rasters.empty(); }
};

void expect_drawable(const Extent& extent) {
  const double widest_m = std::max(extent.high_x - extent.low_x, extent.high_y - extent.low_y);
  if (widest_m > kWidest_m)
    throw Error(ErrorCode::kBadInput,
                "the map is " + std::to_string(static_cast<int>(widest_m)) + " m wide; at most 2000 m are drawn", {},
                "look for a robot whose trajectory ran away, or choose a coarser compose.resolution_m and cut the log");
}

// Of its size, with nothing drawn yet.
OccupancyGrid blank(const Content& content, double resolution_m) {
  OccupancyGrid grid;
  grid.resolution_m = resolution_m;
  // Rasters alone hold nothing finer than they are.
  double finest_m = 1e300;
  for (const auto& raster : content.rasters) finest_m = std::min(finest_m, raster.grid->resolution_m);
  if (content.scans.empty() && !content.rasters.empty()) grid.resolution_m = std::max(grid.resolution_m, finest_m);
  if (content.empty()) return grid;
  const Extent& extent = content.extent;
  expect_drawable(extent);
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
  return grid;
}

void add_to(std::int16_t& cell, int change) {
  const int value = std::clamp(cell + change, -2000, 2000);
  // Zero means never seen: what was seen as often wall as free leans to the last word.
  cell = static_cast<std::int16_t>(value != 0 ? value : change > 0 ? 1 : -1);
}

// Rows [low, high) of a grid, which one worker draws.
class Band {
 public:
  Band(OccupancyGrid& grid, int low, int high)
      : grid_(grid),
        low_(low),
        high_(high),
        low_y_(grid.origin_y_m + low * grid.resolution_m),
        high_y_(grid.origin_y_m + high * grid.resolution_m),
        per_metre_(1.0 / grid.resolution_m) {}

  void draw(const DrawnRaster& raster) {
    if (raster.extent.high_y < low_y_ || raster.extent.low_y >= high_y_) return;
    const int first_column = std::max(0, static_cast<int>((raster.extent.low_x - grid_.origin_x_m) * per_metre_));
    const int last_column =
        std::min(grid_.columns - 1, static_cast<int>((raster.extent.high_x - grid_.origin_x_m) * per_metre_));
    const int first_row = std::max(low_, static_cast<int>((raster.extent.low_y - grid_.origin_y_m) * per_metre_));
    const int last_row = std::min(high_ - 1, static_cast<int>((raster.extent.high_y - grid_.origin_y_m) * per_metre_));
    throw_if_interrupted();
    const Pose2 raster_from_map = inverse(raster.map_from_grid);
    const double c = std::cos(raster_from_map.phi), s = std::sin(raster_from_map.phi);
    for (int row = first_row; row <= last_row; ++row)
      for (int column = first_column; column <= last_column; ++column) {
        const double x = grid_.origin_x_m + (column + 0.5) * grid_.resolution_m,
                     y = grid_.origin_y_m + (row + 0.5) * grid_.resolution_m;
        const double rx = raster_from_map.x + c * x - s * y - raster.grid->origin_x_m,
                     ry = raster_from_map.y + s * x + c * y - raster.grid->origin_y_m;
        const int i = static_cast<int>(std::floor(rx / raster.grid->resolution_m)),
                  j = static_cast<int>(std::floor(ry / raster.grid->resolution_m));
        if (!raster.grid->inside(i, j)) continue;
        const int value = raster.grid->at(i, j);
        if (value != OccupancyGrid::kUnknown) add_to(cell(column, row), value);
      }
  }

  void draw(const DrawnScan& scan, const std::vector<Ray>& rays, int hit, int miss) {
    if (scan.high_y < low_y_ || scan.low_y >= high_y_) return;
    const double x0 = (scan.eye_x - grid_.origin_x_m) * per_metre_, y0 = (scan.eye_y - grid_.origin_y_m) * per_metre_;
    for (std::size_t k = scan.first; k < scan.first + scan.count; ++k) {
      const double x1 = (rays[k].x - grid_.origin_x_m) * per_metre_, y1 = (rays[k].y - grid_.origin_y_m) * per_metre_;
      if (std::max(y0, y1) < low_ || std::min(y0, y1) >= high_) continue;
      const int last_column = static_cast<int>(x1), last_row = static_cast<int>(y1);
      // Along the ray, row by row within the band: of each row, the columns that the ray crosses.
      const int from = std::max(low_, static_cast<int>(std::min(y0, y1))),
                to = std::min(high_ - 1, static_cast<int>(std::max(y0, y1)));
      const double slope = y1 != y0 ? (x1 - x0) / (y1 - y0) : 0.0;
      for (int row = from; row <= to; ++row) {
        double left = x0, right = x1;
        if (static_cast<int>(y0) != static_cast<int>(y1)) {
          const double bottom = std::clamp(static_cast<double>(row), std::min(y0, y1), std::max(y0, y1));
          const double top = std::clamp(static_cast<double>(row + 1), std::min(y0, y1), std::max(y0, y1));
          left = x0 + (bottom - y0) * slope;
          right = x0 + (top - y0) * slope;
        }
        if (left > right) std::swap(left, right);
        const int first = std::clamp(static_cast<int>(left), 0, grid_.columns - 1),
                  last = std::clamp(static_cast<int>(right), 0, grid_.columns - 1);
        for (int column = first; column <= last; ++column)
          if (column != last_column || row != last_row) add_to(cell(column, row), miss);
      }
      if (last_row >= low_ && last_row < high_) add_to(cell(last_column, last_row), hit);
    }
  }

 private:
  std::int16_t& cell(int column, int row) {
    return grid_.log_odds[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid_.columns) +
                          static_cast<std::size_t>(column)];
  }

  OccupancyGrid& grid_;
  const int low_, high_;
  const double low_y_, high_y_, per_metre_;
};

// Bands of rows are drawn side by side, each by all scans in order: the same sums whatever the number of threads.
void draw(const Content& content, const ComposeOptions& options, WorkerPool& pool, OccupancyGrid& grid) {
  const int hit = units(options.hit_probability), miss = units(options.miss_probability);
  const auto bands = static_cast<std::size_t>((grid.rows + kBandRows - 1) / kBandRows);
  pool.for_each(bands, [&](std::size_t number) {
    throw_if_interrupted();
    const int low = static_cast<int>(number) * kBandRows;
    Band band(grid, low, std::min(low + kBandRows, grid.rows));
    for (const DrawnRaster& raster : content.rasters) band.draw(raster);
    for (const DrawnScan& scan : content.scans) band.draw(scan, content.rays, hit, miss);
  });
}

// So that a grid of this extent covers all cells of another.
void cover(const OccupancyGrid& grid, Extent& extent) {
  const double inside_m = 1.5 * grid.resolution_m;  // blank() leaves a margin
  extent.add(grid.origin_x_m + inside_m, grid.origin_y_m + inside_m);
  extent.add(grid.origin_x_m + grid.columns * grid.resolution_m - inside_m,
             grid.origin_y_m + grid.rows * grid.resolution_m - inside_m);
}

// To where they are in a grid that covers them: cells are whole ones from the map's origin.
void copy_cells(const OccupancyGrid& from, OccupancyGrid& to) {
  const auto column = std::lround((from.origin_x_m - to.origin_x_m) / to.resolution_m),
             row = std::lround((from.origin_y_m - to.origin_y_m) / to.resolution_m);
  for (std::ptrdiff_t y = 0; y < from.rows; ++y)
    std::copy_n(from.log_odds.begin() + y * from.columns, from.columns,
                to.log_odds.begin() + (row + y) * to.columns + column);
}

}  // namespace

OccupancyGrid compose_grid(const Map& map, const ComposeOptions& options, WorkerPool& pool) {
  Content content;
  for (const auto& entry : map.nodes) content.add(entry.second, options.max_range_m);
  OccupancyGrid grid = blank(content, options.resolution_m);
  draw(content, options, pool, grid);
  return grid;
}

// Whether all that was drawn is there, in the same order and place, before what is new.
bool GrowingGrid::goes_on_in(const Map& map) const {
  const double most_m = 0.5 * options_.resolution_m;
  auto node = map.nodes.begin();
  for (const Drawn& drawn : drawn_) {
    while (node != map.nodes.end() && node->second.payload == nullptr) ++node;
    if (node == map.nodes.end() || node->first != drawn.node || node->second.payload != drawn.payload) return false;
    const Pose3& now = node->second.map_from_node;
    if ((now.t - drawn.map_from_node.t).norm() > most_m ||
        now.q.angularDistance(drawn.map_from_node.q) > most_m / kFarWall_m)
      return false;
    ++node;
  }
  return true;
}

const OccupancyGrid& GrowingGrid::draw(const Map& map, WorkerPool& pool) {
  if (!goes_on_in(map)) {
    drawn_.clear();
    grid_ = {};
  }
  Content content;
  std::vector<Drawn> fresh;
  std::size_t known = drawn_.size();
  for (const auto& [id, node] : map.nodes) {
    if (node.payload == nullptr || (known > 0 && known-- > 0)) continue;
    content.add(node, options_.max_range_m);
    fresh.push_back({id, node.payload, node.map_from_node});
  }
  if (!content.rasters.empty()) {  // they may be coarser
    grid_ = compose_grid(map, options_, pool);
  } else if (!content.empty()) {
    if (!grid_.empty()) cover(grid_, content.extent);
    OccupancyGrid grid = blank(content, options_.resolution_m);
    copy_cells(grid_, grid);
    fusion::draw(content, options_, pool, grid);
    grid_ = std::move(grid);
  }
  drawn_.insert(drawn_.end(), fresh.begin(), fresh.end());
  return grid_;
}

}  // namespace mapweave::fusion
