// Recordings of ROS, read back by rawlog's reader. What rosbags and mcap read: test/scenarios/ros_export_test.py.

#include "small_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/exporters/ros_recording.h>
#include <ros/mcap_reader.h>
#include <ros/message_reader.h>
#include <support/temporary_folder.h>

#include <map>

namespace mapweave::exporters {
namespace {

using rawlog::ros::BagMessage;
using rawlog::ros::MessageReader;
using test::add_pose;
using test::drawn_grid;
using test::node_id;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr std::int64_t kStart_ns = 1'700'000'000'000'000'000;

Pose3 pose(double x, double y) { return spatial(Pose2(x, y, 0.5)); }

struct Recorded {
  std::map<std::string, std::vector<BagMessage>> messages;  // by topic
  std::map<std::string, std::string> types;
};

Recorded read_back(const std::string& mcap) {
  const test::TemporaryFolder folder;
  write_file(folder / "map.mcap", mcap);
  const auto bag = rawlog::ros::open_mcap(folder / "map.mcap");
  Recorded recorded;
  std::int64_t before = 0;
  for (BagMessage message; bag->next(message);) {
    EXPECT_GE(message.received_ns, before);
    before = message.received_ns;
    const auto& topic = bag->topics().at(message.topic);
    recorded.types[topic.name] = topic.type;
    recorded.messages[topic.name].push_back(message);
  }
  for (const auto& topic : bag->topics()) EXPECT_EQ(topic.messages, recorded.messages[topic.name].size()) << topic.name;
  return recorded;
}
MessageReader fields_of(const BagMessage& message) { return {message.data, rawlog::ros::MessageEncoding::cdr}; }

Map two_robots() {
  Map map;
  map.id = MapId("team");
  for (std::uint32_t i = 0; i < 3; ++i) {
    add_pose(map, node_id("alpha", i), kStart_ns + i * 1'000'000'000, pose(1.0 + i, 2.0));
    add_pose(map, node_id("be-ta", i), kStart_ns + 500'000'000 + i * 1'000'000'000, pose(-1.0 - i, 0.0));
  }
  return map;
}

std::vector<std::string> names_of(const Recorded& recorded) {
  std::vector<std::string> names;
  for (const auto& [name, type] : recorded.types) names.push_back(name + " " + type);
  return names;
}

TEST(RosRecording, holds_grid_points_paths_and_transforms) {
  const Map map = two_robots();
  const OccupancyGrid grid = drawn_grid({"#. ", "..#"}, 0.1, -3.0, 4.0);
  const Recorded recorded = read_back(ros2_mcap_bytes({{&map, &grid, {{{1.0f, 2.0f, 3.0f}, 0x102030}}}}));
  EXPECT_THAT(names_of(recorded), ElementsAre("/alpha/path nav_msgs/Path", "/be_ta/path nav_msgs/Path",
                                              "/map nav_msgs/OccupancyGrid", "/points sensor_msgs/PointCloud2",
                                              "/tf tf2_msgs/TFMessage", "/tf_static tf2_msgs/TFMessage"));
  MessageReader fields = fields_of(recorded.messages.at("/map").front());
  const auto header = fields.header();
  EXPECT_EQ(header.stamp_ns, kStart_ns);
  EXPECT_EQ(header.frame_id, "map");
  EXPECT_EQ(fields.time_ns(), kStart_ns);
  EXPECT_EQ(fields.read<float>(), 0.1f);
  EXPECT_EQ(fields.read<std::uint32_t>(), 3U);
  EXPECT_EQ(fields.read<std::uint32_t>(), 2U);
  EXPECT_EQ((fields.array<double, 7>()), (std::array{-3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 1.0}));
  EXPECT_THAT(fields.sequence<std::int8_t>(), ElementsAre(0, 0, 100, 100, 0, -1)) << "from the lowest row up";
  EXPECT_EQ(fields.left(), 0U);
}

TEST(RosRecording, a_robot_s_poses_are_seen_from_where_it_stood_first) {
  const Map map = two_robots();
  const Recorded recorded = read_back(ros2_mcap_bytes({{&map, nullptr, {}}}));
  std::vector<std::string> moves;
  for (const BagMessage& message : recorded.messages.at("/tf")) {
    MessageReader fields = fields_of(message);
    EXPECT_EQ(fields.count(), 1U);
    const auto header = fields.header();
    EXPECT_EQ(header.stamp_ns, message.received_ns);
    moves.push_back(std::string(header.frame_id) + " -> " + std::string(fields.string()));
    const auto place = fields.array<double, 3>();
    const double moved = static_cast<double>((header.stamp_ns - kStart_ns) / 1'000'000'000);
    EXPECT_NEAR(std::hypot(place[0], place[1]), moved, 1e-9);
  }
  EXPECT_THAT(moves, ElementsAre("alpha/map -> alpha/base_link", "be_ta/map -> be_ta/base_link",
                                 "alpha/map -> alpha/base_link", "be_ta/map -> be_ta/base_link",
                                 "alpha/map -> alpha/base_link", "be_ta/map -> be_ta/base_link"));
  MessageReader fields = fields_of(recorded.messages.at("/tf_static").front());
  EXPECT_EQ(fields.count(), 2U);
  EXPECT_EQ(fields.header().frame_id, "map");
  EXPECT_EQ(fields.string(), "alpha/map");
  EXPECT_EQ((fields.array<double, 3>()), (std::array{1.0, 2.0, 0.0}));
}

TEST(RosRecording, several_maps_have_frames_of_their_own) {
  Map one, other;
  one.id = MapId("team-1");
  other.id = MapId("7");
  add_pose(one, node_id("map", 0), kStart_ns, pose(0.0, 0.0));
  add_pose(other, node_id("map!", 0), kStart_ns, pose(0.0, 0.0));
  const OccupancyGrid grid = drawn_grid({"#."});
  const Recorded recorded = read_back(ros2_mcap_bytes({{&one, &grid, {}}, {&other, &grid, {}}}));
  EXPECT_THAT(names_of(recorded),
              ElementsAre("/map_/path nav_msgs/Path", "/map_2/path nav_msgs/Path",
                          "/maps/r7/map nav_msgs/OccupancyGrid", "/maps/team_1/map nav_msgs/OccupancyGrid",
                          "/tf tf2_msgs/TFMessage", "/tf_static tf2_msgs/TFMessage"));
  EXPECT_EQ(fields_of(recorded.messages.at("/maps/team_1/map").front()).header().frame_id, "maps/team_1/map");
}

TEST(RosRecording, long_ones_are_cut_into_chunks) {
  Map map;
  map.id = MapId("alpha");
  for (std::uint32_t i = 0; i < 20000; ++i)
    add_pose(map, node_id("alpha", i), kStart_ns + i * 100'000'000LL, pose(0.001 * i, 0.0));
  const std::string mcap = ros2_mcap_bytes({{&map, nullptr, {}}});
  EXPECT_EQ(read_back(mcap).messages.at("/tf").size(), 20000U);
  std::size_t chunks = 0;
  const std::string bag = ros1_bag_bytes({{&map, nullptr, {}}});
  for (std::size_t place = 0; (place = bag.find("compression=none", place)) != std::string::npos; ++place) ++chunks;
  EXPECT_GT(chunks, 2U);
}

TEST(RosRecording, stamps_that_messages_cannot_hold_are_an_error) {
  const auto error_of = [](std::int64_t stamp_ns, auto&& make) -> std::string {
    Map map;
    map.id = MapId("alpha");
    add_pose(map, node_id("alpha", 0), stamp_ns, pose(0.0, 0.0));
    try {
      make({RecordedMap{&map, nullptr, {}}});
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  const std::int64_t of_2050 = 2'524'608'000'000'000'000;
  EXPECT_THAT(error_of(-1'000'000'000, ros1_bag_bytes), HasSubstr("a stamp of -1 s"));
  EXPECT_THAT(error_of(-1'000'000'000, ros2_mcap_bytes), HasSubstr("a stamp of -1 s"));
  EXPECT_THAT(error_of(of_2050, ros2_mcap_bytes), HasSubstr("0 to 2147483647 s after 1970"));
  EXPECT_EQ(error_of(of_2050, ros1_bag_bytes), "");
  EXPECT_EQ(error_of(0, ros1_bag_bytes), "") << "simulated time begins there";
}

}  // namespace
}  // namespace mapweave::exporters
