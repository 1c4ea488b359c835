#include "logs.h"

#include <mapweave/rawlog/contents.h>

namespace mapweave::rawlog {
namespace {

using test::own_data;
using test::TemporaryFolder;

TEST(Contents, counts_what_each_sensor_gave) {
  const TemporaryFolder folder;
  const auto log = write_rawlog(folder / "a.rawlog", {odometry(1.0, 0.0), scan(1.0), odometry(2.0, 3.0, 4.0), scan(2.0),
                                                      odometry(5.0, 3.0, 5.0)});
  const auto contents = summarize_log(log);
  EXPECT_EQ(contents.format, "MRPT rawlog");
  EXPECT_EQ(contents.observations, 5u);
  EXPECT_EQ(contents.scans, 2u);
  EXPECT_TRUE(contents.has_laser());
  EXPECT_DOUBLE_EQ(contents.duration_s, 4.0);
  EXPECT_NEAR(contents.odometry_length_m, 6.0, 1e-9);
  ASSERT_EQ(contents.sensors.size(), 2u);
  EXPECT_EQ(contents.sensors[0].label, "LASER");
  EXPECT_EQ(contents.sensors[0].class_name, "CObservation2DRangeScan");
  EXPECT_DOUBLE_EQ(contents.sensors[0].rate_hz, 1.0);
  ASSERT_EQ(contents.sensors[0].geometries.size(), 1u);
  EXPECT_EQ(contents.sensors[0].geometries[0].rays, 5u);
  EXPECT_EQ(contents.sensors[0].geometries[0].scans, 2u);
  EXPECT_EQ(contents.sensors[1].count, 3u);
  EXPECT_DOUBLE_EQ(contents.sensors[1].longest_gap_s, 3.0);
}

TEST(Contents, distinguishes_lasers_of_two_geometries) {
  const TemporaryFolder folder;
  const auto contents =
      summarize_log(write_rawlog(folder / "a.rawlog", {scan(1.0, {1.0f, 1.0f}), scan(2.0), scan(3.0)}));
  ASSERT_EQ(contents.sensors.size(), 1u);
  ASSERT_EQ(contents.sensors[0].geometries.size(), 2u);
  EXPECT_EQ(contents.sensors[0].geometries[0].rays, 5u);  // the most frequent first
}

TEST(Contents, says_that_there_is_no_laser) {
  const TemporaryFolder folder;
  EXPECT_FALSE(summarize_log(write_rawlog(folder / "a.rawlog", {odometry(1.0)})).has_laser());
}

TEST(Contents, names_the_format) {
  EXPECT_EQ(format_of_log(own_data("carmen_old.log")), "CARMEN log");
  EXPECT_EQ(format_of_log(own_data("g2o_scans.g2o")), "g2o");
  EXPECT_EQ(format_of_log(own_data("rawlog_pairs.rawlog")), "MRPT rawlog");
}

}  // namespace
}  // namespace mapweave::rawlog
