// What is wrong with folders of pictures, and what is said about it.
#include "camera_folders.h"

namespace mapweave::rawlog {
namespace {

using test::TemporaryFolder;
using ::testing::HasSubstr;

std::unique_ptr<Error> problem_of(const std::filesystem::path& folder) { return read_all(folder).error; }

// All frames before the bad one are given; then comes the error.
void expect_ends_at(const std::filesystem::path& folder, std::size_t records, ErrorCode code, const std::string& text) {
  const auto reading = read_all(folder);
  EXPECT_THAT(reading.error, IsError(code, text));
  EXPECT_EQ(reading.records.size(), records);
}

TEST(CameraDamage, a_missing_picture_ends_the_recording_there) {
  const TemporaryFolder folder;
  make_kitti(folder / "drive");
  std::filesystem::remove(folder / "drive/image_0/000004.png");
  expect_ends_at(folder / "drive", 4, ErrorCode::kMissing, "image_0/000004.png: the picture is missing");
}

TEST(CameraDamage, a_missing_right_picture_ends_the_recording_there) {
  const TemporaryFolder folder;
  make_kitti(folder / "drive");
  std::filesystem::remove(folder / "drive/image_1/000007.png");
  expect_ends_at(folder / "drive", 7, ErrorCode::kMissing, "image_1/000007.png: the picture is missing");
}

TEST(CameraDamage, a_picture_cut_short_is_named) {
  for (const char* ending : {".png", ".jpg"}) {
    const TemporaryFolder folder;
    make_kitti(folder / "drive", 3);
    for (const char* name : {"000000", "000001", "000002"}) {
      std::filesystem::remove(folder / "drive/image_0" / (std::string(name) + ".png"));
      write_picture(folder / "drive/image_0" / (std::string(name) + ending), picture(1, CV_8UC1));
    }
    const auto file = folder / ("drive/image_0/000001" + std::string(ending));
    const std::string bytes = bytes_of(file);
    for (const std::size_t kept :
         {bytes.size() - 3, bytes.size() / 2, std::size_t{20}, std::size_t{3}, std::size_t{0}}) {
      write_bytes(file, bytes.substr(0, kept));
      expect_ends_at(folder / "drive", 1, ErrorCode::kCorrupt, "000001" + std::string(ending));
    }
  }
}

TEST(CameraDamage, words_of_the_jpeg_library_come_with_the_name_of_the_picture) {
  const TemporaryFolder folder;
  const auto file = folder / "grey.jpg";
  cv::Mat noise(96, 96, CV_8UC1);
  cv::randu(noise, 0, 255);
  write_picture(file, noise);
  std::string bytes = bytes_of(file);
  bytes.erase(bytes.size() / 2, bytes.size() / 4);  // its end mark stands
  write_bytes(file, bytes);
  mrpt::obs::CObservationImage observation;
  observation.image.setExternalStorage(file.string());
  testing::internal::CaptureStderr();
  load_pictures(observation);
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_THAT(said, HasSubstr(file.string() + ": the picture is damaged (Corrupt JPEG data"));
  EXPECT_EQ(std::count(said.begin(), said.end(), '\n'), 1) << said;
}

TEST(CameraDamage, a_picture_of_another_size_is_named_with_both_sizes) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 3);
  write_picture(folder / "walk/rgb/100.100000.png", picture(1, CV_8UC3, 16, 12));
  const auto error = problem_of(folder / "walk");
  EXPECT_THAT(error,
              IsError(ErrorCode::kBadInput, "100.100000.png: the picture has 16 x 12 pixels; 32 x 24 were expected"));
  EXPECT_THAT(error, IsError(ErrorCode::kBadInput, "camera.yaml"));
}

TEST(CameraDamage, a_missing_calibration_is_asked_for_with_its_keys) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 2);
  std::filesystem::remove(folder / "walk/camera.yaml");
  EXPECT_THAT(problem_of(folder / "walk"),
              IsError(ErrorCode::kMissing, "camera.yaml: there is no calibration; write it, with the keys width"));
  make_kitti(folder / "drive", 2);
  std::filesystem::remove(folder / "drive/calib.txt");
  EXPECT_THAT(problem_of(folder / "drive"), IsError(ErrorCode::kMissing, "calib.txt: there is no calibration"));
  make_euroc(folder / "flight", 2);
  std::filesystem::remove(folder / "flight/mav0/cam1/sensor.yaml");
  EXPECT_THAT(problem_of(folder / "flight"), IsError(ErrorCode::kMissing, "cam1/sensor.yaml: there is no calibration"));
}

TEST(CameraDamage, a_calibration_that_cannot_be_is_refused) {
  const auto problem = [](const std::string& from, const std::string& to) {
    const TemporaryFolder folder;
    make_tum(folder / "walk", 2);
    replace_text(folder / "walk/camera.yaml", from, to);
    return problem_of(folder / "walk");
  };
  EXPECT_THAT(problem("depth_scale: 5000.0\n", ""), IsError(ErrorCode::kBadInput, "'depth_scale' is missing"));
  EXPECT_THAT(problem("depth_scale: 5000.0", "depth_scale: 0"),
              IsError(ErrorCode::kBadInput, "'depth_scale' must be above 0"));
  EXPECT_THAT(problem("depth_scale: 5000.0", "depth_scale: 5"), IsError(ErrorCode::kBadInput, "median depth"));
  EXPECT_THAT(problem("fx: 30.5", "fx: nan"), IsError(ErrorCode::kBadInput, "camera.yaml:3: 'fx' is no number"));
  EXPECT_THAT(problem("fx: 30.5", "fx: -3"), IsError(ErrorCode::kBadInput, "focal lengths"));
  EXPECT_THAT(problem("width: 32", "width: 3e9"), IsError(ErrorCode::kBadInput, "size"));
  EXPECT_THAT(problem("distortion:", "distorsion:"),
              IsError(ErrorCode::kBadInput, "'distorsion' is there, but no 'distortion'"));
  EXPECT_THAT(problem("depth_scale:", "depht_scale:"),
              IsError(ErrorCode::kBadInput, "'depht_scale' is unknown; did you mean 'depth_scale'?"));
  EXPECT_THAT(problem("distortion: [0.26,", "distortion: [[1],"),
              IsError(ErrorCode::kBadInput, "'distortion' does not fit"));
  EXPECT_THAT(problem("cx: 15.5", "cx: ["), IsError(ErrorCode::kBadInput, "is no YAML"));
}

TEST(CameraDamage, a_folder_of_no_known_layout_is_refused_with_those_that_are_known) {
  const TemporaryFolder folder;
  write_bytes(folder / "notes.txt", "nothing");
  const auto error = problem_of(folder.path());
  EXPECT_THAT(error, IsError(ErrorCode::kUnsupported, "TUM RGB-D"));
  EXPECT_THAT(error, IsError(ErrorCode::kUnsupported, "KITTI"));
  EXPECT_THAT(error, IsError(ErrorCode::kUnsupported, "EuRoC"));
}

TEST(CameraDamage, an_empty_list_is_refused) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 2);
  write_bytes(folder / "walk/rgb.txt", "# timestamp filename\n");
  EXPECT_THAT(problem_of(folder / "walk"), IsError(ErrorCode::kBadInput, "rgb.txt: lists nothing"));
  make_kitti(folder / "drive", 2);
  write_bytes(folder / "drive/times.txt", "");
  EXPECT_THAT(problem_of(folder / "drive"), IsError(ErrorCode::kBadInput, "times.txt: is empty"));
}

TEST(CameraDamage, stamps_that_run_backwards_end_the_recording_there) {
  const TemporaryFolder folder;
  make_kitti(folder / "drive");
  replace_text(folder / "drive/times.txt", "6.000000e-01", "1.000000e-01");
  expect_ends_at(folder / "drive", 6, ErrorCode::kBadInput, "times.txt:7: time runs backwards");
  make_euroc(folder / "flight", 2);
  replace_text(folder / "flight/mav0/imu0/data.csv", "1403715273282142976,", "1403715273222142976,");
  expect_ends_at(folder / "flight", 1, ErrorCode::kBadInput, "data.csv:3: time runs backwards");
}

TEST(CameraDamage, a_line_that_cannot_be_read_ends_the_recording_there) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 4);
  std::filesystem::remove(folder / "walk/accelerometer.txt");
  replace_text(folder / "walk/rgb.txt", "100.200000 rgb/", "1oo.2 rgb/");
  expect_ends_at(folder / "walk", 2, ErrorCode::kBadInput, "rgb.txt:5: '1oo.2' is no stamp");
}

TEST(CameraDamage, a_picture_outside_the_folder_is_refused) {
  for (const char* name : {"../secret.png", "/etc/passwd", "rgb/../../x.png", "."}) {
    const TemporaryFolder folder;
    make_tum(folder / "walk", 2);
    write_bytes(folder / "walk/rgb.txt", "100.0 " + std::string(name) + "\n");
    EXPECT_THAT(problem_of(folder / "walk"), IsError(ErrorCode::kBadInput, "is no picture in the folder")) << name;
  }
}

TEST(CameraDamage, depth_of_8_bits_is_refused) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 2);
  write_picture(folder / "walk/depth/100.004000.png", picture(0, CV_8UC1));
  EXPECT_THAT(problem_of(folder / "walk"),
              IsError(ErrorCode::kBadInput, "1 channel(s) of 8 bits; one of 16 bits was expected"));
}

TEST(CameraDamage, a_damaged_depth_picture_is_refused) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 2);
  const auto file = folder / "walk/depth/100.104000.png";
  std::string bytes = bytes_of(file);
  for (std::size_t i = 45; i < bytes.size() - 20; ++i) bytes[i] = 'x';
  write_bytes(file, bytes);
  EXPECT_THAT(problem_of(folder / "walk"),
              IsError(ErrorCode::kCorrupt, "100.104000.png: the depth picture cannot be decoded"));
}

TEST(CameraDamage, colour_and_depth_that_never_pair_are_refused_with_their_times) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 3, 0.05);
  const auto error = problem_of(folder / "walk");
  EXPECT_THAT(error, IsError(ErrorCode::kBadInput, "within 0.020000 s"));
  EXPECT_THAT(error, IsError(ErrorCode::kBadInput, "depth: 100.050000 to 100.250000"));
  ReadOptions wide;
  wide.max_pair_s = 0.06;
  EXPECT_EQ(of_class<mrpt::obs::CObservation3DRangeScan>(read_all(folder / "walk", wide).records).size(), 3u);
}

TEST(CameraDamage, depth_pictures_without_their_list_are_missed) {
  const TemporaryFolder folder;
  make_tum(folder / "walk", 2);
  std::filesystem::remove(folder / "walk/depth.txt");
  EXPECT_THAT(problem_of(folder / "walk"), IsError(ErrorCode::kMissing, "depth.txt"));
}

TEST(CameraDamage, a_right_camera_that_is_missing_or_stands_left_is_refused) {
  const TemporaryFolder folder;
  make_euroc(folder / "flight", 2);
  std::filesystem::remove(folder / "flight/mav0/cam1/data.csv");
  EXPECT_THAT(problem_of(folder / "flight"), IsError(ErrorCode::kMissing, "cam1/data.csv"));
  make_kitti(folder / "drive", 2);
  std::filesystem::remove_all(folder / "drive/image_1");
  std::filesystem::create_directory(folder / "drive/image_1");
  EXPECT_THAT(problem_of(folder / "drive"), IsError(ErrorCode::kMissing, "image_1: holds no pictures"));
  make_kitti(folder / "swapped", 2);
  replace_text(folder / "swapped/calib.txt", "16 -15", "16 15");
  EXPECT_THAT(problem_of(folder / "swapped"),
              IsError(ErrorCode::kBadInput, "image_1 stands 0.500000 m left of image_0"));
}

TEST(CameraDamage, pictures_outside_a_rawlog_are_looked_at_when_loaded) {
  const TemporaryFolder folder;
  write_picture(folder / "left.png", picture(1));
  mrpt::obs::CObservationImage observation;
  observation.sensorLabel = "CAMERA";
  observation.image.setExternalStorage((folder / "left.png").string());
  const auto problem = [&] {
    try {
      load_pictures(observation);
    } catch (const Error& error) {
      return std::make_unique<Error>(error);
    }
    return std::unique_ptr<Error>();
  };
  EXPECT_EQ(problem(), nullptr);  // not calibrated: of any size
  observation.image.unload();
  observation.cameraParams.setIntrinsicParamsFromValues(500, 500, 320, 240);
  EXPECT_THAT(problem(),
              IsError(ErrorCode::kBadInput, "left.png: the picture has 32 x 24 pixels; 640 x 480 were expected"));
  observation.image.unload();
  const std::string bytes = bytes_of(folder / "left.png");
  write_bytes(folder / "left.png", bytes.substr(0, bytes.size() / 2));
  EXPECT_THAT(problem(), IsError(ErrorCode::kCorrupt, "left.png: the picture is cut short"));
}

}  // namespace
}  // namespace mapweave::rawlog
