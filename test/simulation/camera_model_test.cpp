#include "looking.h"

#include <mapweave/core/error.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace mapweave::simulation {
namespace {

CameraIntrinsics kinect() {
  return {640, 480, 517.306408, 516.469215, 318.643040, 255.313989, test::kinect_distortion()};
}

TEST(CameraModel, finds_the_pixel_of_a_point_on_every_pixels_ray) {
  for (const CameraIntrinsics& intrinsics : {test::small_camera(), kinect()}) {
    const CameraModel camera(intrinsics);
    for (int v = 0; v < intrinsics.height; v += 7) {
      for (int u = 0; u < intrinsics.width; u += 7) {
        const auto pixel = camera.project({3.0 * camera.x(v)[u], 3.0 * camera.y(v)[u], 3.0});
        ASSERT_TRUE(pixel) << u << ", " << v;
        EXPECT_NEAR(pixel->x(), u, 1e-3);
        EXPECT_NEAR(pixel->y(), v, 1e-3);
      }
    }
  }
}

TEST(CameraModel, projects_as_a_pinhole_without_distortion) {
  const CameraModel camera(test::small_camera());
  const auto pixel = camera.project({0.5, -0.25, 2.0});
  ASSERT_TRUE(pixel);
  EXPECT_DOUBLE_EQ(pixel->x(), 79.5 + 131.2 * 0.25);
  EXPECT_DOUBLE_EQ(pixel->y(), 59.5 - 131.2 * 0.125);
}

TEST(CameraModel, does_not_see_what_is_behind_or_beside) {
  const CameraModel camera(kinect());
  EXPECT_FALSE(camera.project({0.0, 0.0, -1.0}));
  EXPECT_FALSE(camera.project({2.0, 0.0, 1.0}));
  EXPECT_FALSE(camera.project({0.0, 20.0, 1.0})) << "where the distortion folds back into the picture";
}

TEST(CameraModel, refuses_a_distortion_that_folds_the_picture) {
  CameraIntrinsics intrinsics = test::small_camera();
  intrinsics.distortion = {-3.0, 0.0, 0.0, 0.0, 0.0};
  try {
    const CameraModel camera(intrinsics);
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), testing::HasSubstr("distortion"));
  }
}

}  // namespace
}  // namespace mapweave::simulation
