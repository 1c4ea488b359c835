#include <mapweave/core/error.h>
#include <mapweave/rawlog/depth_delay.h>
#include <mapweave/visual/frame_input.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <gmock/gmock.h>

namespace mapweave::visual {
namespace {

using testing::HasSubstr;

mrpt::img::TCamera calibration() {
  mrpt::img::TCamera camera;
  camera.ncols = 80;
  camera.nrows = 64;
  camera.setIntrinsicParamsFromValues(70.0, 71.0, 39.0, 31.0);
  return camera;
}

mrpt::img::CImage picture(int width, int height, int value) {
  mrpt::img::CImage image(width, height, mrpt::img::CH_GRAY);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x) image.at<std::uint8_t>(x, y) = static_cast<std::uint8_t>(value + x);
  return image;
}

rawlog::Record record_of(const mrpt::obs::CObservation::Ptr& observation, const std::string& label = "CAMERA") {
  observation->sensorLabel = label;
  observation->timestamp = rawlog::to_mrpt_time(stamp_from_seconds(5.0));
  return {stamp_from_seconds(5.0), observation};
}

mrpt::obs::CObservation3DRangeScan::Ptr depth_camera() {
  auto scan = mrpt::obs::CObservation3DRangeScan::Create();
  scan->hasIntensityImage = scan->hasRangeImage = scan->range_is_depth = true;
  scan->intensityImage = picture(80, 64, 10);
  scan->rangeImage_setSize(64, 80);
  scan->rangeImage.fill(1500);
  scan->rangeUnits = 0.001F;
  scan->cameraParams = scan->cameraParamsIntensity = calibration();
  scan->sensorPose = mrpt::poses::CPose3D(0.2, 0.0, 0.5, 0.0, 0.0, 0.0);
  return scan;
}

mrpt::obs::CObservationStereoImages::Ptr stereo_pair() {
  auto pair = mrpt::obs::CObservationStereoImages::Create();
  pair->imageLeft = picture(80, 64, 10);
  pair->imageRight = picture(80, 64, 20);
  pair->hasImageRight = true;
  pair->leftCamera = pair->rightCamera = calibration();
  pair->rightCameraPose = mrpt::poses::CPose3DQuat(0.1, 0.0, 0.0, mrpt::math::CQuaternionDouble(1, 0, 0, 0));
  return pair;
}

std::string refusal(const mrpt::obs::CObservation::Ptr& observation, FrameInputOptions options = {}) {
  FramePacker packer(options);
  try {
    packer(record_of(observation));
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    return error.what();
  }
  return "";
}

TEST(FramePacker, takes_picture_and_depth_of_a_depth_camera) {
  FramePacker packer;
  const auto frame = packer(record_of(depth_camera()));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->stamp.seconds(), 5.0);
  EXPECT_EQ(frame->grey.row(3)[7], 17);
  EXPECT_EQ(frame->depth.image.row(3)[7], 1500);
  EXPECT_NEAR(frame->depth.metres_per_unit, 0.001, 1e-9);
  ASSERT_TRUE(packer.rig());
  EXPECT_EQ(packer.rig()->camera.fy, 71.0);
  EXPECT_TRUE(packer.rig()->has_depth);
  // Looking ahead: the camera's z is the robot's x.
  EXPECT_TRUE((packer.rig()->robot_from_camera.q * Eigen::Vector3d::UnitZ()).isApprox(Eigen::Vector3d::UnitX(), 1e-9));
  EXPECT_TRUE(packer.rig()->robot_from_camera.t.isApprox(Eigen::Vector3d(0.2, 0.0, 0.5), 1e-9));
}

TEST(FramePacker, takes_both_pictures_of_a_pair) {
  FramePacker packer;
  const auto frame = packer(record_of(stereo_pair()));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->grey.row(0)[0], 10);
  EXPECT_EQ(frame->right.row(0)[0], 20);
  EXPECT_NEAR(packer.rig()->baseline_m, 0.1, 1e-12);
}

TEST(FramePacker, uses_one_camera_and_counts_the_others) {
  FramePacker packer;
  EXPECT_TRUE(packer(record_of(depth_camera(), "FRONT")));
  EXPECT_FALSE(packer(record_of(depth_camera(), "REAR")));
  EXPECT_TRUE(packer(record_of(depth_camera(), "FRONT")));
  EXPECT_EQ(packer.ignored_cameras().at("REAR"), 1U);
}

TEST(FramePacker, leaves_depth_aside_where_mono_is_asked_for) {
  FrameInputOptions options;
  options.kind = CameraKind::mono;
  FramePacker packer(options);
  const auto frame = packer(record_of(depth_camera()));
  ASSERT_TRUE(frame);
  EXPECT_TRUE(frame->depth.image.empty());
  EXPECT_FALSE(packer.rig()->has_depth);
}

TEST(FramePacker, knows_when_depth_was_taken_and_shares_the_colours) {
  auto scan = depth_camera();
  rawlog::set_depth_delay_ns(*scan, -7000000);
  scan->intensityImage = mrpt::img::CImage(80, 64, mrpt::img::CH_RGB);
  scan->intensityImage.filledRectangle(0, 0, 79, 63, mrpt::img::TColor(200, 100, 50));
  FramePacker packer;
  const auto frame = packer(record_of(scan));
  ASSERT_TRUE(frame);
  EXPECT_NEAR(frame->depth.delay_s, -0.007, 1e-12);
  ASSERT_TRUE(frame->colour.blue_green_red);
  EXPECT_EQ(frame->colour.width, 80);
  const std::uint8_t* pixel = frame->colour.blue_green_red.get() + 5 * frame->colour.row_bytes + 3 * 7;
  EXPECT_EQ(pixel[0], 50);
  EXPECT_EQ(pixel[1], 100);
  EXPECT_EQ(pixel[2], 200);
  EXPECT_FALSE(packer(record_of(depth_camera()))->colour.blue_green_red) << "grey pictures have none";
}

TEST(FramePacker, says_what_is_wrong_with_a_camera) {
  auto scan = depth_camera();
  scan->cameraParamsIntensity.setIntrinsicParamsFromValues(0, 0, 0, 0);
  EXPECT_THAT(refusal(scan), HasSubstr("no calibration"));
  scan = depth_camera();
  scan->intensityImage = picture(90, 64, 0);
  EXPECT_THAT(refusal(scan), HasSubstr("90 x 64"));
  scan = depth_camera();
  scan->rangeImage_setSize(32, 40);
  EXPECT_THAT(refusal(scan), HasSubstr("depth picture"));
  scan = depth_camera();
  scan->cameraParamsIntensity.ncols = 4000000000U;
  EXPECT_THAT(refusal(scan), HasSubstr("calibration is of"));
  scan = depth_camera();
  scan->sensorPose = mrpt::poses::CPose3D(std::nan(""), 0, 0, 0, 0, 0);
  EXPECT_THAT(refusal(scan), HasSubstr("finite"));
  auto pair = stereo_pair();
  pair->rightCameraPose = mrpt::poses::CPose3DQuat(-0.1, 0.0, 0.0, mrpt::math::CQuaternionDouble(1, 0, 0, 0));
  EXPECT_THAT(refusal(pair), HasSubstr("exchange left and right"));
  pair = stereo_pair();
  pair->rightCameraPose = mrpt::poses::CPose3DQuat();
  EXPECT_THAT(refusal(pair), HasSubstr("stands where the left one does"));
  FrameInputOptions depth;
  depth.kind = CameraKind::rgbd;
  EXPECT_THAT(refusal(stereo_pair(), depth), HasSubstr("no depth"));
}

}  // namespace
}  // namespace mapweave::visual
