#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/evaluation/trajectory_file.h>
#include <support/temporary_folder.h>

namespace mapweave::evaluation {
namespace {

using ::testing::HasSubstr;

const Pose3 kTurned{{1.0, 2.0, 3.0}, Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5)};

void expect_near(const Pose3& pose, const Pose3& expected) {
  EXPECT_NEAR((pose.t - expected.t).norm(), 0.0, 1e-9);
  EXPECT_NEAR(pose.q.angularDistance(expected.q), 0.0, 1e-7);
}

std::string complaint_about(const std::string& text, const std::string& times = {}) {
  try {
    parse_trajectory(text, "t.txt", times);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    return error.what();
  }
  return "no complaint";
}

TEST(TrajectoryFile, is_read_in_the_form_of_every_data_set) {
  const TrajectoryFile tum = parse_trajectory("# stamps\n1.5 1 2 3 -0.5 0.5 -0.5 0.5\n", "t");
  EXPECT_EQ(tum.format, TrajectoryFormat::tum);
  const TrajectoryFile euroc = parse_trajectory(
      "#timestamp, p_RS_R_x [m], ...\r\n1500000000,1,2,3,0.5,-0.5,0.5,-0.5,0,0,0,1e-3,0,0,0,0,0\r\n", "t");
  EXPECT_EQ(euroc.format, TrajectoryFormat::euroc);
  const TrajectoryFile kitti = parse_trajectory("0 0 1 1 -1 0 0 2 0 -1 0 3\n", "t", "1.5\n");
  EXPECT_EQ(kitti.format, TrajectoryFormat::kitti);
  EXPECT_TRUE(kitti.has_stamps);
  for (const TrajectoryFile* file : {&tum, &euroc, &kitti}) {
    ASSERT_EQ(file->trajectory.size(), 1u);
    EXPECT_EQ(file->trajectory[0].stamp.ns, 1500000000);
    expect_near(file->trajectory[0].pose, kTurned);
  }
  for (const char* text : {"# by hand\n2 1 -2 0.5\n", "2,1,-2,0.5\n"}) {
    const TrajectoryFile planar = parse_trajectory(text, "t");
    EXPECT_EQ(planar.format, TrajectoryFormat::planar);
    expect_near(planar.trajectory.at(0).pose, spatial(Pose2(1.0, -2.0, 0.5)));
  }
}

TEST(TrajectoryFile, of_kitti_without_times_counts_its_poses) {
  const TrajectoryFile kitti = parse_trajectory("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n", "t");
  EXPECT_FALSE(kitti.has_stamps);
  EXPECT_EQ(kitti.trajectory.at(1).stamp.ns, 1000000000);
}

TEST(TrajectoryFile, of_kitti_finds_its_times_where_the_data_set_has_them) {
  const test::TemporaryFolder folder;
  std::filesystem::create_directories(folder / "poses");
  std::filesystem::create_directories(folder / "sequences/06");
  write_file(folder / "poses/06.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n");
  EXPECT_FALSE(read_trajectory(folder / "poses/06.txt").has_stamps);
  write_file(folder / "sequences/06/times.txt", "4.000000e+00\n");
  EXPECT_EQ(read_trajectory(folder / "poses/06.txt").trajectory.at(0).stamp.ns, 4000000000);
  write_file(folder / "others.txt", "5\n");
  EXPECT_EQ(read_trajectory(folder / "poses/06.txt", folder / "others.txt").trajectory.at(0).stamp.ns, 5000000000);
}

TEST(TrajectoryFile, that_is_none_is_refused_with_line_and_forms) {
  EXPECT_THAT(complaint_about("1 2 3\n"), HasSubstr("KITTI (12 numbers"));
  EXPECT_THAT(complaint_about("1,2,3\n"), HasSubstr("lines of 3 numbers"));
  EXPECT_THAT(complaint_about(""), HasSubstr("no pose"));
  EXPECT_THAT(complaint_about("0 0 1 1 -1 0 0 2 0 1 0 3\n", "1\n"), HasSubstr("no rotation"));
  EXPECT_THAT(complaint_about("1 0 0 0 0 1 0 0 0 0 1 0\n", "1\n2\n"), HasSubstr("1 poses for 2 times"));
  EXPECT_THAT(complaint_about("1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0 0 1 0 0 0 0 1 1\n", "1\n"), HasSubstr("t.txt:2"));
  EXPECT_THAT(complaint_about("1.5,1,2,3,0.5,-0.5,0.5,-0.5\n"), HasSubstr("nanoseconds"));
  EXPECT_THAT(complaint_about("15,1,2,3,0.5,-0.5,0.5,0.7\n"), HasSubstr("quaternion"));
  EXPECT_THAT(complaint_about("2 1 1 1\n2 1 1 1\n"), HasSubstr("t.txt:2"));
  EXPECT_THAT(complaint_about("2 1 1 nan\n"), HasSubstr("not"));
}

}  // namespace
}  // namespace mapweave::evaluation
