#include "small_map.h"

#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/exporters/contact_sheet.h>
#include <mapweave/exporters/top_view.h>
#include <opencv2/imgcodecs.hpp>

namespace mapweave::exporters {
namespace {

cv::Mat decoded(const std::string& png) {
  return cv::imdecode(std::vector<std::uint8_t>(png.begin(), png.end()), cv::IMREAD_UNCHANGED);
}

std::size_t count_like(const cv::Mat& picture, const cv::Vec3b& colour) {
  std::size_t count = 0;
  for (auto pixel = picture.begin<cv::Vec3b>(); pixel != picture.end<cv::Vec3b>(); ++pixel) {
    int off = 0;
    for (int i = 0; i < 3; ++i) off += std::abs((*pixel)[i] - colour[i]);
    count += off < 6 ? 1 : 0;
  }
  return count;
}

std::vector<ColouredPoint> wall(float z, std::uint32_t rgb) {
  std::vector<ColouredPoint> points;
  for (int i = 0; i < 100; ++i) points.push_back({{0.05F * static_cast<float>(i), 2.0F, z}, rgb});
  return points;
}

SessionTrajectory straight_trajectory() {
  SessionTrajectory trajectory;
  trajectory.session = test::node_id("alpha", 0).session;
  for (int i = 0; i <= 20; ++i) trajectory.poses.push_back({Stamp{i}, spatial(Pose2(0.2 * i, 0.0, 0.0))});
  return trajectory;
}

TEST(TopView, shows_landmarks_in_their_colours_the_higher_ones_above) {
  auto points = wall(0.6F, 200 << 16);
  for (const auto& point : wall(0.1F, 200 << 8)) points.push_back(point);
  const cv::Mat picture = decoded(top_view_png(points, {straight_trajectory()}));
  EXPECT_GE(count_like(picture, {0, 0, 170}), 500U);
  EXPECT_EQ(count_like(picture, {0, 170, 0}), 0U);
}

TEST(TopView, lays_the_grid_of_lasers_under_the_landmarks) {
  OccupancyGrid grid;
  grid.resolution_m = 0.1;
  grid.origin_x_m = -1.0;
  grid.origin_y_m = -1.0;
  grid.columns = 80;
  grid.rows = 50;
  grid.log_odds.assign(80 * 50, -100);
  for (int column = 0; column < 80; ++column)
    grid.log_odds[static_cast<std::size_t>(30 * 80 + column)] = 100;  // a wall at y = 2
  for (int row = 0; row < 50; ++row) grid.log_odds[static_cast<std::size_t>(row * 80 + 79)] = OccupancyGrid::kUnknown;
  const auto points = wall(0.6F, 200 << 16);
  const cv::Mat with = decoded(top_view_png(points, {straight_trajectory()}, {}, &grid)),
                without = decoded(top_view_png(points, {straight_trajectory()}));
  EXPECT_GT(count_like(with, {90, 90, 90}), 5000U);
  EXPECT_GT(count_like(with, {228, 228, 228}), 5000U);
  EXPECT_GE(count_like(with, {0, 0, 170}), 300U) << "dots lie above the wall";
  EXPECT_LT(count_like(without, {90, 90, 90}), 500U);
  EXPECT_EQ(top_view_png(points, {straight_trajectory()}, {}, nullptr), top_view_png(points, {straight_trajectory()}));
}

TEST(TopView, leaves_ceilings_and_what_is_far_off_out) {
  auto points = wall(0.5F, 200);
  for (const auto& point : wall(2.4F, 200 << 16)) points.push_back(point);
  const cv::Mat near = decoded(top_view_png(points, {straight_trajectory()}));
  EXPECT_EQ(count_like(near, {0, 0, 170}), 0U) << "no ceiling";
  points.push_back({{1e6F, -1e6F, 0.0F}, 9});
  EXPECT_NEAR(decoded(top_view_png(points, {straight_trajectory()})).cols, near.cols, 30);
}

TEST(TopView, needs_something_finite_to_show) {
  EXPECT_THROW(top_view_png({}, {}), ContractViolation);
  EXPECT_THROW(top_view_png({{{0.0F, std::nanf(""), 0.0F}, 0}}, {straight_trajectory()}), ContractViolation);
  EXPECT_FALSE(decoded(top_view_png({}, {straight_trajectory()})).empty()) << "a trajectory alone is shown";
}

TEST(ContactSheet, puts_frames_side_by_side_with_their_tracks) {
  SheetFrame frame{64, 48, std::vector<std::uint8_t>(64 * 48, 90), "12.0 s", {}};
  ContactSheetOptions options;
  options.picture_width_px = 128;
  options.columns = 2;
  const cv::Mat bare = decoded(contact_sheet_png({frame, frame, frame}, options));
  EXPECT_GE(bare.cols, 256);
  EXPECT_GE(bare.rows, 2 * 96);
  EXPECT_GT(count_like(bare, {90, 90, 90}), 3U * 128 * 96 * 9 / 10);
  frame.tracks = {{{{10.0F, 10.0F}, {20.0F, 30.0F}}, 1.0F}, {{{50.0F, 10.0F}}, 4.0F}};
  EXPECT_GT(count_like(decoded(contact_sheet_png({frame}, options)), {0, 94, 213}), 10U) << "near ones are orange";
}

TEST(ContactSheet, shows_the_same_of_frames_that_were_shrunk_before) {
  SheetFrame frame{640, 480, std::vector<std::uint8_t>(640 * 480), "", {{{{40.0F, 40.0F}, {320.0F, 240.0F}}, 1.0F}}};
  for (std::size_t i = 0; i < frame.grey.size(); ++i) frame.grey[i] = static_cast<std::uint8_t>(i / 640 / 2);
  const SheetFrame small = shrunk(frame);
  EXPECT_EQ(small.width, ContactSheetOptions().picture_width_px);
  EXPECT_LT(small.grey.capacity(), frame.grey.size() / 3);
  EXPECT_EQ(contact_sheet_png({small}), contact_sheet_png({frame}));
}

TEST(ContactSheet, refuses_frames_without_their_pixels) {
  EXPECT_THROW(contact_sheet_png({}), ContractViolation);
  EXPECT_THROW(contact_sheet_png({SheetFrame{64, 48, {1, 2, 3}, "", {}}}), ContractViolation);
}

}  // namespace
}  // namespace mapweave::exporters
