// What lasers, odometry and transforms of a bag become.

#include "bags.h"

#include <mapweave/core/progress.h>
#include <mapweave/rawlog/contents.h>
#include <mapweave/rawlog/convert.h>
#include <mapweave/rawlog/scan_sweep.h>
#include <mapweave/rawlog/split.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationIMU.h>
#include <support/pose_matchers.h>

#include <limits>

namespace mapweave::rawlog {
namespace {

using test::IsNear;
using test::TemporaryFolder;
using ::testing::DoubleNear;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr float kInfinity = std::numeric_limits<float>::infinity(), kNan = std::numeric_limits<float>::quiet_NaN();

class BagObservations : public ::testing::Test {
 protected:
  Reading read(const std::vector<BagEntry>& entries, const ReadOptions& options = {}) {
    return read_all(write_bag(folder_ / "robot.bag", entries), options);
  }
  // The ends of the rays on the robot, seen from above.
  static std::vector<std::pair<double, double>> ends(const mrpt::obs::CObservation2DRangeScan& scan) {
    std::vector<std::pair<double, double>> points;
    for (std::size_t ray = 0; ray < scan.getScanSize(); ++ray) {
      const double angle = scan.getScanAngle(ray), range = scan.getScanRange(ray);
      const auto point =
          scan.sensorPose.composePoint(mrpt::math::TPoint3D(range * std::cos(angle), range * std::sin(angle), 0.0));
      points.emplace_back(point.x, point.y);
    }
    return points;
  }
  TemporaryFolder folder_;
};

Pose3 rolled(double x, double y, double z) {
  return {Eigen::Vector3d(x, y, z), Eigen::Quaterniond(Eigen::AngleAxisd(M_PI, Eigen::Vector3d::UnitX()))};
}

TEST_F(BagObservations, readings_follow_rep_117) {
  const auto reading =
      read({bag_transforms(1.0, {{"base_link", "laser", {}}}), bag_odometry(1.0, 0, 0, 0),
            bag_scan(1.0, {2.0f, kInfinity, -kInfinity, kNan, 0.05f, 10.5f, 10.0f}, {-0.3f, 0.3f, 0.1f})});
  ASSERT_FALSE(reading.error) << reading.error->what();
  const auto& scan = scan_of(reading.records.at(1));
  std::string valid;
  for (std::size_t ray = 0; ray < 7; ++ray) valid += scan.getScanRangeValidity(ray) ? '1' : '0';
  EXPECT_EQ(valid, "1000001");
  EXPECT_FLOAT_EQ(scan.maxRange, 10.0f);
  EXPECT_EQ(scan.sensorLabel, "scan");
}

TEST_F(BagObservations, rays_stand_where_the_message_says) {
  // Not symmetric, clockwise, with a maximum that lies one step behind the last ray.
  const auto reading = read({bag_transforms(1.0, {{"base_link", "laser", spatial(Pose2(0.5, 0, 0))}}),
                             bag_odometry(1.0, 0, 0, 0), bag_scan(1.0, {1, 1, 1}, {1.5f, 0.0f, -0.5f})});
  ASSERT_FALSE(reading.error) << reading.error->what();
  const auto& scan = scan_of(reading.records.at(1));
  EXPECT_NEAR(ray_angle(scan, 0), 1.5, 1e-6);
  EXPECT_NEAR(ray_angle(scan, 1), 1.0, 1e-6);
  EXPECT_NEAR(ray_angle(scan, 2), 0.5, 1e-6);
  EXPECT_NEAR(scan.sensorPose.x(), 0.5, 1e-9);
}

TEST_F(BagObservations, an_upside_down_laser_sees_left_what_is_left) {
  const auto upright = read(
      {bag_transforms(1.0, {{"base_link", "laser", {Eigen::Vector3d(0.1, 0, 0.3), Eigen::Quaterniond::Identity()}}}),
       bag_odometry(1.0, 0, 0, 0), bag_scan(1.0, {1, 2, 3}, {-0.2f, 0.8f, 0.5f})});
  const auto upside_down = read({bag_transforms(1.0, {{"base_link", "laser", rolled(0.1, 0, 0.3)}}),
                                 bag_odometry(1.0, 0, 0, 0), bag_scan(1.0, {3, 2, 1}, {-0.8f, 0.2f, 0.5f})});
  ASSERT_FALSE(upside_down.error) << upside_down.error->what();
  const auto expected = ends(scan_of(upright.records.at(1)));
  auto seen = ends(scan_of(upside_down.records.at(1)));
  std::reverse(seen.begin(), seen.end());
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_NEAR(seen[i].first, expected[i].first, 1e-6);
    EXPECT_NEAR(seen[i].second, expected[i].second, 1e-6);
  }
}

TEST_F(BagObservations, the_time_of_a_sweep_survives_a_rawlog) {
  ScanFields fields;
  fields.time_increment = 0.02f;
  fields.scan_time = 0.1f;
  const auto bag = write_bag(folder_ / "a.bag", {bag_odometry(1.0, 0, 0, 0), bag_scan(1.0, {1, 2, 3, 4, 5}, fields)});
  const auto progress = make_silent_progress();
  convert_log(bag, folder_ / "a.rawlog", *progress);
  for (const auto& path : {bag, folder_ / "a.rawlog"})
    EXPECT_NEAR(1e-9 * static_cast<double>(sweep_ns(scan_of(read_all(path).records.at(1)))), 0.08, 1e-6);
  // Longer than from scan to scan: miscounted.
  fields.scan_time = 0.05f;
  testing::internal::CaptureStderr();
  const auto miscounted = read({bag_odometry(1.0, 0, 0, 0), bag_scan(1.0, {1, 2, 3, 4, 5}, fields)});
  EXPECT_EQ(sweep_ns(scan_of(miscounted.records.at(1))), 0);
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("the sweep is not used"));
}

TEST_F(BagObservations, transforms_are_chained_and_may_come_late) {
  const Pose3 mast = {Eigen::Vector3d(0, 0, 1),
                      Eigen::Quaterniond(Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ()))};
  const auto reading =
      read({bag_odometry(1.0, 0, 0, 0), bag_scan(1.0), bag_odometry(1.1, 0.1, 0, 0), bag_scan(1.1),
            bag_transforms(1.2, {{"base_link", "mast", mast},
                                 {"mast", "laser", {Eigen::Vector3d(0.5, 0, 0), Eigen::Quaterniond::Identity()}}}),
            bag_scan(1.2)});
  ASSERT_FALSE(reading.error) << reading.error->what();
  ASSERT_EQ(kinds(reading.records), "ososs");
  const auto& pose = scan_of(reading.records[1]).sensorPose;
  EXPECT_NEAR(pose.x(), 0.0, 1e-9);
  EXPECT_NEAR(pose.y(), 0.5, 1e-9);
  EXPECT_NEAR(pose.yaw(), M_PI / 2, 1e-9);
}

TEST_F(BagObservations, a_link_that_moves_is_interpolated) {
  std::vector<BagEntry> entries = {bag_odometry(1.0, 0, 0, 0)};
  for (int i = 0; i < 5; ++i)
    entries.push_back(bag_transforms(1.0 + 0.2 * i, {{"base_link", "laser", spatial(Pose2(0.1 * i, 0, 0))}}, "/tf"));
  entries.push_back(bag_scan(1.3));
  const auto reading = read(entries);
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_NEAR(scan_of(reading.records.at(1)).sensorPose.x(), 0.15, 1e-6);
}

TEST_F(BagObservations, a_missing_transform_is_named) {
  const auto missing =
      read({bag_odometry(1.0, 0, 0, 0), bag_transforms(1.0, {{"base_link", "camera", {}}}), bag_scan(1.5)});
  EXPECT_THAT(
      missing.error,
      IsError(ErrorCode::kMissing,
              "no transform leads from 'base_link' to 'laser': the frame 'laser' is in no transform, since 1.500 s"));
  EXPECT_THAT(missing.error->what(), HasSubstr("base_link -> camera"));
  EXPECT_THAT(missing.error->what(), HasSubstr("reading.use_tf=false"));
  EXPECT_EQ(kinds(missing.records), "o");
  const auto loop = read(
      {bag_odometry(1.0, 0, 0, 0), bag_transforms(1.0, {{"mast", "laser", {}}, {"laser", "mast", {}}}), bag_scan(1.5)});
  EXPECT_THAT(loop.error, IsError(ErrorCode::kMissing, "a loop: 'laser' -> 'mast' -> 'laser'"));
  ReadOptions without;
  without.use_tf = false;
  without.laser_x_m = 0.3;
  const auto given =
      read({bag_odometry(1.0, 0, 0, 0), bag_transforms(1.0, {{"base_link", "camera", {}}}), bag_scan(1.5)}, without);
  ASSERT_FALSE(given.error) << given.error->what();
  EXPECT_NEAR(scan_of(given.records.at(1)).sensorPose.x(), 0.3, 1e-9);
}

TEST_F(BagObservations, without_transforms_the_laser_stands_at_the_origin_and_that_is_said) {
  testing::internal::CaptureStderr();
  const auto reading = read({bag_odometry(1.0, 0, 0, 0), bag_scan(1.0)});
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("there are no transforms"));
  ASSERT_EQ(kinds(reading.records), "os");
  EXPECT_NEAR(scan_of(reading.records[1]).sensorPose.norm(), 0.0, 1e-9);
}

TEST_F(BagObservations, odometry_comes_from_transforms_where_it_has_no_topic) {
  std::vector<BagEntry> entries;
  for (int i = 0; i < 5; ++i) {
    entries.push_back(bag_transforms(
        1.0 + 0.1 * i, {{"odom", "base_footprint", spatial(Pose2(0.1 * i, 0, 0.2))}, {"base_footprint", "laser", {}}},
        "/tf"));
    entries.push_back(bag_scan(1.0 + 0.1 * i));
  }
  const auto reading = read(entries);
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_EQ(kinds(reading.records), "ososososos");
  EXPECT_THAT(odometry_of(reading.records[8]), IsNear(Pose2(0.4, 0, 0.2), 1e-9, 1e-9));
}

TEST_F(BagObservations, stamps_of_zero_become_the_times_of_receipt) {
  BagEntry scan = bag_scan(0.0);
  scan.received_s = 7.5;
  testing::internal::CaptureStderr();
  const auto reading = read({bag_odometry(7.5, 0, 0, 0), scan});
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("messages of /scan have stamps of zero"));
  EXPECT_THAT(seconds(reading.records), ElementsAre(DoubleNear(7.5, 1e-6), DoubleNear(7.5, 1e-6)));
}

TEST_F(BagObservations, two_lasers_on_one_topic_get_two_labels) {
  ScanFields rear;
  rear.frame = "rear";
  const auto reading = read({bag_scan(1.0), bag_scan(1.0, {1, 2}, rear), bag_scan(1.1)});
  ASSERT_EQ(reading.records.size(), 3U);
  EXPECT_EQ(reading.records[0].observation->sensorLabel, "scan");
  EXPECT_EQ(reading.records[1].observation->sensorLabel, "scan@rear");
}

// A driver that was started again under another name, say.
TEST_F(BagObservations, a_laser_whose_frame_changes_stays_one_where_both_frames_are_in_one_place) {
  ScanFields renamed, moved;
  renamed.frame = "lasez";
  moved.frame = "rear";
  const Pose3 front = spatial(Pose2(0.2, 0.1, 0.0)), rear = spatial(Pose2(-0.2, 0.0, M_PI));
  const auto reading = read(
      {bag_transforms(1.0, {{"base_link", "laser", front}, {"base_link", "lasez", front}, {"base_link", "rear", rear}}),
       bag_odometry(1.0, 0, 0, 0), bag_scan(1.0), bag_scan(1.1, {1, 2}, renamed), bag_scan(1.2, {1, 2}, moved),
       bag_scan(1.3, {1, 2}, renamed)});
  std::vector<std::string> labels;
  for (const Record& record : reading.records)
    if (kinds({record}) == "s") labels.push_back(record.observation->sensorLabel);
  EXPECT_THAT(labels, ElementsAre("scan", "scan", "scan@rear", "scan"));
}

TEST_F(BagObservations, several_topics_of_a_kind_need_a_choice) {
  ScanFields rear;
  rear.topic = "/rear/scan";
  rear.frame = "rear";
  const std::vector<BagEntry> entries = {bag_odometry(1.0, 0, 0, 0), bag_scan(1.0), bag_scan(1.0, {1, 2}, rear)};
  const auto undecided = read(entries);
  EXPECT_THAT(undecided.error,
              IsError(ErrorCode::kBadInput, "2 topics of a laser (sensor_msgs/LaserScan): /scan, /rear/scan"));
  EXPECT_THAT(undecided.error->what(), HasSubstr("reading.topics=[/odom, /scan]"));
  ReadOptions options;
  options.topics = {"/rear/scan"};
  EXPECT_EQ(kinds(read(entries, options).records), "s");
  options.topics = {"/rear/scam"};
  EXPECT_THAT(read(entries, options).error, IsError(ErrorCode::kBadInput, "did you mean '/rear/scan'?"));
  // The truth is odometry only for who asks for it.
  EXPECT_EQ(
      kinds(read({bag_odometry(1.0, 0, 0, 0), bag_odometry(1.0, 5, 0, 0, "/base_pose_ground_truth"), bag_scan(1.0)})
                .records),
      "os");
}

TEST_F(BagObservations, robots_have_namespaces) {
  std::vector<BagEntry> entries;
  for (const std::string robot : {"tb3_0", "tb3_1"}) {
    ScanFields fields;
    fields.topic = "/" + robot + "/scan";
    fields.frame = robot + "/base_scan";
    entries.push_back(bag_transforms(
        1.0, {{robot + "/base_link", robot + "/base_scan", spatial(Pose2(robot == "tb3_0" ? 0.1 : 0.2, 0, 0))}},
        "/tf_static"));
    for (int i = 0; i < 3; ++i) {
      entries.push_back(bag_odometry(1.0 + 0.1 * i, 0, 0, 0, "/" + robot + "/odom", robot + "/base_link"));
      entries.push_back(bag_scan(1.0 + 0.1 * i, {1, 2, 3}, fields));
    }
  }
  EXPECT_THAT(read(entries).error,
              IsError(ErrorCode::kBadInput, "2 robots, by the namespaces of their odometry: tb3_0, tb3_1"));
  ReadOptions options;
  options.robot_namespace = "tb3_1";
  const auto reading = read(entries, options);
  ASSERT_FALSE(reading.error) << reading.error->what();
  ASSERT_EQ(kinds(reading.records), "ososos");
  EXPECT_EQ(reading.records[1].observation->sensorLabel, "scan");
  EXPECT_NEAR(scan_of(reading.records[1]).sensorPose.x(), 0.2, 1e-9);
  options.robot_namespace = "tb3_2";
  EXPECT_THAT(read(entries, options).error, IsError(ErrorCode::kBadInput, "it has tb3_0, tb3_1"));

  const auto progress = make_silent_progress();
  const auto parts = split_by_namespace(folder_ / "robot.bag", folder_ / "parts", {}, *progress);
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_EQ(parts[1].path.filename(), "tb3_1.rawlog");
  EXPECT_EQ(parts[1].scans, 3U);
  EXPECT_EQ(parts[1].odometry, 3U);
  EXPECT_EQ(kinds(read_all(parts[0].path).records), "ososos");
}

TEST_F(BagObservations, a_bag_of_nothing_that_is_read_says_what_is_there) {
  const auto reading = read({{"/chatter", "std_msgs/String", 1.0, MessageBytes().text("hello").bytes()}});
  EXPECT_THAT(reading.error, IsError(ErrorCode::kBadInput, "/chatter (std_msgs/String)"));
}

TEST_F(BagObservations, a_message_that_ends_early_is_placed) {
  BagEntry cut = bag_scan(1.1);
  cut.data.resize(cut.data.size() - 10);
  const auto reading = read({bag_odometry(1.0, 0, 0, 0), bag_scan(1.0), cut});
  EXPECT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "topic /scan"));
  EXPECT_THAT(reading.error->what(), HasSubstr("robot.bag"));
  EXPECT_EQ(kinds(reading.records), "os");
}

TEST_F(BagObservations, first_echoes_of_a_multi_echo_laser_are_used) {
  MessageBytes bytes;
  bytes.header(1.0, "laser").floats({-0.1f, 0.1f, 0.1f, 0.0f, 0.0f, 0.1f, 10.0f}).number(std::uint32_t{3});
  for (const std::vector<float>& echoes : {std::vector<float>{2, 3}, {}, {4}})
    bytes.number(static_cast<std::uint32_t>(echoes.size())).floats(echoes);
  bytes.number(std::uint32_t{0});
  const auto reading = read({{"/scan", "sensor_msgs/MultiEchoLaserScan", 1.0, bytes.bytes()}});
  ASSERT_FALSE(reading.error) << reading.error->what();
  const auto& scan = scan_of(reading.records.at(0));
  EXPECT_FLOAT_EQ(scan.getScanRange(0), 2.0f);
  EXPECT_FALSE(scan.getScanRangeValidity(1));
  EXPECT_FLOAT_EQ(scan.getScanRange(2), 4.0f);
}

// Points of x, y, z and, where `with_ring`, a ring.
BagEntry cloud(const std::vector<std::pair<Eigen::Vector3f, std::uint16_t>>& points, bool with_ring) {
  CloudForm form;
  form.width = static_cast<std::uint32_t>(points.size());
  if (with_ring) form.fields.emplace_back("ring", 4);
  MessageBytes bytes;
  for (const auto& [point, ring] : points) {
    bytes.floats({point.x(), point.y(), point.z()});
    if (with_ring) bytes.number(ring);
  }
  return bag_cloud(1.0, form, bytes.bytes());
}

TEST_F(BagObservations, a_cloud_becomes_a_planar_scan) {
  for (const bool with_ring : {true, false}) {
    // A wall to the left at the sensor's height, a nearer thing on the floor before it.
    const auto reading =
        read({cloud({{{0, 2, 0}, 1}, {{0, 1, -0.5f}, 0}, {{3, 0, 0.05f}, 1}, {{1, 0, -0.4f}, 0}}, with_ring)});
    ASSERT_FALSE(reading.error) << reading.error->what();
    const auto& scan = scan_of(reading.records.at(0));
    std::vector<std::pair<double, float>> seen;
    for (std::size_t ray = 0; ray < scan.getScanSize(); ++ray)
      if (scan.getScanRangeValidity(ray)) seen.emplace_back(ray_angle(scan, ray), scan.getScanRange(ray));
    ASSERT_EQ(seen.size(), 2U);
    EXPECT_NEAR(seen[0].first, 0.0, 0.01);
    EXPECT_FLOAT_EQ(seen[0].second, 3.0f);
    EXPECT_NEAR(seen[1].first, M_PI / 2, 0.01);
    EXPECT_FLOAT_EQ(seen[1].second, 2.0f);
  }
}

TEST_F(BagObservations, an_inertial_unit_says_what_it_measures) {
  MessageBytes bytes;
  bytes.header(1.0, "imu").doubles({0, 0, 0, 1}).doubles({-1, 0, 0, 0, 0, 0, 0, 0, 0});
  bytes.doubles({0.1, 0.2, 0.3})
      .doubles(std::vector<double>(9, 0.0))
      .doubles({1, 2, 9.8})
      .doubles(std::vector<double>(9, 0.0));
  const auto reading = read({{"/imu", "sensor_msgs/Imu", 1.0, bytes.bytes()}});
  ASSERT_FALSE(reading.error) << reading.error->what();
  const auto& imu = dynamic_cast<const mrpt::obs::CObservationIMU&>(*reading.records.at(0).observation);
  EXPECT_DOUBLE_EQ(imu.get(mrpt::obs::IMU_WZ), 0.3);
  EXPECT_DOUBLE_EQ(imu.get(mrpt::obs::IMU_Z_ACC), 9.8);
  EXPECT_FALSE(imu.has(mrpt::obs::IMU_YAW));
}

TEST_F(BagObservations, positions_by_satellites_are_kept) {
  const auto fix = [](double at, std::int8_t status, double latitude) {
    MessageBytes bytes;
    bytes.header(at, "gps").number(status).number(std::uint16_t{1}).doubles({latitude, 11.5, 520.25});
    bytes.doubles(std::vector<double>(9, 0.0)).number(std::uint8_t{0});
    return BagEntry{"/fix", "sensor_msgs/NavSatFix", at, bytes.bytes()};
  };
  auto entries = small_drive();
  entries.push_back(fix(101.0, 2, 48.25));
  entries.push_back(fix(101.1, -1, std::nan("")));
  const auto reading = read(entries);
  ASSERT_FALSE(reading.error) << reading.error->what();
  std::vector<mrpt::obs::gnss::Message_NMEA_GGA::content_t> found;
  for (const Record& record : reading.records)
    if (const auto gps = std::dynamic_pointer_cast<mrpt::obs::CObservationGPS>(record.observation)) {
      EXPECT_EQ(gps->sensorLabel, "fix");
      found.push_back(gps->getMsgByClass<mrpt::obs::gnss::Message_NMEA_GGA>().fields);
    }
  ASSERT_EQ(found.size(), 2U);
  EXPECT_EQ(found[0].fix_quality, 2);
  EXPECT_DOUBLE_EQ(found[0].latitude_degrees, 48.25);
  EXPECT_DOUBLE_EQ(found[0].altitude_meters, 520.25);
  EXPECT_EQ(found[1].fix_quality, 0);
  const auto alone = read({fix(2.0, 0, 48.25)});
  EXPECT_TRUE(alone.error) << "nothing can be mapped";
}

TEST_F(BagObservations, contents_name_topics_and_frames) {
  auto entries = small_drive();
  entries.push_back({"/chatter", "std_msgs/String", 100.5, MessageBytes().text("hello").bytes()});
  const auto contents = summarize_log(write_bag(folder_ / "a.bag", entries));
  EXPECT_EQ(contents.format, "ROS 1 bag");
  EXPECT_EQ(contents.scans, 10U);
  ASSERT_EQ(contents.topics.size(), 4U);
  EXPECT_EQ(contents.topics[0].name, "/chatter");
  EXPECT_EQ(contents.topics[2].name, "/scan");
  EXPECT_EQ(contents.topics[2].count, 10U);
  EXPECT_NEAR(contents.topics[2].rate_hz, 10.0, 1e-6);
  EXPECT_THAT(contents.topics[2].frames, ElementsAre("laser"));
  EXPECT_THAT(contents.topics[3].frames, ElementsAre("base_link -> laser"));
}

}  // namespace
}  // namespace mapweave::rawlog
