// Recordings that are read while they are written.

#include "bags.h"

#include <mapweave/core/log.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/rawlog/rawlog_writer.h>
#include <mapweave/rawlog/ros_recorder.h>
#include <ros/mcap_reader.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <future>
#include <thread>

namespace mapweave::rawlog {
namespace {

using test::TemporaryFolder;
using ::testing::HasSubstr;

const std::vector<RecordedTopic> kTopics = {{"/a/scan", "sensor_msgs/LaserScan", "float32[] ranges"},
                                            {"/a/odom", "nav_msgs/Odometry", ""}};

std::vector<BagEntry> drive(int scans) {
  std::vector<BagEntry> entries;
  for (int i = 0; i < scans; ++i) {
    entries.push_back(bag_odometry(0.1 * i, 0.01 * i, 0.0, 0.0, "/a/odom"));
    entries.push_back(bag_scan(0.1 * i));
  }
  return entries;
}

void add(RosRecorder& recorder, const BagEntry& entry) {
  recorder.add(entry.type == kTopics[0].type ? 0 : 1, stamp_from_seconds(entry.received_s).ns, entry.data);
}

ReadOptions without_transforms(bool follow) {
  ReadOptions options;
  options.use_tf = false;
  options.follow = follow;
  return options;
}

std::size_t count_of(ObservationStream& stream) {
  std::size_t count = 0;
  while (stream.next()) ++count;
  return count;
}

TEST(RosRecorder, what_it_writes_is_read_while_it_grows) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "robot" / "a.mcap";
  RosRecorder recorder(path, kTopics);
  std::atomic<std::size_t> read = 0;
  std::thread reader([&] {
    const auto stream = open_log(path, without_transforms(true));
    while (stream->next()) ++read;
  });
  const auto entries = drive(100);
  for (const BagEntry& entry : entries) add(recorder, entry);
  // Only the newest of each topic waits for the other one's next, not all of the window of 0.5 s.
  for (int i = 0; i < 2000 && read < entries.size() - 2; ++i) std::this_thread::sleep_for(std::chrono::milliseconds(5));
  EXPECT_GE(read, entries.size() - 2);
  EXPECT_LT(read, entries.size());
  recorder.finish();
  reader.join();
  EXPECT_EQ(read, entries.size());
  EXPECT_EQ(count_of(*open_log(path, without_transforms(false))), entries.size());
  EXPECT_EQ(ros::open_mcap(path)->topics().at(1).name, "/a/odom");
}

TEST(RosRecorder, a_recording_that_grows_slowly_is_read_from_its_first_message_on) {
  const TemporaryFolder folder;
  RosRecorder recorder(folder.path() / "a.mcap", kTopics);
  for (const BagEntry& entry : drive(40)) add(recorder, entry);
  ASSERT_LT(std::filesystem::file_size(recorder.path()), 60'000u);
  auto first = std::async(std::launch::async,
                          [&] { return open_log(recorder.path(), without_transforms(true))->next().has_value(); });
  EXPECT_EQ(first.wait_for(std::chrono::seconds(30)), std::future_status::ready);
  recorder.finish();
  EXPECT_TRUE(first.get());
}

TEST(GrowingLog, of_any_format_that_is_read_once_is_read_while_it_grows) {
  const TemporaryFolder folder;
  const auto whole = folder.path() / "whole.rawlog", path = folder.path() / "growing.rawlog";
  {
    RawlogWriter writer(whole);
    for (int i = 0; i < 60; ++i) writer.add(*scan(0.1 * i));
    writer.close();
  }
  std::ifstream file(whole, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(file), {}};
  GrowingLog log(path, GrowingLog::Begin::new_file);
  constexpr std::size_t kFirst = 500, kStep = 77;
  log.add(bytes.substr(0, kFirst));
  std::atomic<std::size_t> read = 0;
  std::thread reader([&] {
    ReadOptions options;
    options.follow = true;
    const auto stream = open_log(path, options);
    while (stream->next()) ++read;
  });
  for (std::size_t at = kFirst; at < bytes.size(); at += kStep) log.add(std::string_view(bytes).substr(at, kStep));
  log.finish();
  reader.join();
  EXPECT_EQ(read, 60U);
}

// It did not wait for a topic that had not begun.
TEST(GrowingLog, leaves_out_the_first_records_of_a_topic_that_begins_late_and_behind_the_others) {
  const TemporaryFolder folder;
  const auto whole = folder.path() / "whole.rawlog", path = folder.path() / "growing.rawlog";
  {
    RawlogWriter writer(whole);
    for (int i = 0; i < 100; ++i) {
      writer.add(*scan(0.1 * i));
      if (i >= 80) writer.add(*odometry(0.1 * i - 0.25));
    }
    writer.close();
  }
  std::ifstream file(whole, std::ios::binary);
  GrowingLog log(path, GrowingLog::Begin::new_file);
  log.add(std::string{std::istreambuf_iterator<char>(file), {}});
  log.finish();
  const auto read = [&](const auto& recording, bool follow) {
    ReadOptions options;
    options.follow = follow;
    std::vector<std::int64_t> stamps;
    const auto stream = open_log(recording, options);
    while (const auto record = stream->next()) stamps.push_back(record->stamp.ns);
    EXPECT_TRUE(std::is_sorted(stamps.begin(), stamps.end()));
    return stamps.size();
  };
  EXPECT_EQ(read(whole, false), 120U);
  EXPECT_EQ(read(path, true), 117U) << "7.75, 7.85 and 7.95 s came after the scan of 8.0 s had been read";
}

TEST(RosRecorder, a_reader_that_does_not_follow_ends_where_the_recording_is) {
  const TemporaryFolder folder;
  RosRecorder recorder(folder.path() / "a.mcap", kTopics);
  for (const BagEntry& entry : drive(3)) add(recorder, entry);
  EXPECT_EQ(count_of(*open_log(recorder.path(), without_transforms(false))), 6U);
}

TEST(RosRecorder, a_recorder_that_is_gone_is_not_waited_for) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "a.mcap";
  {
    RosRecorder recorder(path, kTopics);
    for (const BagEntry& entry : drive(3)) add(recorder, entry);
  }
  EXPECT_EQ(count_of(*open_log(path, without_transforms(true))), 6U);
}

// Killed at any byte behind its beginning.
TEST(RosRecorder, goes_on_behind_its_last_whole_message) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "a.mcap", cut = folder.path() / "cut.mcap";
  const auto entries = drive(3);
  std::uint64_t beginning = 0;
  {
    RosRecorder recorder(path, kTopics);
    beginning = std::filesystem::file_size(path);
    for (const BagEntry& entry : entries) add(recorder, entry);
  }
  constexpr std::uint64_t kStep = 7;
  for (std::uint64_t bytes = std::filesystem::file_size(path); bytes >= beginning; bytes -= kStep) {
    std::filesystem::copy_file(path, cut, std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(cut, bytes);
    {
      RosRecorder again(cut);
      ASSERT_EQ(again.topics().size(), 2U);
      EXPECT_EQ(again.topics()[0].name, "/a/scan");
      add(again, bag_scan(1.0));
      again.finish();
    }
    const auto bag = ros::open_mcap(cut);
    ros::BagMessage message;
    std::size_t count = 0;
    while (bag->next(message)) {
      const std::string data(reinterpret_cast<const char*>(message.data.data()), message.data.size());
      if (count < entries.size() && message.received_ns != stamp_from_seconds(1.0).ns) {
        EXPECT_EQ(data, entries[count].data);
      }
      ++count;
    }
    EXPECT_EQ(message.received_ns, stamp_from_seconds(1.0).ns);
    EXPECT_GE(count, 1U);
    if (bytes == std::filesystem::file_size(path)) {
      EXPECT_EQ(count, entries.size() + 1);
    }
  }
}

TEST(RosRecorder, knows_its_newest_stamps_and_its_end_when_it_goes_on) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "a.mcap";
  const std::vector<RecordedTopic> topics = {
      kTopics[0], kTopics[1], {"/tf", "tf2_msgs/TFMessage", ""}, {"/late/odom", "nav_msgs/Odometry", ""}};
  {
    RosRecorder recorder(path, topics);
    EXPECT_EQ(recorder.newest_ns(0), std::nullopt);
    for (const double seconds : {1.0, 2.5, 2.0}) add(recorder, bag_scan(seconds));
    EXPECT_EQ(recorder.newest_ns(0), stamp_from_seconds(2.5).ns);
    add(recorder, bag_odometry(1.5, 0.0, 0.0, 0.0, "/a/odom"));
    recorder.add(2, 7, bag_scan(9.0).data);  // whatever stands there
  }
  for (const bool was_finished : {false, true}) {
    RosRecorder again(path);
    EXPECT_EQ(again.is_finished(), was_finished);
    EXPECT_EQ(again.newest_ns(0), stamp_from_seconds(2.5).ns);
    EXPECT_EQ(again.newest_ns(1), stamp_from_seconds(1.5).ns);
    EXPECT_EQ(again.newest_ns(2), std::nullopt);
    EXPECT_EQ(again.newest_ns(3), std::nullopt);
    const auto bytes = std::filesystem::file_size(path);
    if (was_finished) add(again, bag_scan(3.0));
    again.finish();
    EXPECT_EQ(std::filesystem::file_size(path) == bytes, was_finished);
  }
}

TEST(RosRecorder, refuses_what_it_cannot_go_on_with) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "a.mcap";
  RosRecorder recorder(path, kTopics);
  EXPECT_THROW(RosRecorder(path, kTopics), Error) << "it is there";
  EXPECT_THROW(RosRecorder{path}, Error) << "it is being written";
  recorder.finish();
  recorder.finish();
  add(recorder, bag_scan(1.0));  // too late
  EXPECT_TRUE(recorder.is_finished());
  const auto message_of = [](const std::filesystem::path& file) -> std::string {
    try {
      RosRecorder again(file);
    } catch (const Error& error) {
      return error.what();
    }
    return "nothing";
  };
  EXPECT_THAT(message_of(folder.path() / "none.mcap"), HasSubstr("there is no recording"));
  std::ofstream(folder.path() / "text.mcap") << "not a recording at all";
  EXPECT_THAT(message_of(folder.path() / "text.mcap"), HasSubstr("no MCAP"));
  std::filesystem::copy_file(test::own_data("ros2/no_summary.mcap"), folder.path() / "others.mcap");
  EXPECT_THAT(message_of(folder.path() / "others.mcap"), HasSubstr("another program"));
}

}  // namespace
}  // namespace mapweave::rawlog
