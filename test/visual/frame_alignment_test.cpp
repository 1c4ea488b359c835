#include "tracking/frame_alignment.h"
#include "pictures/detector.h"

#include <support/painted_room.h>

#include <gtest/gtest.h>

namespace mapweave::visual {
namespace {

const test::PaintedRoom room;

ShownPoints corners_of(const Pyramid& picture, const Pose3& pose) {
  ShownPoints seen;
  for (const Corner& corner : detect_corners(picture, {}, {})) {
    seen.pixels.push_back(corner.pixel);
    seen.points.push_back(room.camera.ray(corner.pixel) *
                          room.look(pose.t, pose.q * room.camera.ray(corner.pixel)).first);
  }
  return seen;
}

void expect_motion(const Pose3& from, const Pose3& to, double gain, double bias) {
  const Pyramid before = make_pyramid(room.frame(Stamp(), from).grey);
  GreyImage grey = room.frame(Stamp(), to).grey;
  for (auto& value : grey.pixels) value = static_cast<std::uint8_t>(std::clamp(gain * value + bias, 0.0, 255.0));
  const ShownPoints seen = corners_of(before, from);
  ASSERT_GT(seen.points.size(), 40U);
  const FrameAlignment aligned = align_frames(before, seen, make_pyramid(grey), room.camera, View(), 1);
  const Pose3 truth = between(from, to), found = pose_of(aligned.to_from_from);
  EXPECT_LT((found.t - truth.t).norm(), 0.01);
  EXPECT_LT(found.q.angularDistance(truth.q), 0.003);
}

TEST(FrameAlignment, finds_a_step_and_a_turn) {
  expect_motion(test::standing(0, 0, 0), test::standing(0.04, 0.05, 0.05, 0.02), 1.0, 0.0);
}
TEST(FrameAlignment, does_not_mind_another_exposure) {
  expect_motion(test::standing(0, 0, 0), test::standing(0.03, 0, 0.04), 0.8, 20.0);
}

TEST(FrameAlignment, keeps_the_guess_where_there_is_nothing_to_see) {
  const Pyramid picture = make_pyramid(room.frame(Stamp(), test::standing(0, 0, 0)).grey);
  View guess;
  guess.translation.x() = 0.25;
  const FrameAlignment aligned = align_frames(picture, {}, picture, room.camera, guess);
  EXPECT_EQ(aligned.points, 0);
  EXPECT_EQ(aligned.to_from_from.translation, guess.translation);
}

}  // namespace
}  // namespace mapweave::visual
