#include <mapweave/matching/grid_walls.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mapweave::matching {
namespace {

constexpr double kCell_m = 0.1;        // twice a usual cell: as fine as walls of two makers agree
constexpr int kMostCells = 2048;       // across: bounds time and memory
constexpr double kWallShare = 0.125;   // of a reduced cell's pixels: enough to be wall, so that thin walls stay
constexpr double kSmooth_cells = 1.5;  // free space is blurred by this before its gradient is taken
constexpr double kOneSided =
    0.3;  // sum of unit vectors to the free cells around a wall, over their number: less where both sides are free

struct Box {
  int x0, y0, x1, y1;  // cells, inclusive
};

Box known_part(const OccupancyGrid& grid) {
  Box box{grid.columns, grid.rows, -1, -1};
  for (int y = 0; y < grid.rows; ++y)
    for (int x = 0; x < grid.columns; ++x)
      if (grid.at(x, y) != OccupancyGrid::kUnknown)
        box = {std::min(box.x0, x), std::min(box.y0, y), std::max(box.x1, x), std::max(box.y1, y)};
  return box;
}

// The sides that a wall cell shows to free cells around it: none, one, or both of a thin wall.
std::vector<cv::Vec2f> sides_of(const cv::Mat& free_cells, const cv::Mat& gradient_x, const cv::Mat& gradient_y,
                                int row, int column) {
  double sum_x = 0.0, sum_y = 0.0, xx = 0.0, xy = 0.0, yy = 0.0;
  int count = 0;
  for (int y = std::max(0, row - 2); y <= std::min(free_cells.rows - 1, row + 2); ++y)
    for (int x = std::max(0, column - 2); x <= std::min(free_cells.cols - 1, column + 2); ++x) {
      if (!free_cells.at<std::uint8_t>(y, x)) continue;
      const double length = std::hypot(x - column, y - row), ux = (x - column) / length, uy = (y - row) / length;
      sum_x += ux;
      sum_y += uy;
      xx += ux * ux;
      xy += ux * uy;
      yy += uy * uy;
      ++count;
    }
  if (count == 0) return {};
  if (std::hypot(sum_x, sum_y) > kOneSided * count) {
    const cv::Vec2f gradient(gradient_x.at<float>(row, column), gradient_y.at<float>(row, column));
    const double length = cv::norm(gradient);
    if (length > 0.0) return {gradient / length};
  }
  const double axis = 0.5 * std::atan2(2.0 * xy, xx - yy);
  const cv::Vec2f normal(static_cast<float>(std::cos(axis)), static_cast<float>(std::sin(axis)));
  return {normal, -normal};
}

}  // namespace

GridWalls walls_of(const OccupancyGrid& grid) {
  GridWalls walls;
  const Box box = known_part(grid);
  if (box.x1 < box.x0) return walls;
  const int side = std::max(box.x1 - box.x0, box.y1 - box.y0) + 1;
  const int factor =
      std::max({1, static_cast<int>(std::lround(kCell_m / grid.resolution_m)), (side + kMostCells - 1) / kMostCells});
  walls.cell_m = factor * grid.resolution_m;
  walls.origin_x_m = grid.origin_x_m + box.x0 * grid.resolution_m;
  walls.origin_y_m = grid.origin_y_m + box.y0 * grid.resolution_m;
  walls.columns = (box.x1 - box.x0) / factor + 1;
  walls.rows = (box.y1 - box.y0) / factor + 1;

  const int least = std::max(1, static_cast<int>(kWallShare * factor * factor));
  cv::Mat free_cells(walls.rows, walls.columns, CV_8U, cv::Scalar(0)), wall_cells = free_cells.clone();
  for (int row = 0; row < walls.rows; ++row)
    for (int column = 0; column < walls.columns; ++column) {
      int free_count = 0, wall_count = 0;
      for (int y = 0; y < factor; ++y)
        for (int x = 0; x < factor; ++x) {
          const int gx = box.x0 + column * factor + x, gy = box.y0 + row * factor + y;
          if (!grid.inside(gx, gy)) continue;
          free_count += grid.at(gx, gy) < 0;
          wall_count += grid.at(gx, gy) > 0;
        }
      wall_cells.at<std::uint8_t>(row, column) = wall_count >= least;
      free_cells.at<std::uint8_t>(row, column) = wall_count < least && 2 * free_count > factor * factor;
    }

  cv::Mat depth, padded;
  cv::copyMakeBorder(free_cells, padded, 1, 1, 1, 1, cv::BORDER_CONSTANT, cv::Scalar(0));  // outside is not free
  cv::distanceTransform(padded, depth, cv::DIST_L2, cv::DIST_MASK_5);
  cv::Mat smooth, gradient_x, gradient_y, beside_free;
  free_cells.convertTo(smooth, CV_32F);
  cv::GaussianBlur(smooth, smooth, cv::Size(0, 0), kSmooth_cells, kSmooth_cells, cv::BORDER_CONSTANT);
  cv::Sobel(smooth, gradient_x, CV_32F, 1, 0, 3, 0.125);
  cv::Sobel(smooth, gradient_y, CV_32F, 0, 1, 3, 0.125);
  cv::dilate(free_cells, beside_free, cv::Mat::ones(3, 3, CV_8U));
  walls.depth_m.reserve(static_cast<std::size_t>(walls.rows) * static_cast<std::size_t>(walls.columns));
  for (int row = 0; row < walls.rows; ++row)
    for (int column = 0; column < walls.columns; ++column) {
      walls.depth_m.push_back(depth.at<float>(row + 1, column + 1) * static_cast<float>(walls.cell_m));
      if (!wall_cells.at<std::uint8_t>(row, column) || !beside_free.at<std::uint8_t>(row, column)) continue;
      for (const auto& normal : sides_of(free_cells, gradient_x, gradient_y, row, column))
        walls.faces.push_back({static_cast<float>(walls.origin_x_m + (column + 0.5) * walls.cell_m),
                               static_cast<float>(walls.origin_y_m + (row + 0.5) * walls.cell_m), normal[0],
                               normal[1]});
    }
  return walls;
}

GridWalls mirrored(const GridWalls& walls) {
  GridWalls image = walls;
  image.origin_x_m = -(walls.origin_x_m + walls.columns * walls.cell_m);
  for (int row = 0; row < walls.rows; ++row)
    std::reverse(image.depth_m.begin() + static_cast<std::ptrdiff_t>(row) * walls.columns,
                 image.depth_m.begin() + static_cast<std::ptrdiff_t>(row + 1) * walls.columns);
  for (auto& face : image.faces) {
    face.x = -face.x;
    face.normal_x = -face.normal_x;
  }
  return image;
}

}  // namespace mapweave::matching
