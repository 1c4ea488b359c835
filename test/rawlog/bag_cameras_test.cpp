// What pictures and calibrations of a bag become.

#include "bag_pictures.h"

#include <mapweave/rawlog/depth_delay.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationStereoImages.h>
#include <opencv2/imgcodecs.hpp>

#include <limits>

namespace mapweave::rawlog {
namespace {

using mrpt::obs::CObservation3DRangeScan;
using mrpt::obs::CObservationImage;
using mrpt::obs::CObservationStereoImages;
using test::TemporaryFolder;
using ::testing::HasSubstr;

class BagCameras : public ::testing::Test {
 protected:
  Reading read(const std::vector<BagEntry>& entries, const ReadOptions& options = {}) {
    return read_all(write_bag(folder_ / "robot.bag", entries), options);
  }
  TemporaryFolder folder_;
};

template <class Observation>
const Observation& as(const Record& record) {
  return dynamic_cast<const Observation&>(*record.observation);
}

TEST_F(BagCameras, a_picture_waits_for_its_calibration) {
  const auto reading =
      read({grey("/cam/image_raw", 1.0), calibration("/cam/camera_info", 1.01), grey("/cam/image_raw", 1.1)});
  ASSERT_FALSE(reading.error) << reading.error->what();
  ASSERT_EQ(reading.records.size(), 2U);
  const auto& image = as<CObservationImage>(reading.records[0]);
  EXPECT_EQ(image.sensorLabel, "cam");
  EXPECT_DOUBLE_EQ(image.cameraParams.fx(), 400.0);
  EXPECT_DOUBLE_EQ(image.cameraParams.cy(), 1.0);
  EXPECT_DOUBLE_EQ(image.cameraParams.k2(), -0.2);
  EXPECT_EQ(image.cameraParams.distortion, mrpt::img::DistortionModel::plumb_bob);
  EXPECT_EQ(image.image.getWidth(), kWidth);
  EXPECT_EQ(image.image.at<std::uint8_t>(0, 0), 100);
  // Without transforms the camera looks ahead: its z axis is the robot's x axis.
  const auto ahead = image.cameraPose.composePoint(mrpt::math::TPoint3D(0, 0, 1));
  EXPECT_NEAR(ahead.x, 1.0, 1e-9);
}

TEST_F(BagCameras, a_rectified_picture_has_the_projection_and_no_distortion) {
  const auto reading = read({calibration("/cam/camera_info", 1.0), grey("/cam/image_rect", 1.0)});
  const auto& image = as<CObservationImage>(reading.records.at(0));
  EXPECT_DOUBLE_EQ(image.cameraParams.fx(), 390.0);
  EXPECT_DOUBLE_EQ(image.cameraParams.cx(), 2.5);
  EXPECT_EQ(image.cameraParams.distortion, mrpt::img::DistortionModel::none);
}

TEST_F(BagCameras, a_binned_picture_has_a_smaller_calibration) {
  Calibration binned;
  binned.width = 2 * kWidth;
  binned.height = 2 * kHeight;
  binned.binning = 2;
  const auto reading = read({calibration("/cam/camera_info", 1.0, binned), grey("/cam/image_raw", 1.0)});
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_DOUBLE_EQ(as<CObservationImage>(reading.records.at(0)).cameraParams.fx(), 200.0);
  binned.binning = 0;
  EXPECT_THAT(read({calibration("/cam/camera_info", 1.0, binned), grey("/cam/image_raw", 1.0)}).error,
              IsError(ErrorCode::kBadInput, "8 x 4 were expected"));
}

TEST_F(BagCameras, a_rational_lens_becomes_the_nearest_radial_one) {
  Calibration rational;
  rational.model = "rational_polynomial";
  // (1 + a r2 + b r4 + c r6) / (1 + a r2): nearly 1 + b r4.
  rational.distortion = {0.5, 0.01, 0, 0, 0.005, 0.5, 0, 0};
  const auto reading = read({calibration("/cam/camera_info", 1.0, rational), grey("/cam/image_raw", 1.0)});
  ASSERT_FALSE(reading.error) << reading.error->what();
  const auto& camera = as<CObservationImage>(reading.records.at(0)).cameraParams;
  EXPECT_NEAR(camera.k1(), 0.0, 1e-6);
  EXPECT_NEAR(camera.k2(), 0.01, 1e-3);
}

TEST_F(BagCameras, a_model_that_is_not_known_is_an_error_that_says_what_helps) {
  Calibration unknown;
  unknown.model = "ftheta";
  const auto reading = read({calibration("/cam/camera_info", 1.0, unknown), grey("/cam/image_raw", 1.0)});
  EXPECT_THAT(reading.error, IsError(ErrorCode::kUnsupported, "the distortion model 'ftheta'"));
  EXPECT_THAT(reading.error->remedy(), HasSubstr("reading.topics"));
}

TEST_F(BagCameras, a_fisheye_lens_becomes_one_without_distortion) {
  Calibration fisheye;
  fisheye.distortion = {0.1, 0.01, 0.0, 0.0};
  for (const char* model : {"equidistant", "fisheye"}) {
    fisheye.model = model;
    testing::internal::CaptureStderr();
    const auto reading = read({calibration("/cam/camera_info", 1.0, fisheye), grey("/cam/image_raw", 1.0)});
    ASSERT_FALSE(reading.error) << reading.error->what();
    const auto& camera = as<CObservationImage>(reading.records.at(0)).cameraParams;
    EXPECT_EQ(camera.distortion, mrpt::img::DistortionModel::none);
    EXPECT_DOUBLE_EQ(camera.fx(), 400.0);
    EXPECT_EQ(
        testing::internal::GetCapturedStderr().find("fisheye lens: its pictures are rectified") != std::string::npos,
        fisheye.model == "equidistant")
        << "once";
  }
}

TEST_F(BagCameras, a_fisheye_lens_that_makes_no_sense_or_measures_depth_is_refused) {
  Calibration fisheye;
  fisheye.model = "equidistant";
  const auto error_of = [&](const std::vector<double>& distortion) {
    fisheye.distortion = distortion;
    return read({calibration("/cam/camera_info", 1.0, fisheye), grey("/cam/image_raw", 1.0)}).error;
  };
  EXPECT_THAT(error_of({0.1, 0.2}), IsError(ErrorCode::kBadInput, "has 2 numbers; 4 were expected"));
  EXPECT_THAT(error_of({0.1, 0.2, 0.3, 0.4, 0.5}), IsError(ErrorCode::kBadInput, "has 5 numbers; 4 were expected"));
  EXPECT_THAT(error_of({-1e9, 0, 0, 0}), IsError(ErrorCode::kBadInput, "folds back"));
  fisheye.distortion = {0.1, 0.0, 0.0, 0.0};
  const auto depth = read({calibration("/cam/rgb/camera_info", 1.0, fisheye), grey("/cam/rgb/image_raw", 1.0),
                           picture("/cam/depth_registered/image_raw", 1.0, "16UC1", depth_pixels(1000))});
  EXPECT_THAT(depth.error, IsError(ErrorCode::kUnsupported, "measures depth with a fisheye lens"));
}

TEST_F(BagCameras, without_a_calibration_that_is_said) {
  testing::internal::CaptureStderr();
  const auto reading = read({grey("/lonely/image_raw", 1.0)});
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("camera 'lonely' has no calibration: no topic lonely/camera_info is there"));
  ASSERT_EQ(reading.records.size(), 1U);
  EXPECT_DOUBLE_EQ(as<CObservationImage>(reading.records[0]).cameraParams.fx(), 0.0);
}

TEST_F(BagCameras, encodings_are_known_or_named) {
  std::string rgb;
  for (std::uint32_t i = 0; i < kWidth * kHeight; ++i) rgb += "\x01\x02\x03";
  const auto colour = read({picture("/cam/image_raw", 1.0, "rgb8", rgb)});
  ASSERT_FALSE(colour.error) << colour.error->what();
  const auto& image = as<CObservationImage>(colour.records.at(0)).image;
  ASSERT_TRUE(image.isColor());
  EXPECT_EQ(image.at<std::uint8_t>(0, 0, 0), 3);  // blue first
  const auto bayer = read({picture("/cam/image_raw", 1.0, "bayer_rggb8", std::string(kWidth * kHeight, '\x40'))});
  EXPECT_TRUE(as<CObservationImage>(bayer.records.at(0)).image.isColor());
  EXPECT_THAT(read({picture("/cam/image_raw", 1.0, "32SC4", std::string(128, ' '))}).error,
              IsError(ErrorCode::kUnsupported, "the encoding '32SC4'"));
  EXPECT_THAT(read({picture("/cam/image_raw", 1.0, "rgb8", std::string(8, ' '))}).error,
              IsError(ErrorCode::kBadInput, "more were expected"));
}

TEST_F(BagCameras, compressed_pictures_are_read_and_raw_ones_preferred) {
  std::vector<unsigned char> png;
  cv::imencode(".png", cv::Mat(kHeight, kWidth, CV_8UC1, cv::Scalar(77)), png);
  const auto compressed = [&](std::string data) {
    MessageBytes bytes;
    bytes.header(1.0, "optical").text("mono8; png compressed").text(data);
    return BagEntry{"/cam/image_raw/compressed", "sensor_msgs/CompressedImage", 1.0, bytes.bytes()};
  };
  const std::string data(png.begin(), png.end());
  const auto reading = read({compressed(data)});
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_EQ(as<CObservationImage>(reading.records.at(0)).image.at<std::uint8_t>(1, 1), 77);
  EXPECT_EQ(read({compressed(data), grey("/cam/image_raw", 1.0)}).records.size(), 1U);
  EXPECT_THAT(read({compressed(data.substr(0, 30))}).error, IsError(ErrorCode::kCorrupt, "a compressed picture"));
  EXPECT_THAT(read({compressed("no picture")}).error, IsError(ErrorCode::kCorrupt, "no PNG or JPEG"));
}

TEST_F(BagCameras, colour_and_registered_depth_are_one_observation) {
  std::vector<BagEntry> entries;
  for (int i = 0; i < 4; ++i) {
    const double stamp_s = 1.0 + 0.1 * i;
    entries.push_back(calibration("/camera/rgb/camera_info", stamp_s));
    entries.push_back(grey("/camera/rgb/image_raw", stamp_s));
    entries.push_back(picture("/camera/depth_registered/image_raw", stamp_s + 0.005, "16UC1", depth_pixels(1500)));
  }
  const auto reading = read(entries);
  ASSERT_FALSE(reading.error) << reading.error->what();
  ASSERT_EQ(reading.records.size(), 4U);
  const auto& frame = as<CObservation3DRangeScan>(reading.records[0]);
  EXPECT_EQ(frame.sensorLabel, "camera");
  EXPECT_TRUE(frame.hasIntensityImage && frame.hasRangeImage);
  EXPECT_EQ(frame.rangeImage(0, 1), 1501);
  EXPECT_FLOAT_EQ(frame.rangeUnits, 0.001f);
  EXPECT_EQ(depth_delay_ns(frame), 5'000'000);
  EXPECT_DOUBLE_EQ(frame.cameraParamsIntensity.fx(), 400.0);
  EXPECT_NEAR(frame.sensorPose.norm(), 0.0, 1e-9);
}

TEST_F(BagCameras, depth_in_metres_and_what_is_no_reading) {
  MessageBytes pixels;
  pixels.floats({1.25f, std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity(), -1.0f, 0.0f,
                 70.0f, 65.5f, 0.001f});
  const auto reading = read({picture("/camera/depth/image_rect", 1.0, "32FC1", pixels.bytes())});
  ASSERT_FALSE(reading.error) << reading.error->what();
  const auto& frame = as<CObservation3DRangeScan>(reading.records.at(0));
  EXPECT_FALSE(frame.hasIntensityImage);
  std::vector<std::uint16_t> steps(frame.rangeImage.data(), frame.rangeImage.data() + frame.rangeImage.size());
  EXPECT_EQ(steps, (std::vector<std::uint16_t>{1250, 0, 0, 0, 0, 0, 65500, 1}));
}

TEST_F(BagCameras, depth_of_another_frame_is_read_apart) {
  testing::internal::CaptureStderr();
  const auto reading = read({grey("/camera/color/image_raw", 1.0),
                             picture("/camera/depth/image_raw", 1.0, "16UC1", depth_pixels(900), "depth_optical"),
                             grey("/camera/color/image_raw", 1.1)});
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("is not registered"));
  ASSERT_EQ(reading.records.size(), 3U);
  EXPECT_NO_THROW(as<CObservationImage>(reading.records[0]));
  EXPECT_NO_THROW(as<CObservation3DRangeScan>(reading.records[1]));
}

TEST_F(BagCameras, left_and_right_become_a_stereo_pair) {
  Calibration right;
  right.baseline_times_fx = -39.0;
  std::vector<BagEntry> entries;
  for (int i = 0; i < 3; ++i) {
    const double stamp_s = 1.0 + 0.1 * i;
    entries.push_back(calibration("/stereo/left/camera_info", stamp_s));
    entries.push_back(calibration("/stereo/right/camera_info", stamp_s, right));
    entries.push_back(grey("/stereo/right/image_raw", stamp_s, 50));
    if (i != 1) entries.push_back(grey("/stereo/left/image_raw", stamp_s, 60));
  }
  testing::internal::CaptureStderr();
  const auto reading = read(entries);
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("1 pictures without a partner are left out; 2 pairs remain"));
  ASSERT_FALSE(reading.error) << reading.error->what();
  ASSERT_EQ(reading.records.size(), 2U);
  const auto& pair = as<CObservationStereoImages>(reading.records[1]);
  EXPECT_EQ(pair.sensorLabel, "stereo");
  EXPECT_NEAR(pair.rightCameraPose.x(), 0.1, 1e-9);
  EXPECT_NEAR(pair.rightCameraPose.y(), 0.0, 1e-9);
  EXPECT_EQ(pair.imageLeft.at<std::uint8_t>(0, 0), 60);
  EXPECT_EQ(pair.imageRight.at<std::uint8_t>(0, 0), 50);
}

}  // namespace
}  // namespace mapweave::rawlog
