// Organised point clouds of a bag, read as pictures of a depth camera.

#include "bag_pictures.h"

#include <mapweave/rawlog/contents.h>
#include <mapweave/rawlog/depth_delay.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationImage.h>

#include <limits>

namespace mapweave::rawlog {
namespace {

using mrpt::obs::CObservation2DRangeScan;
using mrpt::obs::CObservation3DRangeScan;
using mrpt::obs::CObservationImage;
using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const float kNone = std::numeric_limits<float>::quiet_NaN();
const std::vector<float> kDepths_m = {1.2344f, 1.2346f, kNone, 0.5f, 2.0f, 3.25f, 7.001f, 4.0f};

class DepthClouds : public ::testing::Test {
 protected:
  Reading read(const std::vector<BagEntry>& entries, const ReadOptions& options = {}) {
    return read_all(write_bag(folder_ / "robot.bag", entries), options);
  }
  TemporaryFolder folder_;
};

ReadOptions clouds_as(PointCloudUse use) {
  ReadOptions options;
  options.point_clouds = use;
  return options;
}

BagEntry depth_image(const std::string& topic, double stamp_s, const std::vector<float>& depths_m) {
  return picture(topic, stamp_s, "32FC1", MessageBytes().floats(depths_m).bytes());
}

std::vector<std::uint16_t> steps_of(const Record& record) {
  const auto& image = dynamic_cast<const CObservation3DRangeScan&>(*record.observation).rangeImage;
  return {image.data(), image.data() + image.size()};
}

// A wall to the left of a lidar.
BagEntry lidar(double stamp_s, const std::string& topic = "/velodyne_points") {
  CloudForm form;
  form.topic = topic;
  return bag_cloud(stamp_s, form, MessageBytes().floats({0.0f, 2.0f, 0.0f}).bytes());
}

TEST_F(DepthClouds, a_cloud_gives_the_frames_that_the_depth_image_gives) {
  std::vector<BagEntry> with_image, with_cloud;
  for (int i = 0; i < 3; ++i) {
    const double stamp_s = 1.0 + 0.1 * i;
    for (auto* entries : {&with_image, &with_cloud}) {
      entries->push_back(calibration("/camera/rgb/camera_info", stamp_s));
      entries->push_back(grey("/camera/rgb/image_rect", stamp_s, static_cast<char>(40 + i)));
    }
    with_image.push_back(depth_image("/camera/depth_registered/image_rect", stamp_s + 0.005, kDepths_m));
    with_cloud.push_back(depth_cloud("/camera/depth_registered/points", stamp_s + 0.005, kDepths_m));
  }
  const auto expected = read(with_image), found = read(with_cloud);
  ASSERT_FALSE(found.error) << found.error->what();
  ASSERT_EQ(expected.records.size(), 3U);
  ASSERT_EQ(found.records.size(), 3U);
  EXPECT_THAT(steps_of(found.records[0]), ElementsAre(1234, 1235, 0, 500, 2000, 3250, 7001, 4000));
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& one = dynamic_cast<const CObservation3DRangeScan&>(*expected.records[i].observation);
    const auto& other = dynamic_cast<const CObservation3DRangeScan&>(*found.records[i].observation);
    EXPECT_EQ(steps_of(found.records[i]), steps_of(expected.records[i]));
    EXPECT_EQ(found.records[i].stamp, expected.records[i].stamp);
    EXPECT_EQ(other.sensorLabel, one.sensorLabel);
    EXPECT_EQ(depth_delay_ns(other), 5'000'000);
    EXPECT_EQ(other.cameraParams, one.cameraParams);
    EXPECT_EQ(other.sensorPose, one.sensorPose);
    EXPECT_TRUE(other.range_is_depth && other.hasIntensityImage);
    EXPECT_EQ(other.intensityImage.at<std::uint8_t>(0, 0), 40 + i);
  }
}

TEST_F(DepthClouds, what_is_no_reading_is_none) {
  const float infinite = std::numeric_limits<float>::infinity();
  const auto reading =
      read({calibration("/camera/depth/camera_info", 1.0),
            depth_cloud("/camera/depth/points", 1.0, {1.25f, kNone, infinite, -1.0f, 0.0f, 70.0f, 65.5f, 0.001f})},
           clouds_as(PointCloudUse::automatic));
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_THAT(steps_of(reading.records.at(0)), ElementsAre(1250, 0, 0, 0, 0, 0, 65500, 1));
  const auto& frame = dynamic_cast<const CObservation3DRangeScan&>(*reading.records[0].observation);
  EXPECT_FALSE(frame.hasIntensityImage);
  EXPECT_EQ(frame.sensorLabel, "camera/depth");
  EXPECT_DOUBLE_EQ(frame.cameraParams.fx(), 390.0) << "clouds are made of rectified depth";
}

TEST_F(DepthClouds, colours_of_a_cloud_are_the_picture_where_there_is_no_other) {
  CloudForm form;
  form.width = kWidth;
  form.height = kHeight;
  form.topic = "/camera/depth_registered/points";
  form.frame = "optical";
  form.fields = {{"x", 8}, {"y", 8}, {"z", 8}, {"rgb", 7}};
  MessageBytes points;
  for (int i = 0; i < 8; ++i)
    points.doubles({0.0, 0.0, 1.5 + 0.1 * i}).number(std::uint32_t{0x00102030} + static_cast<std::uint32_t>(i));
  const auto cloud = bag_cloud(1.0, form, points.bytes());
  const auto alone = read({calibration("/camera/rgb/camera_info", 1.0), cloud});
  ASSERT_FALSE(alone.error) << alone.error->what();
  const auto& frame = dynamic_cast<const CObservation3DRangeScan&>(*alone.records.at(0).observation);
  EXPECT_THAT(steps_of(alone.records[0]), ElementsAre(1500, 1600, 1700, 1800, 1900, 2000, 2100, 2200));
  ASSERT_TRUE(frame.hasIntensityImage);
  EXPECT_EQ(frame.intensityImage.at<std::uint8_t>(3, 1, 0), 0x37) << "blue of the last point";
  EXPECT_EQ(frame.intensityImage.at<std::uint8_t>(0, 0, 2), 0x10) << "red";
  EXPECT_EQ(depth_delay_ns(frame), 0);
  EXPECT_DOUBLE_EQ(frame.cameraParams.fx(), 390.0) << "of the driver's only calibration";
  const auto beside = read({calibration("/camera/rgb/camera_info", 1.0), grey("/camera/rgb/image_raw", 1.0), cloud});
  ASSERT_FALSE(beside.error) << beside.error->what();
  EXPECT_FALSE(
      dynamic_cast<const CObservation3DRangeScan&>(*beside.records.at(0).observation).intensityImage.isColor());
}

TEST_F(DepthClouds, clouds_are_depth_by_their_names) {
  const auto info = calibration("/camera/depth/camera_info", 1.0);
  const auto kind = [&](const std::vector<BagEntry>& entries, const ReadOptions& options = {}) {
    const auto reading = read(entries, options);
    EXPECT_FALSE(reading.error) << reading.error->what();
    return std::string(reading.records.at(0).observation->GetRuntimeClass()->className);
  };
  const auto points = [](const std::string& topic) { return depth_cloud(topic, 1.0, kDepths_m); };
  const std::string depth = "mrpt::obs::CObservation3DRangeScan", scan = "mrpt::obs::CObservation2DRangeScan";
  EXPECT_EQ(kind({info, points("/camera/depth/points")}), depth);
  EXPECT_EQ(kind({info, points("/camera/depth/color/points")}), scan);
  EXPECT_EQ(kind({points("/camera/depth/points")}), scan) << "without a calibration";
  EXPECT_EQ(kind({info, points("/camera/depth/color/points")}, clouds_as(PointCloudUse::depth)), depth);
  EXPECT_EQ(kind({info, points("/camera/depth/points")}, clouds_as(PointCloudUse::scans)), scan);
  const auto both = read({info, depth_image("/camera/depth/image_rect", 1.0, std::vector<float>(8, 2.0f)),
                          points("/camera/depth/points"), bag_scan(1.1)});
  ASSERT_EQ(both.records.size(), 2U);
  EXPECT_EQ(steps_of(both.records[0]).front(), 2000) << "the image goes before the cloud";
}

TEST_F(DepthClouds, a_lidar_beside_a_depth_camera_is_read_too) {
  const auto info = calibration("/camera/depth/camera_info", 1.0);
  const auto reading = read({info, depth_cloud("/camera/depth/points", 1.0, kDepths_m), lidar(1.1)});
  ASSERT_FALSE(reading.error) << reading.error->what();
  ASSERT_EQ(reading.records.size(), 2U);
  EXPECT_NE(dynamic_cast<const CObservation3DRangeScan*>(reading.records[0].observation.get()), nullptr);
  EXPECT_NE(dynamic_cast<const CObservation2DRangeScan*>(reading.records[1].observation.get()), nullptr);
  const auto lidars = read({info, lidar(1.0, "/left/points"), lidar(1.1, "/right/points")});
  EXPECT_THAT(lidars.error, IsError(ErrorCode::kBadInput, "2 topics of a lidar with point clouds"));
  EXPECT_THAT(lidars.error->remedy(), HasSubstr("reading.topics=[/left/points]"));
  ReadOptions named = clouds_as(PointCloudUse::depth);
  named.topics = {"/camera/depth/points"};
  EXPECT_EQ(read({info, depth_cloud("/camera/depth/points", 1.0, kDepths_m), lidar(1.1)}, named).records.size(), 1U);
}

TEST_F(DepthClouds, a_cloud_that_is_no_depth_picture_says_why) {
  CloudForm form;
  form.width = kWidth;
  form.height = kHeight;
  form.topic = "/camera/depth/points";
  form.frame = "optical";
  const auto error_of = [&](const CloudForm& of, const Calibration& camera = {}) {
    std::string points;
    for (std::uint32_t i = 0; i < of.width * of.height; ++i) points += MessageBytes().floats({0, 0, 1.0f}).bytes();
    return read({calibration("/camera/depth/camera_info", 1.0, camera), bag_cloud(1.0, of, points)}).error;
  };
  ASSERT_EQ(error_of(form), nullptr);
  CloudForm row = form;
  row.width = kWidth * kHeight;
  row.height = 1;
  EXPECT_THAT(error_of(row), IsError(ErrorCode::kBadInput, "of 8 x 1 points is not organised"));
  EXPECT_THAT(error_of(row)->remedy(), HasSubstr("reading.point_clouds=scans"));
  EXPECT_THAT(error_of(row)->where(), HasSubstr("topic /camera/depth/points"));
  Calibration larger;
  larger.width = 2 * kWidth;
  EXPECT_THAT(error_of(form, larger), IsError(ErrorCode::kBadInput, "8 x 2 were expected, as its camera_info says"));
  CloudForm flat = form;
  flat.fields[2].first = "intensity";
  EXPECT_THAT(error_of(flat), IsError(ErrorCode::kBadInput, "no field 'z'; their fields: x, y, intensity"));
  for (const std::uint8_t type : {0, 5, 9, 255}) {
    CloudForm unknown = form;
    unknown.fields[2].second = type;
    const std::string expected = type == 5 ? "; 7 (float32) or 8 (float64) was expected" : "; 1 to 8 are known";
    EXPECT_THAT(error_of(unknown),
                IsError(ErrorCode::kBadInput, "'z' is of datatype " + std::to_string(type) + expected));
  }
  CloudForm big = form;
  big.is_big_endian = true;
  EXPECT_THAT(error_of(big), IsError(ErrorCode::kBadInput, "it is big-endian"));
}

TEST_F(DepthClouds, points_with_other_axes_are_refused) {
  CloudForm form;
  form.width = kWidth;
  form.height = kHeight;
  form.topic = "/camera/depth/points";
  form.fields = {{"y", 7}, {"z", 7}, {"x", 7}};  // the robot's axes: x ahead
  const auto cloud = depth_cloud(form.topic, 1.0, kDepths_m);
  const std::string points = cloud.data.substr(cloud.data.size() - 97, 96);
  EXPECT_THAT(read({calibration("/camera/depth/camera_info", 1.0), bag_cloud(1.0, form, points)}).error,
              IsError(ErrorCode::kBadInput, "are not seen at their pixels"));
}

TEST_F(DepthClouds, contents_say_what_a_cloud_is) {
  const auto contents =
      summarize_log(write_bag(folder_ / "a.bag", {calibration("/camera/depth/camera_info", 1.0),
                                                  depth_cloud("/camera/depth/points", 1.0, kDepths_m), lidar(1.1)}));
  ASSERT_EQ(contents.topics.size(), 3U);
  EXPECT_FALSE(contents.topics[0].cloud);
  ASSERT_TRUE(contents.topics[1].cloud && contents.topics[2].cloud);
  EXPECT_EQ(contents.topics[1].cloud->width, kWidth);
  EXPECT_EQ(contents.topics[1].cloud->height, kHeight);
  EXPECT_EQ(contents.topics[2].cloud->height, 1U);
  EXPECT_THAT(contents.topics[2].cloud->fields, ElementsAre("x", "y", "z"));
}

}  // namespace
}  // namespace mapweave::rawlog
