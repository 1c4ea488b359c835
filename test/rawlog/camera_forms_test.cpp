// A folder of pictures, its rawlog and its parts hold the same.
#include "camera_folders.h"

#include <mapweave/rawlog/contents.h>
#include <mapweave/rawlog/convert.h>
#include <mapweave/rawlog/depth_delay.h>
#include <mapweave/rawlog/split.h>

namespace mapweave::rawlog {
namespace {

using test::TemporaryFolder;
using Depth = mrpt::obs::CObservation3DRangeScan;
using Stereo = mrpt::obs::CObservationStereoImages;

// `every`: of how many observations one is compared.
void expect_same_from_rawlog(const std::filesystem::path& recording, const TemporaryFolder& folder,
                             std::size_t every = 1) {
  convert_log(recording, folder / "converted.rawlog", *make_silent_progress());
  const auto direct = open_log(recording), converted = open_log(folder / "converted.rawlog");
  for (std::size_t i = 0;; ++i) {
    const auto a = direct->next(), b = converted->next();
    ASSERT_EQ(a.has_value(), b.has_value()) << i;
    if (!a) break;
    if (i % every == 0) {
      ASSERT_TRUE(seen(*a) == seen(*b)) << i;  // megabytes that nobody wants to read
    }
  }
}

TEST(CameraForms, a_tum_folder_is_the_same_from_a_rawlog) {
  const TemporaryFolder folder;
  expect_same_from_rawlog(make_tum(folder / "walk"), folder);
  EXPECT_EQ(depth_delay_ns(depth_of(of_class<Depth>(read_all(folder / "converted.rawlog").records)[3])), 4'000'000);
}

TEST(CameraForms, a_kitti_folder_is_the_same_from_a_rawlog) {
  const TemporaryFolder folder;
  expect_same_from_rawlog(make_kitti(folder / "drive"), folder);
}

TEST(CameraForms, a_euroc_folder_is_the_same_from_a_rawlog) {
  const TemporaryFolder folder;
  expect_same_from_rawlog(make_euroc(folder / "flight"), folder);
}

TEST(CameraForms, one_camera_is_the_same_from_a_rawlog) {
  const TemporaryFolder folder;
  make_kitti(folder / "drive");
  std::filesystem::remove_all(folder / "drive/image_1");
  expect_same_from_rawlog(folder / "drive", folder);
}

TEST(CameraForms, public_recordings_are_the_same_from_a_rawlog) {
  MAPWEAVE_NEED_DATA(data, "visual");
  for (const char* name : {"hololens_office_part1", "kitti06_first51", "euroc_v101_static"}) {
    const TemporaryFolder folder;
    expect_same_from_rawlog(data / name, folder, 10);
  }
}

TEST(CameraForms, a_negative_depth_delay_survives_a_rawlog) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 3, -0.0115);
  convert_log(folder / "walk", folder / "walk.rawlog", *make_silent_progress());
  EXPECT_EQ(depth_delay_ns(depth_of(of_class<Depth>(read_all(folder / "walk.rawlog").records)[1])), -11'500'000);
}

std::vector<SplitPart> split(const std::filesystem::path& recording, const std::filesystem::path& out,
                             double overlap_s = 0.0) {
  SplitOptions options;
  options.overlap_s = overlap_s;
  return split_log(recording, out, options, *make_silent_progress());
}

// Every frame of the whole stands in one part, and is the same there but for where its pictures lie.
template <class Observation>
void expect_cut(const std::filesystem::path& recording, const std::filesystem::path& out) {
  const auto parts = split(recording, out);
  ASSERT_EQ(parts.size(), 2u);
  EXPECT_EQ(parts[0].path, out / "robot0");
  EXPECT_EQ(parts[0].frames + parts[1].frames, 10u);
  const auto whole = of_class<Observation>(read_all(recording).records);
  std::size_t i = 0;
  std::size_t others = read_all(recording).records.size() - whole.size();
  for (const SplitPart& part : parts) {
    const auto reading = read_all(part.path);
    ASSERT_EQ(reading.error, nullptr) << reading.error->what();
    const auto frames = of_class<Observation>(reading.records);
    EXPECT_EQ(frames.size(), part.frames);
    EXPECT_EQ(frames.front().stamp.ns, part.first.ns);
    EXPECT_EQ(frames.back().stamp.ns, part.last.ns);
    others -= reading.records.size() - frames.size();
    for (const Record& frame : frames) {
      ASSERT_EQ(frame.stamp.ns, whole[i].stamp.ns);
      // Serialized observations differ in the names of files: the pixels stand before them.
      const std::string a = seen(frame), b = seen(whole[i]);
      const auto pixels = [](const std::string& bytes) { return bytes.substr(0, bytes.find("CObservation")); };
      ASSERT_EQ(pixels(a), pixels(b));
      ++i;
    }
  }
  EXPECT_EQ(i, whole.size());
  EXPECT_EQ(others, 0u);  // the inertial measurements
}

TEST(FolderSplit, cuts_a_tum_folder) {
  const TemporaryFolder folder;
  expect_cut<Depth>(make_tum(folder / "walk"), folder / "out");
  EXPECT_TRUE(std::filesystem::exists(folder / "out/robot1/groundtruth.txt"));
  EXPECT_EQ(depth_delay_ns(depth_of(read_all(folder / "out/robot1").records[0])), 4'000'000);
}

TEST(FolderSplit, cuts_a_kitti_folder_and_numbers_it_anew) {
  const TemporaryFolder folder;
  expect_cut<Stereo>(make_kitti(folder / "drive"), folder / "out");
  EXPECT_EQ(bytes_of(folder / "out/robot1/poses.txt").substr(0, 24), "1 0 0 0 0 1 0 0 0 0 1 5\n");
}

TEST(FolderSplit, cuts_both_kinds_of_euroc_folders) {
  const TemporaryFolder folder;
  expect_cut<Stereo>(make_euroc(folder / "flight"), folder / "out");
  expect_cut<Stereo>(make_reduced_euroc(folder / "reduced"), folder / "out2");
}

TEST(FolderSplit, grows_the_parts_by_the_overlap) {
  const TemporaryFolder folder;
  const auto parts = split(make_tum(folder / "walk"), folder / "out", 0.2);
  EXPECT_EQ(parts[0].frames, 7u);
  EXPECT_EQ(parts[1].frames, 7u);
}

TEST(FolderSplit, leaves_nothing_behind_where_a_picture_is_missing) {
  const TemporaryFolder folder;
  make_kitti(folder / "drive");
  std::filesystem::remove(folder / "drive/image_1/000008.png");
  EXPECT_THROW(split(folder / "drive", folder / "out"), Error);
  EXPECT_TRUE(std::filesystem::is_empty(folder / "out"));
}

TEST(CameraContents, hold_size_calibration_and_depth) {
  const TemporaryFolder folder;
  const auto contents = summarize_log(make_tum(folder / "walk"));
  EXPECT_EQ(contents.format, "TUM RGB-D folder");
  ASSERT_EQ(contents.sensors.size(), 2u);
  ASSERT_TRUE(contents.sensors[1].camera.has_value());
  const RecordedCameraGeometry& camera = *contents.sensors[1].camera;
  EXPECT_EQ(camera.width, 32u);
  EXPECT_TRUE(camera.calibrated && camera.distorted);
  EXPECT_EQ(camera.fx, 30.5);
  EXPECT_NEAR(contents.sensors[1].rate_hz, 10.0, 1e-6);
  EXPECT_GT(camera.nearest_m, 1.0);
  EXPECT_GT(camera.farthest_m, camera.nearest_m);
  EXPECT_NEAR(camera.most_depth_delay_s, 0.004, 1e-9);
}

TEST(CameraContents, are_the_same_of_a_folder_and_its_rawlog) {
  const TemporaryFolder folder;
  convert_log(make_kitti(folder / "drive"), folder / "drive.rawlog", *make_silent_progress());
  const auto a = summarize_log(folder / "drive"), b = summarize_log(folder / "drive.rawlog");
  ASSERT_EQ(a.sensors.size(), b.sensors.size());
  EXPECT_EQ(a.sensors[0].camera->width, b.sensors[0].camera->width);
  EXPECT_NEAR(b.sensors[0].camera->baseline_m, 0.5, 1e-12);
}

}  // namespace
}  // namespace mapweave::rawlog
