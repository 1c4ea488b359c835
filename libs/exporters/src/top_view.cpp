#include <mapweave/exporters/top_view.h>

#include "framed_map.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mapweave::exporters {
namespace {

constexpr double kAboveRobots_m = 0.8;  // and higher: a ceiling
constexpr double kOutlier = 0.01;       // share of the points, on each side, that may lie beyond the picture
constexpr double kLeastSide_m = 1.0;
const cv::Vec3b kWallInk(90, 90, 90), kUnseen(228, 228, 228);  // paler than map_picture_png()'s walls: dots lie on them

struct Extent {
  double low = 0.0, high = 0.0;
  double length() const { return high - low; }
};

Extent extent_of(std::vector<double> points, const std::vector<double>& robots) {
  Extent extent;
  const auto outlier = static_cast<std::size_t>(kOutlier * static_cast<double>(points.size()));
  if (!points.empty()) {
    std::sort(points.begin(), points.end());
    extent = {points[outlier], points[points.size() - 1 - outlier]};
  } else {
    extent = {robots.front(), robots.front()};
  }
  for (const double robot : robots) {
    extent.low = std::min(extent.low, robot);
    extent.high = std::max(extent.high, robot);
  }
  const double rim = 0.02 * extent.length() + std::max(0.0, 0.5 * (kLeastSide_m - extent.length()));
  return {extent.low - rim, extent.high + rim};
}

// The middles of known cells.
void add_known(const OccupancyGrid& grid, std::vector<double>& x, std::vector<double>& y) {
  for (std::int32_t row = 0; row < grid.rows; ++row)
    for (std::int32_t column = 0; column < grid.columns; ++column)
      if (grid.at(column, row) != OccupancyGrid::kUnknown) {
        x.push_back(grid.origin_x_m + (column + 0.5) * grid.resolution_m);
        y.push_back(grid.origin_y_m + (row + 0.5) * grid.resolution_m);
      }
}

// Of the cells below a pixel a wall wins: thinned walls stay closed.
void draw_grid(const OccupancyGrid& grid, MapRaster& raster) {
  const double pixel_m = 1.0 / raster.pixels_per_m;
  const auto cells = [&](double low_m, double origin_m, std::int32_t count) {
    const auto cell = [&](double place_m) {
      return static_cast<std::int32_t>(
          std::clamp(std::floor((place_m - origin_m) / grid.resolution_m), -1.0, static_cast<double>(count)));
    };
    return std::pair(std::max(0, cell(low_m)), std::min(count - 1, std::max(cell(low_m), cell(low_m + pixel_m) - 1)));
  };
  for (int row = 0; row < raster.pixels.rows; ++row) {
    const auto [low, high] = cells(raster.low_m + (raster.pixels.rows - 1 - row) * pixel_m, grid.origin_y_m, grid.rows);
    for (int column = 0; column < raster.pixels.cols; ++column) {
      const auto [left, right] = cells(raster.left_m + column * pixel_m, grid.origin_x_m, grid.columns);
      bool wall = false, known = false;
      for (std::int32_t r = low; r <= high && !wall; ++r)
        for (std::int32_t c = left; c <= right && !wall; ++c) {
          wall = grid.at(c, r) > 0;
          known = known || grid.at(c, r) != OccupancyGrid::kUnknown;
        }
      if (wall || !known) raster.pixels.at<cv::Vec3b>(row, column) = wall ? kWallInk : kUnseen;
    }
  }
}

}  // namespace

std::string top_view_png(const std::vector<ColouredPoint>& points, const std::vector<SessionTrajectory>& trajectories,
                         const PictureOptions& options, const OccupancyGrid* grid) {
  std::vector<double> robot_x, robot_y;
  double highest = -1e9;
  for (const SessionTrajectory& trajectory : trajectories)
    for (const StampedPose& pose : trajectory.poses) {
      MAPWEAVE_EXPECT(is_finite(pose.map_from_robot), "a robot's pose is finite");
      robot_x.push_back(pose.map_from_robot.t.x());
      robot_y.push_back(pose.map_from_robot.t.y());
      highest = std::max(highest, pose.map_from_robot.t.z());
    }
  std::vector<const ColouredPoint*> shown;
  for (const ColouredPoint& point : points) {
    MAPWEAVE_EXPECT(point.point.allFinite(), "a point is finite");
    if (robot_x.empty() || point.point.z() < static_cast<float>(highest + kAboveRobots_m)) shown.push_back(&point);
  }
  MAPWEAVE_EXPECT(!shown.empty() || !robot_x.empty(), "a top view shows points or trajectories");
  std::stable_sort(shown.begin(), shown.end(),
                   [](const auto* a, const auto* b) { return a->point.z() < b->point.z(); });

  std::vector<double> x, y;
  for (const ColouredPoint* point : shown) {
    x.push_back(static_cast<double>(point->point.x()));
    y.push_back(static_cast<double>(point->point.y()));
  }
  const bool on_grid = grid != nullptr && !grid->empty();
  if (on_grid) add_known(*grid, x, y);
  const Extent across = extent_of(std::move(x), robot_x), along = extent_of(std::move(y), robot_y);
  MapRaster raster;
  raster.pixels_per_m = options.common_side_px / std::max(across.length(), along.length());
  raster.left_m = across.low;
  raster.low_m = along.low;
  const int columns = std::max(1, static_cast<int>(std::lround(across.length() * raster.pixels_per_m))),
            rows = std::max(1, static_cast<int>(std::lround(along.length() * raster.pixels_per_m)));
  raster.pixels = cv::Mat(rows, columns, CV_8UC3, kPaper);
  if (on_grid) draw_grid(*grid, raster);
  for (const ColouredPoint* point : shown) {
    const double column = (static_cast<double>(point->point.x()) - across.low) * raster.pixels_per_m,
                 row = rows - (static_cast<double>(point->point.y()) - along.low) * raster.pixels_per_m;
    if (!(column >= 0 && row >= 0 && column < columns && row < rows)) continue;
    // On white paper bright dots would not be seen.
    const auto shade = [&](int shift) { return 0.85 * (point->rgb >> shift & 0xff); };
    cv::circle(raster.pixels, {static_cast<int>(column), static_cast<int>(row)}, 1,
               cv::Scalar(shade(0), shade(8), shade(16)), cv::FILLED);
  }
  raster.size = metres(across.length(), 1);
  raster.size = raster.size.substr(0, raster.size.size() - 2) + " x " + metres(along.length(), 1) + ", " +
                std::to_string(points.size()) + " landmarks";
  return framed_map_png(raster, trajectories, options);
}

}  // namespace mapweave::exporters
