#include "logs.h"

#include <support/pose_matchers.h>

namespace mapweave::rawlog {
namespace {

using test::IsNear;
using test::own_data;
using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

std::string vertex(int number) { return "VERTEX_SE2 " + std::to_string(number) + " 0 0 0\n"; }
std::string edge(int from, int to, double x) {
  return "EDGE_SE2 " + std::to_string(from) + " " + std::to_string(to) + " " + std::to_string(x) + " 0 0 1 0 0 1 0 1\n";
}
std::string laser(double stamp_s) {
  return "ROBOTLASER1 0 -1.57 3.14 1.57 50.0 0.1 0 3 1 2 3 0 0 0 0 0 0 0 0 0 0 0 0 " + std::to_string(stamp_s) +
         " host " + std::to_string(stamp_s) + "\n";
}

TEST(G2o, chains_the_sequential_edges_to_odometry) {
  const auto reading = read_all(own_data("g2o_scans.g2o"));
  ASSERT_FALSE(reading.error) << reading.error->what();
  ASSERT_EQ(kinds(reading.records), "osos");
  EXPECT_THAT(seconds(reading.records), ElementsAre(200.5, 200.5, 201.5, 201.5));
  EXPECT_THAT(odometry_of(reading.records[0]), IsNear(Pose2(0, 0, 0), 1e-9, 1e-9));  // not the vertex's pose
  EXPECT_THAT(odometry_of(reading.records[2]), IsNear(Pose2(1.0, 2.0, 1.570796), 1e-5, 1e-9));
  const auto& scan = scan_of(reading.records[1]);
  EXPECT_NEAR(ray_angle(scan, 0), -M_PI / 2, 1e-5);
  EXPECT_NEAR(ray_angle(scan, 3), M_PI / 4, 1e-5);
  EXPECT_TRUE(scan.getScanRangeValidity(2));
  EXPECT_FALSE(scan.getScanRangeValidity(3));  // 51.1 of 50
}

TEST(G2o, makes_stamps_where_the_scans_have_none) {
  const TemporaryFolder folder;
  ReadOptions options;
  options.scan_rate_hz = 4.0;
  const auto reading =
      read_all(write_bytes(folder / "a.g2o", vertex(0) + laser(0) + vertex(1) + laser(0) + edge(0, 1, 1.0)), options);
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_THAT(seconds(reading.records), ElementsAre(0.25, 0.25, 0.5, 0.5));
}

TEST(G2o, says_which_edge_is_missing) {
  const TemporaryFolder folder;
  const auto reading = read_all(write_bytes(
      folder / "a.g2o", vertex(0) + laser(1) + vertex(1) + vertex(2) + laser(2) + edge(0, 1, 1.0) + edge(0, 2, 1.0)));
  EXPECT_EQ(kinds(reading.records), "os");
  EXPECT_THAT(reading.error, IsError(ErrorCode::kBadInput, "from vertex 1 to 2"));
  EXPECT_THAT(reading.error->where(), HasSubstr("a.g2o:5"));
}

TEST(G2o, names_the_line_that_is_wrong) {
  const TemporaryFolder folder;
  const auto problem = [&](const std::string& text) { return read_all(write_bytes(folder / "a.g2o", text)).error; };
  EXPECT_THAT(problem(vertex(0) + laser(1) + "EDGE_SE2 0 1 nan 0 0 1 0 0 1 0 1\n"),
              IsError(ErrorCode::kBadInput, "a.g2o:3"));
  EXPECT_THAT(problem(vertex(0) + laser(1) + "EDGE_SE2 0 1 1 0 0 1 0\n"), IsError(ErrorCode::kBadInput, "ends early"));
  EXPECT_THAT(problem(vertex(0) + laser(1) + "EDGE_SE2 0 1 1 0"), IsError(ErrorCode::kCorrupt, "a.g2o:3"));
  EXPECT_THAT(problem("VERTEX_SE2 -1 0 0 0\n"), IsError(ErrorCode::kBadInput, "a.g2o:1"));
  EXPECT_THAT(problem(laser(1) + vertex(0)), IsError(ErrorCode::kBadInput, "before any vertex"));
  EXPECT_THAT(problem(vertex(1) + laser(1) + vertex(0) + laser(2)), IsError(ErrorCode::kBadInput, "rising"));
  EXPECT_THAT(problem(vertex(0) + vertex(1) + edge(0, 1, 1.0)), IsError(ErrorCode::kBadInput, "without ROBOTLASER1"));
}

}  // namespace
}  // namespace mapweave::rawlog
