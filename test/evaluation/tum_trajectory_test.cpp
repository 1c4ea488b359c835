#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/evaluation/tum_trajectory.h>
#include <support/pose_matchers.h>
#include <support/temporary_folder.h>

namespace mapweave::evaluation {
namespace {

using test::IsNear;
using ::testing::HasSubstr;

std::string complaint_about(const std::string& text) {
  try {
    parse_tum(text, "t.tum");
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    return error.what();
  }
  return "no complaint";
}

TEST(ParseTum, reads_poses_between_comments_and_blank_lines) {
  const auto trajectory = parse_tum(
      "# stamp x y z qx qy qz qw\r\n\r\n976052857.337530 1 -2 0.5 0 0 0.7071068 0.7071068\r\n\t976052857.5 +3 0 0 0 0 "
      "0 1 # stood still",
      "t.tum");
  ASSERT_EQ(trajectory.size(), 2u);
  EXPECT_EQ(trajectory[0].stamp.ns, 976052857337530000);
  EXPECT_THAT(planar(trajectory[0].pose), IsNear(Pose2(1.0, -2.0, M_PI / 2), 1e-12, 1e-6));
  EXPECT_DOUBLE_EQ(trajectory[0].pose.t.z(), 0.5);
  EXPECT_NEAR(trajectory[0].pose.q.norm(), 1.0, 1e-15);
  EXPECT_EQ(trajectory[1].stamp.ns, 976052857500000000);
}

TEST(ParseTum, keeps_every_written_digit_of_a_stamp) {
  EXPECT_EQ(parse_tum("1305031102.175304123 0 0 0 0 0 0 1", "t")[0].stamp.ns, 1305031102175304123);
  EXPECT_EQ(parse_tum("-1.5 0 0 0 0 0 0 1", "t")[0].stamp.ns, -1500000000);
  EXPECT_EQ(parse_tum("1.25e3 0 0 0 0 0 0 1", "t")[0].stamp.ns, 1250000000000);
  EXPECT_NEAR(
      static_cast<double>(parse_tum("1305031102.1753041238888 0 0 0 0 0 0 1", "t")[0].stamp.ns - 1305031102175304123),
      0.0, 300.0);
}

TEST(ParseTum, names_the_line_of_what_it_cannot_use) {
  const std::string good = "# header\n1 0 0 0 0 0 0 1\n";
  EXPECT_THAT(complaint_about(good + "2 0 0 0 0 0 1\n3 0 0 0 0 0 0 1\n"),
              HasSubstr("t.tum:3: a line has 8 numbers (stamp x y z qx qy qz qw), this one has 7"));
  EXPECT_THAT(complaint_about(good + "2 0 0 0 0 0 0 1 9\n"), HasSubstr("this one has 9"));
  EXPECT_THAT(complaint_about(good + "2 0 zero 0 0 0 0 1\n"), HasSubstr("t.tum:3: 'zero' in column 3 is not a number"));
  EXPECT_THAT(complaint_about(good + "2 0 nan 0 0 0 0 1\n"), HasSubstr("'nan' in column 3 is not finite"));
  EXPECT_THAT(complaint_about(good + "2 0 0 -inf 0 0 0 1\n"), HasSubstr("'-inf' in column 4 is not finite"));
  EXPECT_THAT(complaint_about(good + "2 0 0 1e999 0 0 0 1\n"), HasSubstr("'1e999' in column 4 is not a number"));
  EXPECT_THAT(complaint_about(good + "2 0 0 0x1p3 0 0 0 1\n"), HasSubstr("not a number"));
  EXPECT_THAT(complaint_about(good + "1305031102175304000 0 0 0 0 0 0 1\n"),
              HasSubstr("in seconds, not in nanoseconds"));
  EXPECT_THAT(complaint_about(good + "nan 0 0 0 0 0 0 1\n"), HasSubstr("t.tum:3"));
}

TEST(ParseTum, refuses_quaternions_that_turn_nothing) {
  EXPECT_THAT(complaint_about("1 0 0 0 0 0 0 0\n"), HasSubstr("t.tum:1: the quaternion's length is 0.0"));
  EXPECT_THAT(complaint_about("1 0 0 0 0 0 0.5 0.5\n"), HasSubstr("must be 1"));
  EXPECT_THAT(complaint_about("1 0 0 0 1e200 0 0 1e200\n"), HasSubstr("must be 1"));
}

TEST(ParseTum, refuses_stamps_that_do_not_increase) {
  EXPECT_THAT(complaint_about("2 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1\n"), HasSubstr("t.tum:2: the stamp is not later"));
  EXPECT_THAT(complaint_about("2 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n"), HasSubstr("sort the file"));
}

TEST(ParseTum, refuses_a_file_without_poses) {
  EXPECT_THAT(complaint_about(""), HasSubstr("t.tum: no pose in it"));
  EXPECT_THAT(complaint_about("# stamp x y z qx qy qz qw\n"), HasSubstr("no pose in it"));
}

TEST(ParseTum, says_that_a_file_cut_in_its_last_line_is_cut) {
  EXPECT_THAT(complaint_about("1 0 0 0 0 0 0 1\n2 0 0"), HasSubstr("cut short"));
}

TEST(ParseTum, cut_or_damaged_at_any_byte_gives_a_trajectory_or_an_error) {
  const std::string whole = "# x\n1.5 1 2 3 0 0 0 1\n2.5 1 2 3 0.5 0.5 0.5 -0.5\n";
  for (std::size_t i = 0; i < whole.size(); ++i) {
    for (const char c : {'\0', '\n', '#', ' ', '9', '-', '\xff'}) {
      std::string damaged = whole;
      damaged[i] = c;
      try {
        EXPECT_FALSE(parse_tum(damaged, "t.tum").empty());
      } catch (const Error&) {}
    }
    try {
      EXPECT_FALSE(parse_tum(std::string_view(whole).substr(0, i), "t.tum").empty());
    } catch (const Error&) {}
  }
}

TEST(ParseTum, shows_no_raw_bytes_of_a_binary_file) {
  const std::string message = complaint_about("1 2 \x01\x1b[31mred 4 5 6 7 8\n");
  EXPECT_EQ(message.find('\x1b'), std::string::npos);
  EXPECT_THAT(message, HasSubstr("'??[31mred'"));
}

TEST(ReadTum, names_a_file_that_is_not_there) {
  const test::TemporaryFolder folder;
  try {
    read_tum(folder / "absent.tum");
    FAIL() << "read a file that is not there";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kMissing);
    EXPECT_THAT(error.what(), HasSubstr("absent.tum"));
  }
}

}  // namespace
}  // namespace mapweave::evaluation
