// Pictures of a fisheye lens, made pixel by pixel from the direction that each sees.
#include "logs.h"

#include <ros/fisheye.h>
#include <opencv2/core.hpp>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::array<double, 4> kLens{-0.02, 0.01, -0.004, 0.001};

mrpt::img::TCamera wide_camera() {
  mrpt::img::TCamera camera;
  camera.ncols = 240;
  camera.nrows = 160;
  camera.setIntrinsicParamsFromValues(70.0, 75.0, 118.0, 83.0);
  return camera;
}

double shade(double x, double y) { return 128.0 + 60.0 * std::sin(4.0 * x) + 50.0 * std::cos(3.0 * y + 1.0); }

// By Newton's method.
double angle_of(double bent, const std::array<double, 4>& k) {
  double angle = bent;
  for (int i = 0; i < 30; ++i) {
    const double s = angle * angle;
    const double value = angle * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
    const double slope = 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])));
    angle -= (value - bent) / slope;
  }
  return angle;
}

mrpt::img::CImage seen_by_fisheye(const mrpt::img::TCamera& camera, int columns, int rows) {
  cv::Mat pixels(rows, columns, CV_8UC1);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      const double x = (column - camera.cx()) / camera.fx(), y = (row - camera.cy()) / camera.fy();
      const double bent = std::hypot(x, y), angle = std::min(1.5, angle_of(bent, kLens));
      const double scale = bent > 0.0 ? std::tan(angle) / bent : 1.0;
      pixels.at<std::uint8_t>(row, column) = static_cast<std::uint8_t>(std::lround(shade(x * scale, y * scale)));
    }
  return {pixels, mrpt::img::DEEP_COPY};
}

TEST(FisheyeLens, rectifies_what_it_sees) {
  const auto camera = wide_camera();
  FisheyeLens lens(camera, kLens);
  for (int picture = 0; picture < 2; ++picture) {
    auto image = seen_by_fisheye(camera, 240, 160);
    lens.rectify(image);
    ASSERT_EQ(image.getWidth(), 240U);
    double worst = 0.0;
    for (int row = 0; row < 160; ++row)
      for (int column = 0; column < 240; ++column)
        worst = std::max(worst, std::abs(*image(static_cast<unsigned>(column), static_cast<unsigned>(row)) -
                                         shade((column - 118.0) / 70.0, (row - 83.0) / 75.0)));
    EXPECT_LT(worst, 8.0) << "the shade changes by up to 3 from pixel to pixel, and more in the fisheye's picture";
  }
}

TEST(FisheyeLens, says_how_much_of_the_view_remains) {
  const auto view = FisheyeLens(wide_camera(), kLens).view_deg();
  EXPECT_NEAR(view[0], (std::atan(118.0 / 70.0) + std::atan(122.0 / 70.0)) * 180.0 / M_PI, 1e-9);
  EXPECT_NEAR(view[1], (std::atan(83.0 / 75.0) + std::atan(77.0 / 75.0)) * 180.0 / M_PI, 1e-9);
}

TEST(FisheyeLens, leaves_pictures_of_another_size) {
  auto image = seen_by_fisheye(wide_camera(), 100, 80);
  const auto before = *image(50, 40);
  FisheyeLens(wide_camera(), kLens).rectify(image);
  EXPECT_EQ(image.getWidth(), 100U);
  EXPECT_EQ(*image(50, 40), before);
}

TEST(FisheyeLens, refuses_numbers_that_fold_the_picture) {
  for (const std::array<double, 4>& k :
       {std::array<double, 4>{-2.0, 0.0, 0.0, 0.0}, std::array<double, 4>{std::nan(""), 0.0, 0.0, 0.0},
        std::array<double, 4>{1e308, 1e308, 0.0, 0.0}}) {
    try {
      const FisheyeLens lens(wide_camera(), k);
      ADD_FAILURE() << k[0];
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    }
  }
}

}  // namespace
}  // namespace mapweave::rawlog::ros
