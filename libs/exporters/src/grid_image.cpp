#include <mapweave/exporters/grid_image.h>

#include "framed_map.h"
#include "grey_image.h"
#include "number_text.h"

#include <mapweave/core/error.h>

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace mapweave::exporters {
namespace {

const cv::Scalar kWall(25, 25, 25), kUnknown(228, 228, 228), kMark(40, 40, 220);

// Cells [first_column, first_column + columns) x [first_row, ...) of the grid's lattice; may reach beyond the grid.
struct Window {
  std::int64_t first_column = 0, first_row = 0, columns = 0, rows = 0;
};

// First and last place that hold all but `kOutlier` of the known cells at either end: single rays that left by a window
// would shrink the building to a corner of its picture. The rim around the window gives back more than this takes from
// what is solid.
std::pair<std::int64_t, std::int64_t> without_outliers(const std::vector<std::int64_t>& known) {
  constexpr double kOutlier = 0.005;
  std::int64_t all = 0;
  for (const std::int64_t count : known) all += count;
  const auto outliers = static_cast<std::int64_t>(kOutlier * static_cast<double>(all));
  std::int64_t first = 0, last = static_cast<std::int64_t>(known.size()) - 1;
  for (std::int64_t passed = 0; first < last && passed + known[static_cast<std::size_t>(first)] <= outliers; ++first)
    passed += known[static_cast<std::size_t>(first)];
  for (std::int64_t passed = 0; last > first && passed + known[static_cast<std::size_t>(last)] <= outliers; --last)
    passed += known[static_cast<std::size_t>(last)];
  return {first, last};
}

// What is known and where robots were, with a rim.
Window window_of(const OccupancyGrid& grid, const std::vector<SessionTrajectory>& trajectories) {
  std::vector<std::int64_t> known_in_column(static_cast<std::size_t>(grid.columns)),
      known_in_row(static_cast<std::size_t>(grid.rows));
  for (std::int32_t row = 0; row < grid.rows; ++row)
    for (std::int32_t column = 0; column < grid.columns; ++column)
      if (grid.at(column, row) != OccupancyGrid::kUnknown) {
        ++known_in_column[static_cast<std::size_t>(column)];
        ++known_in_row[static_cast<std::size_t>(row)];
      }
  auto [left, right] = without_outliers(known_in_column);
  auto [low, high] = without_outliers(known_in_row);
  // A robot that went astray may widen the picture by half the map, no more.
  const auto cell_of = [&](double position_m, double origin_m, std::int32_t count) {
    return static_cast<std::int64_t>(
        std::clamp(std::floor((position_m - origin_m) / grid.resolution_m), -0.5 * count, 1.5 * count));
  };
  for (const auto& trajectory : trajectories)
    for (const auto& pose : trajectory.poses) {
      const std::int64_t column = cell_of(pose.map_from_robot.t.x(), grid.origin_x_m, grid.columns),
                         row = cell_of(pose.map_from_robot.t.y(), grid.origin_y_m, grid.rows);
      left = std::min(left, column);
      right = std::max(right, column);
      low = std::min(low, row);
      high = std::max(high, row);
    }
  const std::int64_t rim = 2 + std::max(right - left, high - low) / 50;
  return {left - rim, low - rim, right - left + 1 + 2 * rim, high - low + 1 + 2 * rim};
}

// How cells become pixels: each cell a square of `enlarged` pixels, or squares of `thinned` cells one pixel.
struct Zoom {
  std::int64_t enlarged = 1, thinned = 1;
  double pixels_per_cell() const { return static_cast<double>(enlarged) / static_cast<double>(thinned); }
};

Zoom zoom_of(const Window& window, const PictureOptions& options) {
  const std::int64_t longer = std::max(window.columns, window.rows);
  Zoom zoom;
  if (longer > options.most_side_px)
    zoom.thinned = (longer + options.most_side_px - 1) / options.most_side_px;
  else
    zoom.enlarged = std::clamp<std::int64_t>((options.common_side_px + longer / 2) / longer, 1, 40);
  return zoom;
}

cv::Mat drawn_cells(const OccupancyGrid& grid, const Window& window, const Zoom& zoom) {
  const int columns = static_cast<int>((window.columns + zoom.thinned - 1) / zoom.thinned),
            rows = static_cast<int>((window.rows + zoom.thinned - 1) / zoom.thinned);
  cv::Mat image(rows * static_cast<int>(zoom.enlarged), columns * static_cast<int>(zoom.enlarged), CV_8UC3, kUnknown);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      bool wall = false, known = false;  // walls win, so that thinning never opens one
      for (std::int64_t y = 0; y < zoom.thinned && !wall; ++y)
        for (std::int64_t x = 0; x < zoom.thinned && !wall; ++x) {
          const std::int64_t c = window.first_column + column * zoom.thinned + x,
                             r = window.first_row + row * zoom.thinned + y;
          if (c < 0 || r < 0 || c >= grid.columns || r >= grid.rows) continue;
          const std::int16_t log_odds = grid.at(static_cast<std::int32_t>(c), static_cast<std::int32_t>(r));
          wall = log_odds > 0;
          known = known || log_odds != OccupancyGrid::kUnknown;
        }
      if (!known) continue;
      const int size = static_cast<int>(zoom.enlarged);
      image(cv::Rect(column * size, (rows - 1 - row) * size, size, size)).setTo(wall ? kWall : kPaper);
    }
  return image;
}

}  // namespace

std::string grid_png(const OccupancyGrid& grid) {
  MapServerImage image = grey_image(grid);
  return encoded(cv::Mat(image.rows, image.columns, CV_8U, image.shades.data()));
}

std::string map_picture_png(const OccupancyGrid& grid, const std::vector<SessionTrajectory>& trajectories,
                            const PictureOptions& options, const std::vector<PictureMark>& marks) {
  MAPWEAVE_EXPECT(!grid.empty(), "a grid without cells has no picture");
  const Window window = window_of(grid, trajectories);
  const Zoom zoom = zoom_of(window, options);
  MapRaster raster;
  raster.pixels = drawn_cells(grid, window, zoom);
  raster.pixels_per_m = zoom.pixels_per_cell() / grid.resolution_m;
  raster.left_m = grid.origin_x_m + static_cast<double>(window.first_column) * grid.resolution_m;
  raster.low_m = grid.origin_y_m + static_cast<double>(window.first_row) * grid.resolution_m;
  raster.size = metres(static_cast<double>(window.columns) * grid.resolution_m, 1);
  raster.size = raster.size.substr(0, raster.size.size() - 2) + " x " +
                metres(static_cast<double>(window.rows) * grid.resolution_m, 1) + ", cell ";
  append_shortest(raster.size, grid.resolution_m);
  raster.size += " m";
  for (const PictureMark& mark : marks) {
    constexpr double kLeast_px = 8.0, kLine_px = 2.0;
    const cv::Point middle(
        static_cast<int>(std::lround((mark.x_m - raster.left_m) * raster.pixels_per_m)),
        raster.pixels.rows - static_cast<int>(std::lround((mark.y_m - raster.low_m) * raster.pixels_per_m)));
    const double radius = std::max(kLeast_px, mark.radius_m * raster.pixels_per_m);
    cv::circle(raster.pixels, middle, static_cast<int>(std::lround(radius)), kMark, static_cast<int>(kLine_px),
               cv::LINE_AA);
  }
  return framed_map_png(raster, trajectories, options);
}

}  // namespace mapweave::exporters
