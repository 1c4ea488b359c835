#include "grid_levels.h"

#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <vector>

namespace mapweave::report {
namespace {

constexpr unsigned char kWall = 20, kFree = 255, kUnknown = 228;

struct Cells {
  std::int32_t column, row, columns, rows;
};

// The known cells' rectangle; without `left_out` of them at each of its sides.
Cells known_cells(const OccupancyGrid& grid, double left_out) {
  std::vector<std::size_t> in_column(static_cast<std::size_t>(grid.columns)),
      in_row(static_cast<std::size_t>(grid.rows));
  std::size_t known = 0;
  for (std::int32_t row = 0; row < grid.rows; ++row)
    for (std::int32_t column = 0; column < grid.columns; ++column)
      if (grid.at(column, row) != OccupancyGrid::kUnknown) {
        ++in_column[static_cast<std::size_t>(column)];
        ++in_row[static_cast<std::size_t>(row)];
        ++known;
      }
  const auto most = static_cast<std::size_t>(left_out * static_cast<double>(known));
  const auto inner = [&](const std::vector<std::size_t>& counts) {
    std::size_t low = 0, high = counts.size(), below = 0, above = 0;
    while (low < high && below + counts[low] <= most) below += counts[low++];
    while (high > low && above + counts[high - 1] <= most) above += counts[--high];
    return std::pair(static_cast<std::int32_t>(low), static_cast<std::int32_t>(high - low));
  };
  const auto [column, columns] = inner(in_column);
  const auto [row, rows] = inner(in_row);
  return {column, row, columns, rows};
}

// One pixel for `step` by `step` cells, the highest y on top.
cv::Mat thinned(const OccupancyGrid& grid, const Cells& cells, int step) {
  cv::Mat image((cells.rows + step - 1) / step, (cells.columns + step - 1) / step, CV_8UC1, cv::Scalar(kUnknown));
  for (std::int32_t row = 0; row < cells.rows; ++row) {
    unsigned char* line = image.ptr<unsigned char>(image.rows - 1 - row / step);
    for (std::int32_t column = 0; column < cells.columns; ++column) {
      const std::int16_t value = grid.at(cells.column + column, cells.row + row);
      unsigned char& shade = line[column / step];
      if (value > 0)
        shade = kWall;
      else if (value < 0 && shade != kWall)
        shade = kFree;
    }
  }
  return image;
}

Json level_json(const OccupancyGrid& grid, const Cells& cells, int step) {
  const cv::Mat image = thinned(grid, cells, step);
  std::vector<unsigned char> png;
  cv::imencode(".png", image, png, {cv::IMWRITE_PNG_COMPRESSION, 6});
  return {{"x", grid.origin_x_m + cells.column * grid.resolution_m},
          {"y", grid.origin_y_m + cells.row * grid.resolution_m},
          {"columns", image.cols},
          {"rows", image.rows},
          {"metres_per_pixel", step * grid.resolution_m},
          {"png", data_url("png", {reinterpret_cast<const char*>(png.data()), png.size()})}};
}

}  // namespace

bool has_known_cells(const OccupancyGrid& grid) {
  return std::any_of(grid.log_odds.begin(), grid.log_odds.end(),
                     [](std::int16_t value) { return value != OccupancyGrid::kUnknown; });
}

DrawnGrid drawn_grid(const OccupancyGrid& grid, const GridDetail& detail) {
  constexpr double kLeftOut = 0.004;  // single rays out of a window do not make the map small
  const Cells all = known_cells(grid, 0.0), most = known_cells(grid, kLeftOut);
  const int side = std::max(all.columns, all.rows);
  const auto step_for = [&](int pixels) { return std::max(1, (side + pixels - 1) / pixels); };
  const int coarse = step_for(detail.coarse_px), fine = step_for(detail.fine_px);
  Json levels = Json::array({level_json(grid, all, coarse)});
  if (fine < coarse) levels.push_back(level_json(grid, all, fine));
  const double x = grid.origin_x_m + most.column * grid.resolution_m,
               y = grid.origin_y_m + most.row * grid.resolution_m;
  return {{{"resolution_m", grid.resolution_m}, {"levels", levels}},
          x,
          y,
          x + most.columns * grid.resolution_m,
          y + most.rows * grid.resolution_m};
}

}  // namespace mapweave::report
