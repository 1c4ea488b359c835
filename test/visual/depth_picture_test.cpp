#include <support/painted_room.h>

#include <gtest/gtest.h>
#include <mapweave/visual/depth_picture.h>

namespace mapweave::visual {
namespace {

const test::PaintedRoom room;

struct Agreement {
  double known = 0.0, right = 0.0;  // shares of the pixels; of the known ones those within `most_m` of the room's depth
};

Agreement agreement(const Image<float>& depths, const Pose3& pose, double share_of_depth) {
  Agreement result;
  int known = 0, right = 0;
  for (int y = 0; y < depths.height; ++y)
    for (int x = 0; x < depths.width; ++x) {
      if (depths.row(y)[x] == 0.0F) continue;
      ++known;
      const double truth =
          room.look(pose.t, pose.q * room.camera.ray({static_cast<double>(x), static_cast<double>(y)})).first;
      right += std::abs(static_cast<double>(depths.row(y)[x]) - truth) < share_of_depth * truth ? 1 : 0;
    }
  result.known = known / static_cast<double>(depths.pixels.size());
  result.right = known == 0 ? 0.0 : right / static_cast<double>(known);
  return result;
}

CameraRig rig_of(double baseline_m) { return {room.camera, baseline_m, baseline_m == 0.0, {}, {}}; }

TEST(DepthPicture, of_a_depth_camera_is_its_own) {
  const Pose3 pose = test::standing(0.5, 0.2, 0.3);
  const Agreement found = agreement(depth_picture_of(room.frame(Stamp{1}, pose), rig_of(0.0)), pose, 0.003);
  EXPECT_GT(found.known, 0.85);
  EXPECT_GT(found.right, 0.999);
}

TEST(DepthPicture, of_a_depth_camera_leaves_out_what_is_too_far_to_be_exact) {
  DepthPictureOptions options;
  options.most_error_m = 0.04;  // at 0.004 1/m: up to sqrt(10) m
  const auto depths = depth_picture_of(room.frame(Stamp{1}, test::standing(0, 1.5, 0.3)), rig_of(0.0), options);
  EXPECT_GT(*std::max_element(depths.pixels.begin(), depths.pixels.end()), 3.0F);
  EXPECT_LT(*std::max_element(depths.pixels.begin(), depths.pixels.end()), 3.163F);
}

TEST(DepthPicture, taken_later_is_moved_to_where_the_picture_was_taken) {
  const Pose3 pose = test::standing(0.5, 0.2, 0.3), later = test::standing(0.53, 0.21, 0.34);
  Frame frame = room.frame(Stamp{1}, pose);
  frame.depth = room.frame(Stamp{2}, later).depth;
  const double moved = agreement(depth_picture_of(frame, rig_of(0.0), {}, between(later, pose)), pose, 0.01).right;
  const double left_so = agreement(depth_picture_of(frame, rig_of(0.0)), pose, 0.01).right;
  EXPECT_GT(moved, 0.99);
  EXPECT_LT(left_so, 0.8);
}

TEST(DepthPicture, of_a_camera_with_a_learnt_offset_has_it_taken_out) {
  const Pose3 pose = test::standing(0.5, 0.2, 0.3);
  Frame frame = room.frame(Stamp{1}, pose);
  for (std::uint16_t& unit : frame.depth.image.pixels)
    unit = static_cast<std::uint16_t>(std::lround(1000.0 / (1000.0 / unit + 0.02)));
  DepthPictureOptions options;
  EXPECT_LT(agreement(depth_picture_of(frame, rig_of(0.0), options), pose, 0.005).right, 0.01);
  options.calibration.inverse_depth_offset = 0.02;
  EXPECT_GT(agreement(depth_picture_of(frame, rig_of(0.0), options), pose, 0.005).right, 0.99);
}

TEST(DepthPicture, leaves_out_what_lies_between_near_and_far) {
  Frame frame = room.frame(Stamp{1}, test::standing(0, 0, 0.0));
  for (int y = 0; y < 240; ++y)
    for (int x = 100; x < 140; ++x) frame.depth.image.row(y)[x] = x < 102 || x >= 138 ? 1500 : 1000;  // smeared rims
  const auto depths = depth_picture_of(frame, rig_of(0.0));
  for (int y = 0; y < 240; ++y)
    for (const int x : {99, 100, 101, 138, 139, 140}) EXPECT_EQ(depths.row(y)[x], 0.0F) << x << " " << y;
  EXPECT_EQ(depths.row(120)[120], 1.0F);
}

TEST(DepthPicture, of_a_pair_is_found_by_matching_it) {
  const Pose3 pose = test::standing(0.5, 0.2, 0.3);
  DepthPictureOptions options;
  options.most_error_m = 1.0;
  const Agreement found =
      agreement(depth_picture_of(room.pair(Stamp{1}, pose, 0.12), rig_of(0.12), options), pose, 0.05);
  EXPECT_GT(found.known, 0.6);
  EXPECT_GT(found.right, 0.98);
}

TEST(DepthPicture, of_a_pair_knows_nothing_where_the_right_picture_shows_something_else) {
  const Pose3 pose = test::standing(0.5, 0.2, 0.3);
  Frame frame = room.pair(Stamp{1}, pose, 0.12);
  frame.right = room.pair(Stamp{1}, test::standing(-1.0, 0.9, 2.0), 0.12).right;
  EXPECT_LT(agreement(depth_picture_of(frame, rig_of(0.12)), pose, 0.05).known, 0.1);
}

TEST(DepthPicture, is_empty_without_depth) {
  Frame frame;
  frame.grey = GreyImage(320, 240);
  EXPECT_TRUE(depth_picture_of(frame, rig_of(0.0)).empty());
}

TEST(ColourAt, looks_where_the_lens_bent_and_rectifying_turned_it) {
  Frame frame;
  frame.grey = GreyImage(320, 240);
  EXPECT_EQ(colour_at(frame, room.camera, {10.0, 10.0}), (std::array<std::uint8_t, 3>{0, 0, 0}));
  auto pixels = std::make_shared<std::vector<std::uint8_t>>(3 * 320 * 240);
  (*pixels)[3 * (120 * 320 + 186)] = 7;  // blue, 26 pixels to the right of the middle: 0.1 rad
  frame.colour = {{pixels, pixels->data()},
                  320,
                  240,
                  3 * 320,
                  room.camera,
                  {},
                  Eigen::Quaterniond(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()))};
  EXPECT_EQ(colour_at(frame, room.camera, {160.0, 120.0}), (std::array<std::uint8_t, 3>{0, 0, 7}));
}

}  // namespace
}  // namespace mapweave::visual
