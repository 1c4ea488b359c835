// A ROS 1 bag in parts, as `rosbag record --split` writes them.

#include "bags.h"

#include <mapweave/core/progress.h>
#include <mapweave/rawlog/contents.h>
#include <mapweave/rawlog/split.h>

namespace mapweave::rawlog {
namespace {

using test::TemporaryFolder;
using ::testing::HasSubstr;
using ::testing::Not;

// Of a drive that is cut into `count` parts, each with connections of its own numbers, and transforms in the first.
std::vector<std::vector<BagEntry>> parts_of(const std::vector<BagEntry>& whole, std::size_t count) {
  std::vector<std::vector<BagEntry>> parts(count);
  for (std::size_t i = 0; i < whole.size(); ++i) parts[i * count / whole.size()].push_back(whole[i]);
  return parts;
}

std::string values_of(const Reading& reading) {
  std::string values;
  for (const Record& record : reading.records) values += serialized(*record.observation);
  return values;
}

class Ros1Folder : public ::testing::Test {
 protected:
  // Parts of the numbers, of a drive of as many parts as the largest of them says.
  void write(const std::vector<int>& numbers, const std::string& name = "office_") {
    const auto parts = parts_of(small_drive(), static_cast<std::size_t>(numbers.back()) + 1);
    for (const int number : numbers)
      write_bag(folder_ / (name + std::to_string(number) + ".bag"), parts[static_cast<std::size_t>(number)]);
  }
  std::string said_at_reading() {
    testing::internal::CaptureStderr();
    reading_ = read_all(folder_.path());
    return testing::internal::GetCapturedStderr();
  }

  TemporaryFolder folder_;
  Reading reading_;
};

TEST_F(Ros1Folder, reads_as_the_bag_that_was_not_split) {
  const TemporaryFolder other;
  const auto whole = read_all(write_bag(other / "whole.bag", small_drive()));
  write({0, 1, 2});
  EXPECT_EQ(said_at_reading(), "");
  ASSERT_FALSE(reading_.error) << reading_.error->what();
  EXPECT_EQ(values_of(reading_), values_of(whole));
  EXPECT_EQ(format_of_log(folder_.path()), "folder of a ROS 1 bag");
  EXPECT_FALSE(is_picture_folder(folder_.path()));
}

TEST_F(Ros1Folder, orders_parts_by_number_whatever_time_stands_before_it) {
  const auto parts = parts_of(small_drive(12), 12);
  for (std::size_t i = 0; i < parts.size(); ++i)
    write_bag(folder_ / ("2026-01-02-03-04-" + std::to_string(59 - i) + "_" + std::to_string(i) + ".bag"), parts[i]);
  EXPECT_EQ(said_at_reading(), "");
  ASSERT_FALSE(reading_.error) << reading_.error->what();
  EXPECT_EQ(reading_.records.size(), 24U);
}

TEST_F(Ros1Folder, merges_topics_and_counts_of_all_parts) {
  write({0, 1, 2});
  write_bag(folder_ / "office_3.bag", {{"/note", "std_msgs/String", 102.0, MessageBytes().text("late").bytes()}});
  const auto contents = summarize_log(folder_.path());
  std::string topics;
  for (const auto& topic : contents.topics)
    topics += topic.name + " " + topic.type + " " + std::to_string(topic.count) + "\n";
  EXPECT_EQ(topics,
            "/note std_msgs/String 1\n/odom nav_msgs/Odometry 10\n/scan sensor_msgs/LaserScan 10\n/tf_static "
            "tf2_msgs/TFMessage 1\n");
}

TEST_F(Ros1Folder, ends_before_a_part_that_is_missing) {
  write({0, 1, 3, 4});
  EXPECT_THAT(said_at_reading(), HasSubstr("part 2 of the recording is missing"));
  ASSERT_TRUE(reading_.error);
  EXPECT_THAT(reading_.error, IsError(ErrorCode::kMissing,
                                      "part 2 of the recording is missing: 'office_3.bag' follows 'office_1.bag'"));
  EXPECT_THAT(reading_.error->remedy(), HasSubstr("--keep-going"));
  EXPECT_EQ(reading_.records.size(), 8U);  // of parts 0 and 1
}

TEST_F(Ros1Folder, names_a_long_gap_by_its_ends) {
  write({0, 1});
  write_bag(folder_ / "office_99999.bag", small_drive());
  said_at_reading();
  ASSERT_TRUE(reading_.error);
  EXPECT_THAT(reading_.error->problem(), HasSubstr("parts 2 to 99998 of the recording are missing"));
}

TEST_F(Ros1Folder, begins_where_the_recorder_kept_the_last_parts) {
  write({2, 3});
  const auto parts = parts_of(small_drive(), 4);
  auto begin = parts[2];
  begin.insert(begin.begin(), small_drive().front());  // transforms, which latching repeats
  write_bag(folder_ / "office_2.bag", begin);
  EXPECT_THAT(said_at_reading(), HasSubstr("parts 0 to 1 of the recording are missing"));
  ASSERT_FALSE(reading_.error) << reading_.error->what();
  EXPECT_EQ(reading_.records.size(), 10U);
}

TEST_F(Ros1Folder, takes_the_last_part_of_a_recorder_that_crashed) {
  const auto parts = parts_of(small_drive(), 2);
  write_bag(folder_ / "office_0.bag", parts[0]);
  write_bag(folder_ / "office_1.bag.active", parts[1], {"none", 4, false});
  EXPECT_THAT(said_at_reading(), HasSubstr("office_1.bag.active at byte"));
  ASSERT_FALSE(reading_.error) << reading_.error->what();
  EXPECT_EQ(reading_.records.size(), 20U);
}

TEST_F(Ros1Folder, gives_what_precedes_a_part_that_is_damaged) {
  write({0, 1, 2});
  write_bytes(folder_ / "office_1.bag", "#ROSBAG V2.0\n");
  said_at_reading();
  ASSERT_TRUE(reading_.error);
  EXPECT_THAT(std::string(reading_.error->what()), HasSubstr("office_1.bag"));
  EXPECT_EQ(reading_.records.size(), 6U);
}

TEST_F(Ros1Folder, of_several_recordings_is_refused) {
  write({0, 1});
  write_bag(folder_ / "kitchen_2.bag", small_drive());
  said_at_reading();
  ASSERT_TRUE(reading_.error);
  EXPECT_THAT(reading_.error,
              IsError(ErrorCode::kBadInput, "'office_1.bag' and 'kitchen_2.bag' are of two recordings"));
  std::filesystem::rename(folder_ / "kitchen_2.bag", folder_ / "kitchen.bag");
  said_at_reading();
  ASSERT_TRUE(reading_.error);
  EXPECT_THAT(reading_.error->problem(), HasSubstr("'kitchen.bag' is no part of the recording of 'office_0.bag'"));
  std::filesystem::rename(folder_ / "kitchen.bag", folder_ / "office_2026-01-02-03-04-05_1.bag");
  said_at_reading();
  ASSERT_TRUE(reading_.error);
  EXPECT_THAT(reading_.error->problem(), HasSubstr("are both part 1"));
  EXPECT_TRUE(reading_.records.empty());
}

TEST_F(Ros1Folder, with_one_bag_is_that_bag) {
  write_bag(folder_ / "drive_20260102.bag", small_drive());
  EXPECT_EQ(said_at_reading(), "");
  ASSERT_FALSE(reading_.error) << reading_.error->what();
  EXPECT_EQ(reading_.records.size(), 20U);
  write_bag(folder_ / "drive_20260103.bag", small_drive());  // dates number no parts
  said_at_reading();
  ASSERT_TRUE(reading_.error);
  EXPECT_THAT(reading_.error->problem(), HasSubstr("is no part of the recording"));
}

TEST_F(Ros1Folder, of_pictures_stays_one) {
  for (const char* name : {"rgb.txt", "depth.txt"}) write_bytes(folder_ / name, "# none\n");
  write({0, 1});
  EXPECT_EQ(format_of_log(folder_.path()), "TUM RGB-D folder");
  EXPECT_TRUE(is_picture_folder(folder_.path()));
}

TEST_F(Ros1Folder, is_split_by_namespaces_as_a_bag_is) {
  std::vector<std::vector<BagEntry>> parts = parts_of(small_drive(), 2);
  for (std::size_t i = 0; i < parts.size(); ++i) {
    for (BagEntry& entry : parts[i])
      if (entry.topic != "/tf_static") entry.topic = "/one" + entry.topic;
    write_bag(folder_ / ("team_" + std::to_string(i) + ".bag"), parts[i]);
  }
  const TemporaryFolder out;
  const auto written = split_by_namespace(folder_.path(), out / "logs", {}, *make_silent_progress());
  ASSERT_EQ(written.size(), 1U);
  EXPECT_EQ(written[0].observations, 20U);
}

}  // namespace
}  // namespace mapweave::rawlog
