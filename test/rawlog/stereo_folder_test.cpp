#include "camera_folders.h"

namespace mapweave::rawlog {
namespace {

using test::TemporaryFolder;
using Stereo = mrpt::obs::CObservationStereoImages;

const Stereo& stereo_of(const Record& record) { return dynamic_cast<const Stereo&>(*record.observation); }

TEST(KittiFolder, gives_pairs_with_their_baseline) {
  const TemporaryFolder folder;
  const auto reading = read_all(make_kitti(folder / "drive"));
  ASSERT_EQ(reading.error, nullptr) << reading.error->what();
  ASSERT_EQ(reading.records.size(), 10u);
  EXPECT_EQ(reading.records[3].stamp.ns, 300'000'000);
  const Stereo& pair = stereo_of(reading.records[3]);
  EXPECT_NEAR(pair.rightCameraPose.x(), 0.5, 1e-12);
  EXPECT_EQ(pair.leftCamera.cx(), 16.0);
  EXPECT_EQ(pair.leftCamera.ncols, 32u);
  EXPECT_TRUE(pair.areImagesRectified());
  load_pictures(pair);
  EXPECT_EQ(cv::norm(pair.imageRight.asCvMat<cv::Mat>(mrpt::img::SHALLOW_COPY), picture(53, CV_8UC1), cv::NORM_INF),
            0.0);
}

TEST(KittiFolder, with_the_left_camera_alone_is_one_camera) {
  const TemporaryFolder folder;
  make_kitti(folder / "drive", 3);
  std::filesystem::remove_all(folder / "drive/image_1");
  EXPECT_EQ(of_class<mrpt::obs::CObservationImage>(read_all(folder / "drive").records).size(), 3u);
}

TEST(KittiFolder, reads_the_colour_pair_where_there_is_no_grey_one) {
  const TemporaryFolder folder;
  make_kitti(folder / "drive", 2);
  std::filesystem::rename(folder / "drive/image_0", folder / "drive/image_2");
  std::filesystem::rename(folder / "drive/image_1", folder / "drive/image_3");
  write_bytes(folder / "drive/calib.txt", "P2: 30 0 16 3 0 30 12 0 0 0 1 0\nP3: 30 0 16 -15 0 30 12 0 0 0 1 0\n");
  const auto reading = read_all(folder / "drive");
  ASSERT_EQ(reading.records.size(), 2u);
  EXPECT_NEAR(stereo_of(reading.records[0]).rightCameraPose.x(), 0.6, 1e-12);
}

TEST(EurocFolder, gives_pairs_on_the_body_with_distortion_and_the_imu_between) {
  const TemporaryFolder folder;
  const auto reading = read_all(make_euroc(folder / "flight"));
  ASSERT_EQ(reading.error, nullptr) << reading.error->what();
  const auto pairs = of_class<Stereo>(reading.records);
  ASSERT_EQ(pairs.size(), 10u);
  ASSERT_EQ(of_class<mrpt::obs::CObservationIMU>(reading.records).size(), 50u);
  EXPECT_EQ(pairs[0].stamp.ns, 1403715273'262143000);  // MRPT counts in 100 ns
  const Stereo& pair = stereo_of(pairs[0]);
  EXPECT_NEAR(pair.cameraPose.x(), 0.1, 1e-9);
  EXPECT_NEAR(pair.cameraPose.y(), -0.1, 1e-9);
  EXPECT_NEAR(pair.rightCameraPose.x(), 0.2, 1e-9);
  EXPECT_NEAR(pair.rightCameraPose.y(), 0.0, 1e-9);
  EXPECT_EQ(pair.rightCamera.k1(), -0.28);
  EXPECT_EQ(pair.rightCamera.p2(), 1.8e-05);
  EXPECT_EQ(pair.leftCamera.distortion, mrpt::img::DistortionModel::plumb_bob);
  const auto& imu = dynamic_cast<const mrpt::obs::CObservationIMU&>(*reading.records[0].observation);
  EXPECT_EQ(imu.get(mrpt::obs::IMU_WY), 0.2);
  EXPECT_EQ(imu.get(mrpt::obs::IMU_X_ACC), 9.8);
}

TEST(EurocFolder, is_read_on_one_level_too) {
  const TemporaryFolder folder;
  const auto whole = read_all(make_euroc(folder / "flight")),
             reduced = read_all(make_reduced_euroc(folder / "reduced"));
  ASSERT_EQ(reduced.error, nullptr) << reduced.error->what();
  const auto expected = of_class<Stereo>(whole.records), pairs = of_class<Stereo>(reduced.records);
  ASSERT_EQ(pairs.size(), expected.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) EXPECT_EQ(pairs[i].stamp.ns, expected[i].stamp.ns);
  EXPECT_EQ(reduced.records.size(), 11u);
}

TEST(EurocFolder, leaves_out_a_picture_without_a_partner) {
  const TemporaryFolder folder;
  make_euroc(folder / "flight", 4);
  replace_text(folder / "flight/mav0/cam1/data.csv", "1403715273362142976,1403715273362142976.png\r\n", "");
  EXPECT_EQ(of_class<Stereo>(read_all(folder / "flight").records).size(), 3u);
}

}  // namespace
}  // namespace mapweave::rawlog
