#include "input/rectifier.h"

#include <support/painted_room.h>

#include <gtest/gtest.h>

namespace mapweave::visual {
namespace {

const test::PaintedRoom room;

// As a lens with distortion sees the room.
GreyImage raw_picture(const LensCalibration& lens, const Pose3& pose) {
  GreyImage result(lens.camera.width, lens.camera.height);
  for (int y = 0; y < result.height; ++y)
    for (int x = 0; x < result.width; ++x) {
      const Eigen::Vector2d seen((x - lens.camera.cx) / lens.camera.fx, (y - lens.camera.cy) / lens.camera.fy);
      Eigen::Vector2d ideal = seen;
      for (int i = 0; i < 30; ++i) ideal += seen - lens.distortion.distorted(ideal);
      result.row(y)[x] = static_cast<std::uint8_t>(std::lround(
          255.0 * std::clamp(room.look(pose.t, pose.q * Eigen::Vector3d(ideal.x(), ideal.y(), 1.0)).second, 0.0, 1.0)));
    }
  return result;
}

double mean_difference(const GreyImage& a, const GreyImage& b, int border) {
  double sum = 0, count = 0;
  for (int y = border; y < a.height - border; ++y)
    for (int x = border; x < a.width - border; ++x) {
      sum += std::abs(a.row(y)[x] - b.row(y)[x]);
      count += 1;
    }
  return sum / count;
}

TEST(Rectifier, leaves_a_pinhole_camera_as_it_is) {
  const LensCalibration lens{room.camera, {}};
  const GreyImage raw = raw_picture(lens, test::standing(0, 0, 0.2));
  EXPECT_EQ(Rectifier(lens).left(raw).pixels, raw.pixels);
}

TEST(Rectifier, takes_the_distortion_out) {
  const LensCalibration bent{room.camera, {-0.2, 0.05, 0.001, -0.002, 0.01}};
  const GreyImage straight = raw_picture({room.camera, {}}, test::standing(0, 0, 0.2)),
                  raw = raw_picture(bent, test::standing(0, 0, 0.2));
  const Rectifier rectifier(bent);
  EXPECT_LT(mean_difference(rectifier.left(raw), straight, 30), 1.5);
  EXPECT_GT(mean_difference(raw, straight, 30), 4.0);
}

TEST(Rectifier, makes_the_rows_of_a_crooked_pair_meet) {
  const LensCalibration left{room.camera, {-0.15, 0.03, 0, 0, 0}};
  LensCalibration right = left;
  right.camera.fx = 255.0;
  right.camera.cx = 163.0;
  right.distortion.k1 = -0.12;
  const Pose3 left_from_right{
      {0.11, 0.012, -0.004}, Eigen::Quaterniond(Eigen::AngleAxisd(0.04, Eigen::Vector3d(0.3, -0.5, 0.8).normalized()))};
  const Rectifier rectifier(left, right, left_from_right);
  EXPECT_NEAR(rectifier.baseline_m(), left_from_right.t.norm(), 1e-12);
  const Pose3 pose = test::standing(0, 0, 0.2);
  const GreyImage l = rectifier.left(raw_picture(left, pose)),
                  r = rectifier.right(raw_picture(right, compose(pose, left_from_right)));
  // Both must be what pinhole cameras see that stand side by side.
  const Pose3 rectified = compose(pose, rectifier.left_from_rectified());
  const LensCalibration pinhole{rectifier.camera(), {}};
  EXPECT_LT(mean_difference(l, raw_picture(pinhole, rectified), 40), 2.0);
  EXPECT_LT(mean_difference(r,
                            raw_picture(pinhole, compose(rectified, Pose3{{rectifier.baseline_m(), 0, 0},
                                                                          Eigen::Quaterniond::Identity()})),
                            40),
            2.0);
}

}  // namespace
}  // namespace mapweave::visual
