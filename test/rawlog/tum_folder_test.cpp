#include "camera_folders.h"

#include <gmock/gmock.h>
#include <mapweave/rawlog/contents.h>
#include <mapweave/rawlog/depth_delay.h>

namespace mapweave::rawlog {
namespace {

using test::TemporaryFolder;
using Depth = mrpt::obs::CObservation3DRangeScan;

TEST(TumFolder, gives_colour_with_its_depth_at_the_stamp_of_colour) {
  const TemporaryFolder folder;
  const auto reading = read_all(make_tum(folder / "walk"));
  ASSERT_EQ(reading.error, nullptr) << reading.error->what();
  const auto frames = of_class<Depth>(reading.records);
  ASSERT_EQ(frames.size(), 10u);
  EXPECT_EQ(frames[3].stamp.ns, 100'300'000'000);
  const Depth& frame = depth_of(frames[3]);
  EXPECT_EQ(depth_delay_ns(frame), 4'000'000);
  const cv::Mat depth = picture(3, CV_16UC1);
  ASSERT_EQ(frame.rangeImage.rows(), kRows);
  for (int row = 0; row < kRows; ++row)
    for (int column = 0; column < kColumns; ++column)
      ASSERT_EQ(frame.rangeImage(row, column), depth.at<std::uint16_t>(row, column));
  EXPECT_FLOAT_EQ(frame.rangeUnits, 0.0002f);
  EXPECT_TRUE(frame.intensityImage.isExternallyStored());  // loaded by who needs it
  load_pictures(frame);
  const cv::Mat colour = frame.intensityImage.asCvMat<cv::Mat>(mrpt::img::SHALLOW_COPY);
  EXPECT_EQ(cv::norm(colour, picture(3), cv::NORM_INF), 0.0);
  EXPECT_EQ(frame.cameraParamsIntensity.fx(), 30.5);
  EXPECT_EQ(frame.cameraParamsIntensity.k3(), 1.16);
  EXPECT_EQ(frame.cameraParamsIntensity.p1(), -0.005);
  EXPECT_TRUE(frame.doDepthAndIntensityCamerasCoincide());
  EXPECT_NEAR(frame.sensorPose.norm() + std::abs(frame.sensorPose.yaw()) + std::abs(frame.sensorPose.pitch()), 0.0,
              1e-12);
}

TEST(TumFolder, pairs_nearest_first_and_leaves_out_what_has_no_partner) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 4);
  // Colour at 100.0, 100.012; depth at 100.010: the second takes it, and the first has none within 20 ms.
  write_bytes(folder / "walk/rgb.txt",
              "100.0 rgb/100.000000.png\n100.012 rgb/100.100000.png\n100.2 rgb/100.200000.png\n");
  write_bytes(folder / "walk/depth.txt",
              "100.010 depth/100.004000.png\n100.181 depth/100.204000.png\n100.220 depth/100.304000.png\n");
  const auto frames = of_class<Depth>(read_all(folder / "walk").records);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(depth_delay_ns(depth_of(frames[0])), -2'000'000);
  EXPECT_EQ(depth_delay_ns(depth_of(frames[1])), -19'000'000);
}

TEST(TumFolder, takes_the_pairs_of_associations_where_they_are_given) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 4);
  std::filesystem::remove(folder / "walk/rgb.txt");
  std::filesystem::remove(folder / "walk/depth.txt");
  write_bytes(
      folder / "walk/associations.txt",
      "100.1 rgb/100.100000.png 100.1 depth/100.104000.png\n100.2 rgb/100.200000.png 100.5 depth/100.204000.png\n");
  const auto frames = of_class<Depth>(read_all(folder / "walk").records);
  ASSERT_EQ(frames.size(), 1u);  // the other pair lies 300 ms apart
  EXPECT_EQ(frames[0].stamp.ns, 100'100'000'000);
  EXPECT_EQ(depth_delay_ns(depth_of(frames[0])), 0);
}

TEST(TumFolder, without_depth_is_one_camera) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 3);
  std::filesystem::remove_all(folder / "walk/depth");
  std::filesystem::remove(folder / "walk/depth.txt");
  replace_text(folder / "walk/camera.yaml", "depth_scale: 5000.0\n", "");
  const auto frames = of_class<mrpt::obs::CObservationImage>(read_all(folder / "walk").records);
  ASSERT_EQ(frames.size(), 3u);
  const auto& frame = dynamic_cast<const mrpt::obs::CObservationImage&>(*frames[0].observation);
  EXPECT_EQ(frame.cameraParams.cx(), 15.5);
  const auto ahead = frame.cameraPose.composePoint(mrpt::math::TPoint3D(0, 0, 1));
  EXPECT_NEAR(ahead.x, 1.0, 1e-12);
}

TEST(TumFolder, sorts_the_accelerometer_in) {
  const TemporaryFolder folder;
  const auto reading = read_all(make_tum(folder / "walk"));
  const auto imu = of_class<mrpt::obs::CObservationIMU>(reading.records);
  ASSERT_EQ(imu.size(), 2u);
  EXPECT_EQ(reading.records[1].stamp.ns, 100'050'000'000);
  EXPECT_EQ(dynamic_cast<const mrpt::obs::CObservationIMU&>(*imu[1].observation).get(mrpt::obs::IMU_Y_ACC), 9.8);
}

TEST(TumFolder, stands_on_the_robot_as_its_calibration_says) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 1);
  std::ofstream(folder / "walk/camera.yaml", std::ios::app)
      << "robot_from_camera: [0.1, 0, 0.5, -0.5, 0.5, -0.5, 0.5]\n";
  const auto frames = of_class<Depth>(read_all(folder / "walk").records);
  ASSERT_EQ(frames.size(), 1u);
  const auto& pose = depth_of(frames[0]).sensorPose;
  EXPECT_NEAR(pose.x(), 0.1, 1e-12);
  EXPECT_NEAR(pose.z(), 0.5, 1e-12);
  EXPECT_NEAR(std::abs(pose.yaw()) + std::abs(pose.pitch()) + std::abs(pose.roll()), 0.0, 1e-9);
}

// As downloaded, the data set has no calibration.
TEST(TumFolder, of_freiburg_as_downloaded_has_the_data_sets_own_camera) {
  const TemporaryFolder folder;
  const auto walk = make_tum(folder / "rgbd_dataset_freiburg2_desk", 2);
  std::filesystem::remove(walk / "camera.yaml");
  for (const auto& entry : std::filesystem::directory_iterator(walk / "rgb"))
    write_picture(entry.path(), picture(1, CV_8UC3, 640, 480));
  for (const auto& entry : std::filesystem::directory_iterator(walk / "depth"))
    write_picture(entry.path(), picture(1, CV_16UC1, 640, 480));
  const auto reading = read_all(walk);
  ASSERT_EQ(reading.error, nullptr) << reading.error->what();
  const auto frames = of_class<Depth>(reading.records);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(depth_of(frames[0]).cameraParamsIntensity.fx(), 520.908620);
  EXPECT_EQ(depth_of(frames[0]).cameraParamsIntensity.k3(), 0.917205);
  EXPECT_FLOAT_EQ(depth_of(frames[0]).rangeUnits, 0.0002f);
  std::filesystem::rename(walk, folder / "desk");
  EXPECT_EQ(read_all(folder / "desk").error->code(), ErrorCode::kMissing);
}

TEST(TumFolder, without_distortion_has_none) {
  const TemporaryFolder folder;
  const auto walk = make_tum(folder / "walk", 2);
  replace_text(walk / "camera.yaml", "distortion: [0.26, -0.95, -0.005, 0.0026, 1.16]\n", "");
  const auto frames = of_class<Depth>(read_all(walk).records);
  ASSERT_EQ(frames.size(), 2u);
  EXPECT_EQ(depth_of(frames[0]).cameraParamsIntensity.distortion, mrpt::img::DistortionModel::none);
}

TEST(TumFolder, in_a_folder_is_named) {
  const TemporaryFolder folder;
  make_tum(folder / "unpacked/walk", 2);
  EXPECT_THAT(std::string(read_all(folder / "unpacked").error->what()), testing::HasSubstr("did you mean"));
}

TEST(TruthFollowsCamera, in_folders_of_tum_and_kitti) {
  const TemporaryFolder folder;
  EXPECT_TRUE(truth_follows_camera(make_tum(folder / "tum", 2)));
  EXPECT_TRUE(truth_follows_camera(make_kitti(folder / "kitti", 2)));
  EXPECT_FALSE(truth_follows_camera(make_euroc(folder / "euroc", 2)));
  EXPECT_FALSE(truth_follows_camera(folder.path()));
}

}  // namespace
}  // namespace mapweave::rawlog
