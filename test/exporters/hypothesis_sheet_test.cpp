#include "small_map.h"

#include <gtest/gtest.h>
#include <mapweave/exporters/hypothesis_sheet.h>
#include <opencv2/imgcodecs.hpp>

namespace mapweave::exporters {
namespace {

// Pixels of walls that were seen through, below the legend.
std::size_t red_pixels(const std::string& png) {
  const cv::Mat picture = cv::imdecode(std::vector<std::uint8_t>(png.begin(), png.end()), cv::IMREAD_COLOR);
  std::size_t count = 0;
  for (int row = 64; row < picture.rows; ++row)
    for (int column = 0; column < picture.cols; ++column)
      count += picture.at<cv::Vec3b>(row, column) == cv::Vec3b(40, 40, 214);
  return count;
}

// A room with a wall in it, which another map of the room does not have.
struct TwoRooms {
  OccupancyGrid with_wall, without;
  TwoRooms() {
    std::vector<std::string> letters(60, "#" + std::string(58, '.') + "#");
    letters.front() = letters.back() = std::string(60, '#');
    without = test::drawn_grid(letters);
    for (int row = 20; row < 40; ++row) letters[static_cast<std::size_t>(row)][30] = '#';
    with_wall = test::drawn_grid(letters);
  }
  std::string sheet(const std::vector<HypothesisPanel::Ring>& rings, double scale = 1.0) const {
    HypothesisPanel panel;
    panel.rings = rings;
    panel.scale = scale;
    return hypothesis_sheet_png(with_wall, without, {panel}, "two rooms", "a", "b");
  }
};

TEST(HypothesisSheet, paints_red_what_was_counted_as_seen_through_and_nothing_else) {
  const TwoRooms rooms;
  EXPECT_EQ(red_pixels(rooms.sheet({})), 0U);
  const double x = rooms.with_wall.origin_x_m + 30.5 * rooms.with_wall.resolution_m,
               y = rooms.with_wall.origin_y_m + 30.0 * rooms.with_wall.resolution_m;
  const std::size_t all = red_pixels(rooms.sheet({{x, y, 20.0 * rooms.with_wall.resolution_m}}));
  const std::size_t elsewhere = red_pixels(rooms.sheet({{x + 1000.0, y, 0.5}}));
  EXPECT_GT(all, 1500U);
  EXPECT_EQ(elsewhere, 0U);
}

TEST(HypothesisSheet, wraps_a_caption_that_is_wider_than_its_panel) {
  const TwoRooms rooms;
  HypothesisPanel panel;
  const auto sheet_of = [&] {
    const std::string png = hypothesis_sheet_png(rooms.with_wall, rooms.without, {panel, panel}, "two rooms", "a", "b");
    return cv::imdecode(std::vector<std::uint8_t>(png.begin(), png.end()), cv::IMREAD_GRAYSCALE);
  };
  panel.caption = {"short"};
  const cv::Mat low = sheet_of();
  panel.caption = {
      "140.3 m of wall coincide, 35.5 m of them fit nowhere around; 6 places agree, and more is said than a panel has "
      "place for"};
  const cv::Mat high = sheet_of();
  EXPECT_EQ(high.cols, low.cols);
  EXPECT_GT(high.rows, low.rows);
  const int panel_px = (high.cols - 16) / 2;  // with the gap beside it
  const cv::Mat below = high.rowRange(64 + 720, high.rows);
  EXPECT_EQ(cv::countNonZero(below.colRange(panel_px + 2, panel_px + 14) < 255), 0);
  EXPECT_GT(cv::countNonZero(below < 255), 0);
}

TEST(HypothesisSheet, draws_a_map_of_another_scale) {
  const TwoRooms rooms;
  EXPECT_NE(rooms.sheet({}, 1.0), rooms.sheet({}, 1.1));
}

}  // namespace
}  // namespace mapweave::exporters
