#include "camera_world.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/simulation/observations.h>
#include <mapweave/simulation/simulate.h>

#include <support/temporary_folder.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <sstream>

namespace mapweave::simulation {
namespace {

namespace fs = std::filesystem;

// An RGB-D camera, a stereo pair and a camera in colour, 2 frames/s each, on a drive of some seconds.
WorldOptions three_cameras() {
  WorldOptions options = test::camera_world(test::tiny_camera(SimulatedCameraKind::rgbd));
  options.cameras[0].id = "depth";
  options.cameras.push_back(test::tiny_camera(SimulatedCameraKind::stereo));
  options.cameras[1].id = "pair";
  options.cameras.push_back(test::tiny_camera(SimulatedCameraKind::mono));
  options.cameras[2].id = "eye";
  options.cameras[2].colour = true;
  for (CameraOptions& camera : options.cameras) camera.frames_per_second = 2.0;
  options.imu.readings_per_second = 20.0;
  options.logs.layout = LogLayout::both;
  return options;
}

std::vector<SimulatedLog> simulated(const WorldOptions& options, const fs::path& folder, int threads = 1) {
  WorkerPool pool(threads);
  const auto progress = make_silent_progress();
  return simulate(options, folder, pool, *progress);
}

std::map<std::string, std::string> all_files(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    // A rawlog says where its pictures lie only by their names, so that all is the same wherever it lies.
    if (entry.is_regular_file()) files[fs::relative(entry.path(), folder).string()] = read_file(entry.path());
  }
  return files;
}

std::size_t lines_of(const std::string& text) {
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

TEST(SimulateCameras, writes_the_same_files_whatever_the_threads) {
  const test::TemporaryFolder one, two;
  simulated(three_cameras(), one.path(), 1);
  simulated(three_cameras(), two.path(), 2);
  const auto files = all_files(one.path());
  EXPECT_GT(files.size(), 40u);
  EXPECT_TRUE(files == all_files(two.path()));
}

TEST(SimulateCameras, writes_a_log_whose_pictures_and_depths_read_back_as_they_were_taken) {
  for (const PictureFormat format : {PictureFormat::embedded, PictureFormat::png}) {
    const test::TemporaryFolder folder;
    WorldOptions options = three_cameras();
    options.logs.layout = LogLayout::rawlog;
    options.logs.pictures = format;
    const auto logs = simulated(options, folder.path());
    const World world = test::built(options);
    CameraRecording::Workspace workspace;
    const auto stream = rawlog::open_log(folder / "alpha.rawlog");
    std::map<std::string, std::size_t> counts;
    Stamp last{};
    while (const auto record = stream->next()) {
      EXPECT_LE(last, record->stamp);
      last = record->stamp;
      const std::size_t number = counts[record->observation->sensorLabel]++;
      rawlog::load_pictures(*record->observation);
      const auto expect_grey = [](const mrpt::img::CImage& image, const Picture& picture) {
        ASSERT_EQ(image.getWidth(), 160u);
        ASSERT_EQ(image.getHeight(), 120u);
        for (unsigned row = 0; row < 120; ++row) {
          for (unsigned column = 0; column < 160; ++column)
            ASSERT_EQ(*image.ptr<std::uint8_t>(column, row), picture.values[row * 160 + column]);
        }
      };
      if (const auto depth = std::dynamic_pointer_cast<mrpt::obs::CObservation3DRangeScan>(record->observation)) {
        const CameraFrame frame = CameraRecording(world, 0, 0).frame(number, workspace);
        EXPECT_EQ(record->stamp, frame.stamp);
        expect_grey(depth->intensityImage, frame.left);
        EXPECT_NEAR(depth->rangeUnits, 0.0002, 1e-9);
        for (int row = 0; row < 120; row += 10) {
          for (int column = 0; column < 160; ++column)
            ASSERT_EQ(depth->rangeImage(row, column), frame.depth[static_cast<std::size_t>(row * 160 + column)]);
        }
        EXPECT_NEAR(depth->sensorPose.x(), 0.15, 1e-9);
        EXPECT_NEAR(depth->sensorPose.yaw(), 0.0, 1e-9);
        EXPECT_EQ(depth->cameraParams.fx(), 131.0);
      } else if (const auto stereo =
                     std::dynamic_pointer_cast<mrpt::obs::CObservationStereoImages>(record->observation)) {
        const CameraFrame frame = CameraRecording(world, 0, 1).frame(number, workspace);
        expect_grey(stereo->imageLeft, frame.left);
        expect_grey(stereo->imageRight, frame.right);
        EXPECT_TRUE(stereo->areImagesRectified());
        EXPECT_NEAR(stereo->rightCameraPose.x(), 0.12, 1e-9);
      } else if (const auto image = std::dynamic_pointer_cast<mrpt::obs::CObservationImage>(record->observation)) {
        const CameraFrame frame = CameraRecording(world, 0, 2).frame(number, workspace);
        ASSERT_TRUE(image->image.isColor());
        const std::uint8_t* pixel = image->image.ptr<std::uint8_t>(50, 60);  // blue first
        const std::uint8_t* truth = &frame.left.values[3 * (60 * 160 + 50)];
        const int tolerance = format == PictureFormat::png ? 0 : 25;  // embedded colour is JPEG
        for (int channel = 0; channel < 3; ++channel) EXPECT_NEAR(pixel[channel], truth[2 - channel], tolerance);
      }
    }
    EXPECT_EQ(counts["depth"] + counts["pair"] + counts["eye"], logs[0].frames);
    EXPECT_EQ(counts["depth"], CameraRecording(world, 0, 0).frame_count());
    EXPECT_EQ(counts["IMU"], ImuRecording(world, 0).count());
    EXPECT_EQ(counts["LASER"], logs[0].scans);
    EXPECT_EQ(lines_of(read_file(folder / "alpha.depth.truth.tum")), counts["depth"]);
  }
}

TEST(SimulateCameras, writes_folders_in_the_layouts_of_the_public_sequences) {
  const test::TemporaryFolder folder;
  WorldOptions options = three_cameras();
  options.logs.layout = LogLayout::folders;
  options.cameras[0].depth.offset_ms = 20.0;
  options.cameras[0].k1 = 0.1;
  const auto logs = simulated(options, folder.path());
  const std::size_t frames = logs[0].frames / 3;
  const fs::path depth = folder / "alpha_depth", pair = folder / "alpha_pair", eye = folder / "alpha_eye";
  EXPECT_EQ(lines_of(read_file(depth / "associations.txt")), frames);
  EXPECT_EQ(lines_of(read_file(depth / "groundtruth.txt")), frames + 1);
  EXPECT_THAT(read_file(depth / "groundtruth.txt"), testing::EndsWith(read_file(folder / "alpha.depth.truth.tum")));
  std::istringstream pairs(read_file(depth / "associations.txt"));
  std::string colour_stamp, colour, depth_stamp, depths;
  std::size_t apart = 0;
  while (pairs >> colour_stamp >> colour >> depth_stamp >> depths) {
    EXPECT_TRUE(fs::is_regular_file(depth / colour)) << colour;
    EXPECT_TRUE(fs::is_regular_file(depth / depths)) << depths;
    EXPECT_NEAR(std::stod(colour_stamp), std::stod(depth_stamp), 0.0201);
    apart += colour_stamp != depth_stamp;
  }
  EXPECT_GT(apart, frames / 2);
  EXPECT_THAT(read_file(depth / "camera.yaml"), testing::HasSubstr("width: 160\nheight: 120\nfx: 131\n"));
  EXPECT_THAT(read_file(depth / "camera.yaml"),
              testing::HasSubstr("distortion: [0.1, 0, 0, 0, 0]\ndepth_scale: 5000.0\n"));
  EXPECT_EQ(lines_of(read_file(pair / "poses.txt")), frames);
  EXPECT_EQ(lines_of(read_file(pair / "times.txt")), frames);
  EXPECT_THAT(read_file(pair / "calib.txt"),
              testing::HasSubstr("P1: 1.310000000000e+02 0.000000000000e+00 7.950000000000e+01 -1.572"));
  EXPECT_TRUE(fs::is_regular_file(pair / "image_1" / "000000.png"));
  EXPECT_EQ(lines_of(read_file(eye / "rgb.txt")), frames + 1);
  EXPECT_FALSE(fs::exists(eye / "depth"));
  const auto stream = rawlog::open_log(folder / "alpha.rawlog");
  while (const auto record = stream->next())
    EXPECT_THAT(record->observation->sensorLabel, testing::AnyOf("ODOM", "LASER", "IMU"));
}

TEST(SimulateCameras, says_that_a_folder_cannot_hold_a_distorted_pair) {
  const test::TemporaryFolder folder;
  WorldOptions options = three_cameras();
  options.cameras[1].k1 = 0.1;
  try {
    simulated(options, folder.path());
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), testing::HasSubstr("logs.layout"));
  }
}

TEST(SimulateCameras, leaves_scans_out_where_none_are_wanted) {
  const test::TemporaryFolder folder;
  WorldOptions options = three_cameras();
  options.cameras.clear();
  options.logs.scans = false;
  simulated(options, folder.path());
  const auto stream = rawlog::open_log(folder / "alpha.rawlog");
  while (const auto record = stream->next()) EXPECT_NE(record->observation->sensorLabel, "LASER");
}

}  // namespace
}  // namespace mapweave::simulation
