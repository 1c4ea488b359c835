#include "small_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/exporters/grid_image.h>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>

namespace mapweave::exporters {
namespace {

using test::drawn_grid;
using test::node_id;

cv::Mat decoded(const std::string& png) {
  return cv::imdecode(std::vector<std::uint8_t>(png.begin(), png.end()), cv::IMREAD_UNCHANGED);
}

// A hall of this size in cells, walls around.
OccupancyGrid hall(std::size_t columns, std::size_t rows) {
  std::vector<std::string> letters(rows, "#" + std::string(columns - 2, '.') + "#");
  letters.front() = letters.back() = std::string(columns, '#');
  return drawn_grid(letters);
}

SessionTrajectory straight_trajectory(const std::string& robot, double y_m, double length_m) {
  SessionTrajectory trajectory;
  trajectory.session = node_id(robot, 0).session;
  for (int i = 0; i <= 20; ++i)
    trajectory.poses.push_back({Stamp{i}, spatial(Pose2(0.3 + length_m * i / 20.0, y_m, 0.0))});
  return trajectory;
}

std::size_t pixels_like(const cv::Mat& picture, int red, int green, int blue) {
  std::size_t count = 0;
  for (int row = 0; row < picture.rows; ++row)
    for (int column = 0; column < picture.cols; ++column) {
      const auto& pixel = picture.at<cv::Vec3b>(row, column);
      if (std::abs(pixel[2] - red) + std::abs(pixel[1] - green) + std::abs(pixel[0] - blue) < 6) ++count;
    }
  return count;
}

TEST(GridPng, is_one_grey_pixel_per_cell_with_the_highest_y_on_top) {
  const cv::Mat image = decoded(grid_png(drawn_grid({"#. ", "..#"})));
  ASSERT_EQ(image.type(), CV_8UC1);
  ASSERT_EQ(image.size(), cv::Size(3, 2));
  EXPECT_EQ(std::vector<std::uint8_t>(image.begin<std::uint8_t>(), image.end<std::uint8_t>()),
            (std::vector<std::uint8_t>{0, 254, 205, 254, 254, 0}));
}

TEST(GridPng, needs_cells) {
  EXPECT_THROW(grid_png(OccupancyGrid{}), ContractViolation);
  EXPECT_THROW(map_picture_png(OccupancyGrid{}, {}), ContractViolation);
}

TEST(MapPicture, of_a_small_room_is_large_enough_to_see) {
  for (const auto& [columns, rows] : {std::pair(3, 3), std::pair(100, 60), std::pair(40, 200), std::pair(200, 20)}) {
    const cv::Mat picture =
        decoded(map_picture_png(hall(static_cast<std::size_t>(columns), static_cast<std::size_t>(rows)), {}));
    EXPECT_EQ(picture.type(), CV_8UC3);
    EXPECT_GE(picture.cols, 900) << columns << " x " << rows;
    EXPECT_LE(std::max(picture.cols, picture.rows), 2500) << columns << " x " << rows;
  }
}

TEST(MapPicture, of_a_large_map_is_thinned_and_keeps_every_wall) {
  PictureOptions options;
  options.most_side_px = 1000;
  const cv::Mat picture = decoded(map_picture_png(hall(3900, 500), {}, options));
  EXPECT_LE(picture.cols, 1100);
  // The upper wall is one cell thick, one pixel of five: the row that holds it must be dark all along.
  int longest = 0;
  for (int row = 0; row < picture.rows; ++row) {
    int dark = 0;
    for (int column = 0; column < picture.cols; ++column) dark += picture.at<cv::Vec3b>(row, column)[0] < 40 ? 1 : 0;
    longest = std::max(longest, dark);
  }
  EXPECT_GE(longest, 3900 / 5);
}

TEST(MapPicture, draws_each_robots_trajectory_in_its_colour) {
  const auto grid = hall(100, 60);
  const std::vector<SessionTrajectory> trajectories = {straight_trajectory("alpha", 1.0, 4.0),
                                                       straight_trajectory("beta", 2.0, 4.0)};
  const cv::Mat bare = decoded(map_picture_png(grid, {})), picture = decoded(map_picture_png(grid, trajectories));
  EXPECT_EQ(pixels_like(bare, 0, 114, 178), 0u);
  const double pixels_per_m = 16.0 / 0.05;  // about; 100 cells become 1600 pixels
  EXPECT_GT(pixels_like(picture, 0, 114, 178), 0.8 * 4.0 * pixels_per_m);
  EXPECT_GT(pixels_like(picture, 213, 94, 0), 0.8 * 4.0 * pixels_per_m);
}

TEST(MapPicture, puts_a_trajectory_where_the_robot_went) {
  // A trajectory along the lower wall: its colour lies in the lower half of the map, and no lower than the wall.
  const cv::Mat picture = decoded(map_picture_png(hall(100, 100), {straight_trajectory("alpha", 0.5, 4.0)}));
  int lowest_wall = 0, highest_trajectory = picture.rows;
  for (int row = 200; row < picture.rows - 100; ++row) {  // below the legend, above the scale
    for (int column = 0; column < picture.cols; ++column) {
      const auto& pixel = picture.at<cv::Vec3b>(row, column);
      if (pixel == cv::Vec3b(25, 25, 25)) lowest_wall = row;
      if (pixel == cv::Vec3b(178, 114, 0)) highest_trajectory = std::min(highest_trajectory, row);
    }
  }
  const double pixels_per_m = (lowest_wall - highest_trajectory) / 0.5;  // the wall ends at y 0
  EXPECT_NEAR(pixels_per_m, 16.0 / 0.05, 0.1 * 16.0 / 0.05);
}

TEST(MapPicture, does_not_let_outlier_rays_shrink_the_building) {
  auto grid = hall(400, 100);
  auto letters = test::letters_of(grid);
  for (auto& row : letters) row += std::string(400, ' ');
  letters[50].replace(400, 400, 100, '.');  // a ray through a window
  letters[50].resize(800, ' ');
  PictureOptions options;
  options.common_side_px = 800;
  const cv::Mat picture = decoded(map_picture_png(drawn_grid(letters), {}, options));
  EXPECT_GT(pixels_like(picture, 255, 255, 255), 400u * 100u * 3u);  // 800 pixels for 400 cells and not for 800
}

TEST(MapPicture, has_the_same_bytes_whatever_the_order_of_the_robots) {
  const auto grid = hall(100, 60);
  const auto alpha = straight_trajectory("alpha", 1.0, 4.0), beta = straight_trajectory("beta", 2.0, 3.0);
  EXPECT_EQ(map_picture_png(grid, {alpha, beta}), map_picture_png(grid, {beta, alpha}));
  EXPECT_EQ(map_picture_png(grid, {alpha, beta}), map_picture_png(grid, {alpha, beta}));
}

TEST(MapPicture, survives_odd_company) {
  PictureOptions options;
  options.title = std::string("Caf\xc3\xa9 \x1b[31m of ") + std::string(300, 'x');
  std::vector<SessionTrajectory> many;
  for (int i = 0; i < 60; ++i)
    many.push_back(
        straight_trajectory("robot-with-quite-a-long-name-" + std::to_string(100 + i), 0.5 + 0.02 * i, 1e-4 * i));
  EXPECT_FALSE(decoded(map_picture_png(hall(100, 60), many, options)).empty());

  // One that went astray: to the moon, or nowhere at all.
  auto astray = straight_trajectory("alpha", 1.0, 1e9);
  EXPECT_LE(decoded(map_picture_png(hall(100, 60), {astray})).cols, 2500);
  astray.poses.clear();
  EXPECT_FALSE(decoded(map_picture_png(hall(100, 60), {astray})).empty());
  EXPECT_FALSE(decoded(map_picture_png(drawn_grid({"   ", "   "}), {})).empty());
  EXPECT_FALSE(decoded(map_picture_png(drawn_grid({"#"}), {})).empty());
}

}  // namespace
}  // namespace mapweave::exporters
