#include "pictures/patch.h"
#include "pictures/detector.h"

#include <mapweave/core/median.h>
#include <support/painted_room.h>

#include <gmock/gmock.h>
#include <set>

namespace mapweave::visual {
namespace {

const test::PaintedRoom room;

Pyramid picture_from(const Pose3& pose) { return make_pyramid(room.frame(Stamp(), pose).grey); }

TEST(Detector, spreads_corners_over_the_cells_that_are_free) {
  const Pyramid picture = picture_from(test::standing(0, 0, 0));
  const DetectorOptions options;
  const auto all = detect_corners(picture, {}, options);
  ASSERT_GT(all.size(), 40U);
  std::vector<Eigen::Vector2d> occupied;
  for (std::size_t i = 0; i < all.size(); i += 2) occupied.push_back(all[i].pixel);
  const auto rest = detect_corners(picture, occupied, options);
  EXPECT_EQ(rest.size(), all.size() - occupied.size());
  const auto cell = [&](const Eigen::Vector2d& p) {
    return std::make_pair(int(p.x()) / options.cell_px, int(p.y()) / options.cell_px);
  };
  std::set<std::pair<int, int>> cells;
  for (const Corner& corner : all) EXPECT_TRUE(cells.insert(cell(corner.pixel)).second);
}

TEST(Detector, finds_nothing_on_a_blank_wall) {
  GreyImage blank(320, 240);
  std::fill(blank.pixels.begin(), blank.pixels.end(), std::uint8_t{90});
  EXPECT_THAT(detect_corners(make_pyramid(blank), {}, {}), testing::IsEmpty());
}

// Whether all of a patch around the pixel shows the wall ahead.
bool is_of_the_wall_ahead(const Eigen::Vector2d& pixel, int level) {
  for (double dx : {-1.0, 1.0})
    for (double dy : {-1.0, 1.0})
      if (std::abs(room.look({0, 0, 0}, room.camera.ray(pixel + 6.0 * (1 << level) * Eigen::Vector2d(dx, dy))).first -
                   room.half.z()) > 1e-6)
        return false;
  return true;
}

// The camera moves sideways in front of a wall: every point moves by the same known amount.
TEST(Patch, is_found_again_to_a_twentieth_of_a_pixel) {
  const double shift_px = 1.7;
  const Pyramid before = picture_from(test::standing(0, 0, 0));
  const Pyramid after = picture_from(test::standing(-shift_px * room.half.z() / room.camera.fx, 0, 0));
  std::vector<double> errors;
  for (const Corner& corner : detect_corners(before, {}, {})) {
    if (!is_of_the_wall_ahead(corner.pixel, corner.level)) continue;
    const auto patch = cut_patch(before, corner.pixel, corner.level);
    if (!patch) continue;
    const auto match = align_patch(plain_patch(*patch), after[corner.level], corner.pixel, 5.0F);
    if (!match || match->correlation < 0.9F) continue;
    errors.push_back((match->pixel - corner.pixel - Eigen::Vector2d(shift_px, 0)).norm() / (1 << corner.level));
    EXPECT_LT(errors.back(), 0.25);
  }
  ASSERT_GT(errors.size(), 20U);
  EXPECT_LT(median(errors), 0.05);
}

TEST(Patch, is_warped_to_a_nearer_view_in_a_coarser_level) {
  const Pyramid before = picture_from(test::standing(0, 0, 0)),
                after = picture_from(test::standing(0, 0.5 * room.half.z(), 0));  // twice as near
  std::vector<double> errors;
  for (const Corner& corner : detect_corners(before, {}, {})) {
    const Eigen::Vector2d centre(room.camera.cx, room.camera.cy), there = centre + 2.0 * (corner.pixel - centre);
    if (!is_of_the_wall_ahead(corner.pixel, corner.level) || there.x() < 20 || there.y() < 20 || there.x() > 300 ||
        there.y() > 220)
      continue;
    const auto patch = cut_patch(before, corner.pixel, corner.level);
    if (!patch) continue;
    const auto warped = warp_patch(*patch, 2.0 * Eigen::Matrix2d::Identity());
    ASSERT_TRUE(warped);
    EXPECT_EQ(warped->level, corner.level + 1);
    const auto match = align_patch(*warped, after[warped->level], there + Eigen::Vector2d(1.0, -1.0), 4.0F);
    if (!match || match->correlation < 0.85F) continue;
    errors.push_back((match->pixel - there).norm() / (1 << warped->level));
  }
  ASSERT_GT(errors.size(), 8U);
  EXPECT_LT(median(errors), 0.15);
}

TEST(Patch, refuses_warps_that_need_more_than_was_kept) {
  const Pyramid picture = picture_from(test::standing(0, 0, 0));
  const auto patch = cut_patch(picture, {160, 120}, 0);
  ASSERT_TRUE(patch);
  EXPECT_TRUE(warp_patch(*patch, Eigen::Matrix2d::Identity()));
  EXPECT_FALSE(warp_patch(*patch, Eigen::Vector2d(1.0, 0.05).asDiagonal().toDenseMatrix()));
  EXPECT_FALSE(warp_patch(*patch, Eigen::Matrix2d::Zero()));
  EXPECT_FALSE(cut_patch(picture, {3, 3}, 0));
}

TEST(Patch, is_not_found_where_there_is_nothing_of_it) {
  const Pyramid picture = picture_from(test::standing(0, 0, 0));
  GreyImage blank(320, 240);
  const Pyramid nothing = make_pyramid(blank);
  const auto patch = cut_patch(picture, {160, 120}, 0);
  ASSERT_TRUE(patch);
  EXPECT_FALSE(align_patch(plain_patch(*patch), nothing[0], {160, 120}, 5.0F));
  EXPECT_FALSE(align_patch(plain_patch(*patch), picture[0], {1, 1}, 5.0F));
}

TEST(Disparity, is_focal_length_times_baseline_over_depth) {
  const double baseline = 0.1;
  const Frame frame = room.pair(Stamp(), test::standing(0, 0, 0.3), baseline);
  const Pyramid left = make_pyramid(frame.grey), right = make_pyramid(frame.right);
  std::vector<double> errors;
  for (const Corner& corner : detect_corners(left, {}, {})) {
    const auto patch = cut_patch(left, corner.pixel, corner.level);
    if (!patch) continue;
    const auto disparity = find_disparity(*patch, corner.pixel, right, 1.0, 60.0);
    if (!disparity) continue;
    const double depth = room.look({0, 0, 0}, test::standing(0, 0, 0.3).q * room.camera.ray(corner.pixel)).first;
    errors.push_back(std::abs(*disparity - room.camera.fx * baseline / depth) / (1 << corner.level));
    EXPECT_LT(errors.back(), 1.0);
  }
  ASSERT_GT(errors.size(), 20U);
  EXPECT_LT(median(errors), 0.1);
}

TEST(Disparity, is_none_where_the_right_picture_shows_something_else) {
  const Pyramid left = picture_from(test::standing(0, 0, 0)), other = picture_from(test::standing(0, 0, 2.0));
  int found = 0, tried = 0;
  for (const Corner& corner : detect_corners(left, {}, {})) {
    const auto patch = cut_patch(left, corner.pixel, corner.level);
    if (patch && ++tried > 0 && find_disparity(*patch, corner.pixel, other, 1.0, 60.0)) ++found;
  }
  EXPECT_LT(5 * found, tried);
}

}  // namespace
}  // namespace mapweave::visual
