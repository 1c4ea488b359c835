#include "logs.h"

#include <support/pose_matchers.h>
#include <zlib.h>

#include <limits>
#include <locale>

namespace mapweave::rawlog {
namespace {

using test::IsNear;
using test::own_data;
using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string flaser(const std::vector<double>& ranges, double stamp_s, double x = 0.0) {
  std::string line = "FLASER " + std::to_string(ranges.size());
  for (const double range : ranges) line += " " + std::to_string(range);
  const std::string pose = " " + std::to_string(x) + " 0 0";
  return line + pose + pose + " " + std::to_string(stamp_s) + " robot " + std::to_string(stamp_s) + "\n";
}

TEST(Carmen, reads_the_old_style) {
  const auto reading = read_all(own_data("carmen_old.log"));
  ASSERT_FALSE(reading.error) << reading.error->what();
  ASSERT_EQ(kinds(reading.records), "ossoss");
  EXPECT_THAT(seconds(reading.records), ElementsAre(101.0, 101.0, 101.0, 101.5, 101.5, 101.5));
  EXPECT_THAT(odometry_of(reading.records[3]), IsNear(Pose2(1.5, 2.0, 1.570796), 1e-9, 1e-9));

  const auto& front = scan_of(reading.records[1]);
  EXPECT_EQ(front.sensorLabel, "FLASER");
  EXPECT_NEAR(front.sensorPose.x(), 0.1, 1e-6);
  EXPECT_NEAR(ray_angle(front, 0), -M_PI / 2, 1e-6);
  EXPECT_NEAR(ray_angle(front, 4), M_PI / 2, 1e-6);
  EXPECT_FLOAT_EQ(front.getScanRange(2), 3.0f);
  EXPECT_TRUE(front.getScanRangeValidity(3));
  EXPECT_FALSE(front.getScanRangeValidity(4));  // 81.91: nothing there

  const auto& rear = scan_of(reading.records[2]);
  EXPECT_NEAR(rear.sensorPose.x(), -0.2, 1e-6);
  EXPECT_NEAR(wrap_angle(ray_angle(rear, 1) - M_PI), 0.0, 1e-4);
  const auto& second_rear = scan_of(reading.records[5]);
  EXPECT_TRUE(second_rear.getScanRangeValidity(0));
  EXPECT_FALSE(second_rear.getScanRangeValidity(1));  // 0
  EXPECT_FALSE(second_rear.getScanRangeValidity(2));  // inf
}

TEST(Carmen, counts_the_damaged_lines_that_it_leaves_out) {
  const TemporaryFolder folder;
  std::ofstream file(folder / "a.log", std::ios::binary);
  file << "# a comment\nSYNC 3\n" << flaser({1, 2, 3}, 100.0) << std::string("FLA\0ER 3 1 2 3\n", 15);
  file << flaser({1, 2, 3}, 101.0) << "\xfe\x01\x02 rest\n\x80\n";
  file.close();
  testing::internal::CaptureStderr();
  EXPECT_EQ(kinds(read_all(folder / "a.log").records), "ss");
  const std::string said = testing::internal::GetCapturedStderr();
  EXPECT_THAT(said, HasSubstr("a.log:4: the first of 3 lines that are damaged and are left out"));
}

TEST(Carmen, says_all_of_what_is_wrong_with_a_number_that_begins_with_nul) {
  const TemporaryFolder folder;
  const std::string line = std::string("FLASER 1 ") + '\0' + "2.5 0 0 0 0 0 0 1 h 1\n";
  const auto reading = read_all(write_bytes(folder / "a.log", line));
  ASSERT_TRUE(reading.error);
  EXPECT_THAT(reading.error->what(), HasSubstr("'?2.5' is no number"));
  EXPECT_THAT(reading.error->what(), HasSubstr("correct or remove the line"));
}

TEST(Carmen, reads_the_new_style) {
  const auto reading = read_all(own_data("carmen_new.log"));
  ASSERT_FALSE(reading.error) << reading.error->what();
  ASSERT_EQ(kinds(reading.records), "osos");
  const auto& scan = scan_of(reading.records[1]);
  EXPECT_EQ(scan.sensorLabel, "ROBOTLASER1");
  EXPECT_NEAR(scan.sensorPose.x(), 0.2, 1e-6);
  EXPECT_NEAR(ray_angle(scan, 0), -M_PI / 2, 1e-6);
  EXPECT_NEAR(ray_angle(scan, 4), M_PI / 2, 1e-5);
  EXPECT_FLOAT_EQ(scan.maxRange, 20.0f);
  EXPECT_FALSE(scan.getScanRangeValidity(3));
  EXPECT_THAT(odometry_of(reading.records[2]), IsNear(Pose2(0.6, 0.0, 0.0), 1e-9, 1e-9));
}

TEST(Carmen, starts_at_minus_90_degrees_whatever_the_number_of_rays) {
  const TemporaryFolder folder;
  struct Case {
    std::size_t rays;
    double last_deg;
  };
  for (const auto& [rays, last_deg] : {Case{180, 89.0}, Case{181, 90.0}, Case{360, 89.5}, Case{361, 90.0}}) {
    const auto reading = read_all(write_bytes(folder / "a.log", flaser(std::vector<double>(rays, 2.0), 1.0)));
    ASSERT_EQ(kinds(reading.records), "s");
    const auto& scan = scan_of(reading.records[0]);
    EXPECT_NEAR(ray_angle(scan, 0), -M_PI / 2, 1e-6) << rays;
    EXPECT_NEAR(ray_angle(scan, rays - 1), last_deg * M_PI / 180, 1e-6) << rays;
    EXPECT_NEAR(ray_angle(scan, 90 * (rays / 180)), 0.0, 1e-6) << rays;
  }
}

TEST(Carmen, reads_a_public_log_as_its_rawlog) {
  for (const std::string name : {"intel/intel", "fr079/fr079"}) {
    MAPWEAVE_NEED_DATA(text, "laser/" + name + ".clf.gz");
    MAPWEAVE_NEED_DATA(rawlog, "laser/" + name + ".rawlog");
    const auto a = open_log(text), b = open_log(rawlog);
    for (std::uint64_t count = 0;; ++count) {
      const auto left = a->next(), right = b->next();
      ASSERT_EQ(left.has_value(), right.has_value());
      if (!left) break;
      ASSERT_LE(std::abs(left->stamp.ns - right->stamp.ns), 100);
      ASSERT_EQ(kinds({*left}), kinds({*right}));
      if (kinds({*left}) == "o") {
        ASSERT_THAT(odometry_of(*left), IsNear(odometry_of(*right), 1e-9, 1e-9));
        continue;
      }
      const auto &mine = scan_of(*left), &given = scan_of(*right);
      ASSERT_EQ(mine.getScanSize(), given.getScanSize());
      ASSERT_NEAR(mine.sensorPose.x(), given.sensorPose.x(), 1e-6);
      for (std::size_t i = 0; i < mine.getScanSize(); ++i) {
        ASSERT_NEAR(ray_angle(mine, i), ray_angle(given, i), 1e-6);
        ASSERT_EQ(mine.getScanRange(i), given.getScanRange(i));
        ASSERT_EQ(mine.getScanRangeValidity(i), given.getScanRangeValidity(i));
      }
    }
  }
}

TEST(Carmen, takes_the_heap_of_longest_readings_for_no_returns) {
  const TemporaryFolder folder;
  std::string text;
  for (int i = 0; i < 10; ++i) text += flaser({1.0, 20.0 + i, 51.11, 51.06, 50.91}, 1.0 + i, 0.1 * i);
  const auto reading = read_all(write_bytes(folder / "a.log", text));
  ASSERT_FALSE(reading.error);
  const auto& scan = scan_of(reading.records[1]);
  EXPECT_FLOAT_EQ(scan.maxRange, 50.5f);
  EXPECT_TRUE(scan.getScanRangeValidity(1));
  for (const std::size_t ray : {2u, 3u, 4u}) EXPECT_FALSE(scan.getScanRangeValidity(ray));
  ReadOptions options;
  options.max_range_m = 10.0;
  EXPECT_FALSE(scan_of(read_all(folder / "a.log", options).records[1]).getScanRangeValidity(1));
}

TEST(Carmen, takes_odometry_from_odom_lines_where_the_laser_lines_have_none) {
  const TemporaryFolder folder;
  const std::string odom = "ODOM 1.0 0 0 0 0 0 1.5 robot 1.5\n";
  EXPECT_EQ(kinds(read_all(write_bytes(folder / "still.log", flaser({1.0}, 1.0) + odom + flaser({1.0}, 2.0))).records),
            "sos");
  EXPECT_EQ(kinds(read_all(write_bytes(folder / "moving.log", flaser({1.0}, 1.0, 0.0) + odom + flaser({1.0}, 2.0, 3.0)))
                      .records),
            "osos");
}

TEST(Carmen, takes_the_loggers_stamps_where_the_others_stand_still) {
  const TemporaryFolder folder;
  std::string text;
  for (int i = 1; i <= 5; ++i) text += "FLASER 1 2.0 0 0 0 0 0 0 9.76053e+08 robot " + std::to_string(i) + "\n";
  EXPECT_THAT(seconds(read_all(write_bytes(folder / "a.log", text)).records), ElementsAre(1.0, 2.0, 3.0, 4.0, 5.0));
}

TEST(Carmen, places_a_laser_where_the_log_does_not_say) {
  const TemporaryFolder folder;
  ReadOptions options;
  options.laser_x_m = 0.3;
  const auto path = write_bytes(folder / "a.log", flaser({1.0, 1.0, 1.0}, 1.0, 5.0));
  EXPECT_NEAR(scan_of(read_all(path, options).records[0]).sensorPose.x(), 0.3, 1e-9);
  EXPECT_NEAR(scan_of(read_all(path).records[0]).sensorPose.x(), 0.0, 1e-9);
}

TEST(Carmen, uses_its_parameters_where_the_laser_poses_are_corrected_ones) {
  const TemporaryFolder folder;
  std::string text = "PARAM robot_frontlaser_offset 0.25 nohost 0\n";
  for (int i = 1; i <= 9; ++i)
    text += "FLASER 1 2.0 " + std::to_string(i * i) + " 0 0 " + std::to_string(i) + " 0 0 " + std::to_string(i) +
            " robot 1\n";
  const auto reading = read_all(write_bytes(folder / "a.log", text));
  ASSERT_EQ(kinds(reading.records.empty() ? std::vector<Record>{} : std::vector<Record>{reading.records[1]}), "s");
  EXPECT_NEAR(scan_of(reading.records[1]).sensorPose.x(), 0.25, 1e-9);
}

TEST(Carmen, names_the_line_that_is_wrong) {
  const TemporaryFolder folder;
  const std::string good = flaser({1.0, 2.0}, 1.0);
  const auto problem = [&](const std::string& line) {
    return read_all(write_bytes(folder / "a.log", good + line + "\n" + flaser({1.0, 2.0}, 2.0)));
  };
  struct Case {
    const char *line, *text;
  };
  for (const auto& [line, text] :
       {Case{"FLASER 2 1.0 nan 0 0 0 0 0 0 1.5 r 1.5", "not a number"},
        Case{"FLASER 2 1.0 -3 0 0 0 0 0 0 1.5 r 1.5", "negative"},
        Case{"FLASER 0 0 0 0 0 0 0 1.5 r 1.5", "no readings"}, Case{"FLASER 2 1.0 2.0 0 0 0", "ends early"},
        Case{"FLASER 2 1.0 2.0 3.0 0 0 0 0 0 0 1.5 r 1.5", "number"},
        Case{"FLASER two 1.0 2.0 0 0 0 0 0 0 1.5 r 1.5", "no number"},
        Case{"FLASER -2 1.0 2.0 0 0 0 0 0 0 1.5 r 1.5", "out of its range"},
        Case{"FLASER 1e18 1.0", "out of its range"},
        Case{"FLASER 2 1,0 2,0 0 0 0 0 0 0 1.5 r 1.5", "'1,0' is no number"},
        Case{"FLASER 2 1.0 2.0 0 0 0 inf 0 0 1.5 r 1.5", "not finite"}, Case{"ODOM 0 0 0 0 0", "ends early"},
        Case{"ODOM x 0 0 0 0 0 1.5 r 1.5", "'x' is no number"},
        Case{"FLASER 2 1.0 2.0 0 0 0 0 0 0 1e30 r 1.5", "no time"}}) {
    const auto reading = problem(line);
    EXPECT_THAT(reading.error, IsError(ErrorCode::kBadInput, text)) << line;
    ASSERT_TRUE(reading.error) << line;
    EXPECT_THAT(reading.error->where(), HasSubstr("a.log:2")) << line;
    EXPECT_EQ(reading.records.size(), 1u) << line;
  }
}

TEST(Carmen, refuses_a_line_cut_by_the_end_of_the_file) {
  const TemporaryFolder folder;
  const std::string good = flaser({1.0, 2.0}, 1.0);
  const auto cut = read_all(write_bytes(folder / "a.log", good + good.substr(0, good.size() / 2)));
  EXPECT_EQ(cut.records.size(), 1u);
  EXPECT_THAT(cut.error, IsError(ErrorCode::kCorrupt, "a.log:2"));
  EXPECT_FALSE(
      read_all(write_bytes(folder / "b.log", good.substr(0, good.size() - 1))).error);  // whole, but for the line break
}

TEST(Carmen, ignores_what_it_does_not_know_and_carriage_returns) {
  const TemporaryFolder folder;
  const auto reading = read_all(write_bytes(
      folder / "a.log", "# CARMEN log\r\n\r\nNEFF 3\r\nTRUEPOS 1 2 3\r\nFLASER 1 2.0 0 0 0 0 0 0 1.0 r 1.0\r\n"));
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_EQ(kinds(reading.records), "s");
  EXPECT_THAT(read_all(write_bytes(folder / "none.log", "# CARMEN log\nNEFF 3\n")).error,
              IsError(ErrorCode::kBadInput, "no observations"));
}

}  // namespace
}  // namespace mapweave::rawlog
