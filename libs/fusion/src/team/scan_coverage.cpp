#include "scan_coverage.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapweave::fusion {
namespace {

constexpr double kMostCells = 64e6;
constexpr double kFreeCells = 3.0;     // cells of walls in one of free space, along each axis
constexpr std::size_t kFreeRays = 1;   // every so many rays show what is free
constexpr double kFarthest_m = 30.0;   // as far as scans are matched
constexpr double kSparse_m = 0.3;      // between neighbouring rays: from there on a scan shows dots, not walls
constexpr double kBeforeWall_m = 0.2;  // free space ends here

const PackedScan* scan_of(const Node& node) { return std::get_if<PackedScan>(node.payload.get()); }

void settle(std::vector<std::uint32_t>& cells) {
  std::sort(cells.begin(), cells.end());
  cells.erase(std::unique(cells.begin(), cells.end()), cells.end());
}

}  // namespace

ScanCoverage::ScanCoverage(const Table<NodeId, Node>& nodes, double cell_m, int sightings) : sightings_(sightings) {
  constexpr double kNowhere = std::numeric_limits<double>::infinity();
  double low[2] = {kNowhere, kNowhere}, high[2] = {-kNowhere, -kNowhere};
  for (const auto& [id, node] : nodes) {
    const PackedScan* scan = scan_of(node);
    if (scan == nullptr) continue;
    const double reach_m = std::min(kFarthest_m, scan->geometry->max_range_m) + 1.0;
    for (const int axis : {0, 1}) {
      low[axis] = std::min(low[axis], node.map_from_node.t(axis) - reach_m);
      high[axis] = std::max(high[axis], node.map_from_node.t(axis) + reach_m);
    }
  }
  if (!(low[0] < high[0])) return;
  x_m_ = low[0];
  y_m_ = low[1];
  const double width_m = high[0] - low[0], height_m = high[1] - low[1];
  walls_.cell_m = std::max(cell_m, std::sqrt(width_m * height_m / kMostCells));
  free_.cell_m = kFreeCells * walls_.cell_m;
  for (Raster* raster : {&walls_, &free_}) {
    raster->columns = static_cast<std::size_t>(width_m / raster->cell_m) + 1;
    raster->rows = static_cast<std::size_t>(height_m / raster->cell_m) + 1;
    raster->count.assign(raster->columns * raster->rows, 0);
  }
  all_walls_.assign(walls_.count.size(), 0);
}

std::size_t ScanCoverage::cell(const Raster& raster, double x_m, double y_m) const {
  const auto at = [](double offset_m, double cell_m, std::size_t size) {
    return std::min(size - 1, static_cast<std::size_t>(std::max(0.0, offset_m / cell_m)));
  };
  return at(y_m - y_m_, raster.cell_m, raster.rows) * raster.columns + at(x_m - x_m_, raster.cell_m, raster.columns);
}

ScanCoverage::Sight ScanCoverage::sight_of(const Node& node) const {
  Sight sight;
  const Pose2 pose = planar(node.map_from_node);
  const double c = std::cos(pose.phi), s = std::sin(pose.phi);
  const PackedScan& scan = *scan_of(node);
  const double dense_m = kSparse_m / std::max(1e-6, std::abs(scan.geometry->angle_step_rad));
  const std::vector<ScanPoint> points = points_in_robot(scan, 0.0, std::min(kFarthest_m, dense_m));
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double x = points[i].x, y = points[i].y;
    const double dx = c * x - s * y, dy = s * x + c * y, range_m = std::hypot(dx, dy);
    sight.walls.push_back(static_cast<std::uint32_t>(cell(walls_, pose.x + dx, pose.y + dy)));
    if (i % kFreeRays != 0) continue;
    for (double at_m = 0.0; at_m < range_m - kBeforeWall_m; at_m += free_.cell_m)
      sight.free.push_back(
          static_cast<std::uint32_t>(cell(free_, pose.x + dx * at_m / range_m, pose.y + dy * at_m / range_m)));
  }
  settle(sight.walls);
  settle(sight.free);
  return sight;
}

// By this cell or one beside it.
bool ScanCoverage::is_shown(const Raster& raster, std::size_t cell, int sightings) const {
  const auto columns = static_cast<std::ptrdiff_t>(raster.columns),
             size = static_cast<std::ptrdiff_t>(raster.count.size()), at = static_cast<std::ptrdiff_t>(cell);
  for (const std::ptrdiff_t row : {std::ptrdiff_t{0}, -columns, columns})
    for (std::ptrdiff_t near = at + row - 1; near <= at + row + 1; ++near)
      if (near >= 0 && near < size && raster.count[static_cast<std::size_t>(near)] >= sightings) return true;
  return false;
}

double ScanCoverage::new_share(const Raster& raster, const std::vector<std::uint32_t>& cells) const {
  if (cells.empty()) return 0.0;
  const auto is_new = [&](std::uint32_t cell) { return !is_shown(raster, cell, sightings_); };
  return static_cast<double>(std::count_if(cells.begin(), cells.end(), is_new)) / static_cast<double>(cells.size());
}

double ScanCoverage::new_share(const Sight& sight) const {
  return std::max(new_share(walls_, sight.walls), new_share(free_, sight.free));
}

void ScanCoverage::add(const Sight& sight) {
  const auto count = [](Raster& raster, const std::vector<std::uint32_t>& cells) {
    for (const std::uint32_t cell : cells)
      if (raster.count[cell] < 255) ++raster.count[cell];
  };
  count(walls_, sight.walls);
  count(free_, sight.free);
  leave_out(sight);
}

void ScanCoverage::leave_out(const Sight& sight) {
  for (const std::uint32_t cell : sight.walls) all_walls_[cell] = 1;
}

double ScanCoverage::left_out() const {
  std::size_t all = 0, lost = 0;
  for (std::size_t cell = 0; cell < all_walls_.size(); ++cell) {
    if (all_walls_[cell] == 0) continue;
    ++all;
    lost += is_shown(walls_, cell, 1) ? 0 : 1;
  }
  return all == 0 ? 0.0 : static_cast<double>(lost) / static_cast<double>(all);
}

}  // namespace mapweave::fusion
