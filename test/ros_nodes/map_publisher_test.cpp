// What subscribers get, over a master of ROS. Roscpp begins once in a process: ctest gives each test one of its own.
#include "ros_master.h"

#include <diagnostics_publisher.h>
#include <exporters/small_map.h>
#include <gmock/gmock.h>
#include <map_publisher.h>
#include <robot_map.h>
#include <robot_maps_publisher.h>
#include <robot_topics.h>
#include <ros_messages.h>

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <nav_msgs/Odometry.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/LaserScan.h>
#include <tf2_ros/buffer.h>
#include <tf2_ros/transform_broadcaster.h>
#include <tf2_ros/transform_listener.h>
#include <nlohmann/json.hpp>

#include <atomic>
#include <mutex>
#include <utility>

namespace mapweave::ros_nodes {
namespace {

using test::add_pose;
using test::cross_scan;
using test::eventually;
using test::node_id;
using ::testing::HasSubstr;

Pose3 pose(double x, double y, double phi = 0.0) { return spatial(Pose2(x, y, phi)); }

std::function<std::optional<std::string>()> named(const std::string& topic) {
  return [topic] { return topic; };
}

// The messages of a topic.
template <class Message>
class Inbox {
 public:
  Inbox(ros::NodeHandle node, const std::string& topic)
      : subscriber_(node.subscribe<Message>(topic, 100, [this](const typename Message::ConstPtr& message) {
          const std::lock_guard lock(mutex_);
          messages_.push_back(*message);
        })) {}
  std::vector<Message> all() const {
    const std::lock_guard lock(mutex_);
    return messages_;
  }
  std::size_t size() const { return all().size(); }

 private:
  mutable std::mutex mutex_;
  std::vector<Message> messages_;
  ros::Subscriber subscriber_;
};

// A tier's publisher, and that of its robots' own maps, which are what the preview has of them.
class Publishers {
 public:
  Publishers(ros::NodeHandle node, MapPublisherOptions tier, const RobotMapsOptions& robots, WorkerPool& pool)
      : tier_(node, RosNames({"alpha", "beta", tier.tier}), tier, pool),
        robots_(
            node, RosNames({"alpha", "beta", tier.tier}), robots, [this](const RobotId&) { return own_; }, pool) {}
  void publish(const std::shared_ptr<const runtime::LivePreview>& preview) {
    own_ = std::shared_ptr<const Map>(preview, preview->parts.empty() ? nullptr : &preview->parts[0].map);
    tier_.publish(preview);
    robots_.publish();
  }
  void publish_robots(std::shared_ptr<const Map> own) {
    own_ = std::move(own);
    robots_.publish();
  }

 private:
  std::shared_ptr<const Map> own_;
  MapPublisher tier_;
  RobotMapsPublisher robots_;
};

class MapPublisherTest : public testing::Test {
 protected:
  void SetUp() override {
    if (std::string(MAPWEAVE_ROSMASTER).empty())
      GTEST_SKIP() << "needs rosmaster, of the Debian package python3-rosmaster";
    master_ = std::make_unique<test::RosMaster>(MAPWEAVE_ROSMASTER);
    ASSERT_TRUE(master_->is_up()) << read_file(master_->folder() / "master.log", 1 << 20);
  }
  void begin() {
    node_ = std::make_unique<ros::NodeHandle>();
    spinner_ = std::make_unique<ros::AsyncSpinner>(2);
    spinner_->start();
  }
  std::unique_ptr<Publishers> publisher(TeamTransforms team = TeamTransforms::above) {
    MapPublisherOptions options;
    options.tier = "edge-1";
    options.team_transforms = team;
    options.robots = {RobotId("alpha"), RobotId("beta")};
    RobotMapsOptions robots;
    robots.robots = {{RobotId("alpha"), named("alpha/odometry"), "alpha/", ""}, {RobotId("beta"), {}, "beta/", ""}};
    return std::make_unique<Publishers>(*node_, options, robots, pool_);
  }
  // Publishes until something holds.
  bool publishing(Publishers& publisher, const std::shared_ptr<const runtime::LivePreview>& preview,
                  const std::function<bool()>& condition) {
    return eventually([&] {
      publisher.publish(preview);
      return condition();
    });
  }

  WorkerPool pool_{1};
  std::unique_ptr<test::RosMaster> master_;
  std::unique_ptr<ros::NodeHandle> node_;
  std::unique_ptr<ros::AsyncSpinner> spinner_;
};

// alpha and beta are one part; alpha's last pose has a scan whose wall ahead is at a distance.
std::shared_ptr<const runtime::LivePreview> preview_at(Stamp newest, double ahead_m = 1.0) {
  auto preview = std::make_shared<runtime::LivePreview>();
  preview->parts.resize(1);
  Map& map = preview->parts[0].map;
  const auto before = [&](double seconds) { return newest.ns - static_cast<std::int64_t>(seconds * 1e9); };
  add_pose(map, node_id("alpha", 0), before(1.0), pose(4, 1, M_PI / 2), cross_scan({3, 2, 2, 2}));
  add_pose(map, node_id("alpha", 1), newest.ns, pose(4, 2, 2.0), cross_scan({ahead_m, 1, 1, 1}));
  add_pose(map, node_id("beta", 0), before(0.9), pose(0, 0), cross_scan({2, 2, 2, 2}));
  add_pose(map, node_id("beta", 1), before(0.2), pose(1, 0, -0.4), cross_scan({2, 2, 2, 2}));
  const Constraint link = planar_constraint({ConstraintKind::between_maps, node_id("beta", 0), node_id("alpha", 0), 0},
                                            Pose2(), Eigen::Matrix3d::Identity());
  map.constraints.set(link.id, link);
  preview->parts[0].part_from_start = {{RobotId("alpha"), pose(4, 1, M_PI / 2)}, {RobotId("beta"), pose(0, 0)}};
  return preview;
}

OccupancyGrid grid_of(const Map& map) {
  WorkerPool pool(1);
  return fusion::compose_grid(map, {}, pool);
}

TEST_F(MapPublisherTest, sends_maps_paths_clouds_and_graphs_to_who_subscribes) {
  begin();
  const auto preview = preview_at({1'700'000'000'000'000'000});
  const auto maps = publisher();
  maps->publish(preview);
  const Inbox<nav_msgs::OccupancyGrid> own(*node_, "alpha/map"), team(*node_, "edge_1/map");
  const Inbox<nav_msgs::Path> path(*node_, "alpha/path");
  const Inbox<sensor_msgs::PointCloud2> cloud(*node_, "edge_1/cloud");
  const Inbox<visualization_msgs::MarkerArray> graph(*node_, "edge_1/graph");
  ASSERT_TRUE(publishing(*maps, preview, [&] {
    return own.size() > 0 && team.size() > 0 && path.size() > 0 && cloud.size() > 0 && graph.size() > 0;
  }));
  const auto alpha = robot_map(*preview, RobotId("alpha"));
  EXPECT_EQ(own.all()[0].data, grid_message(grid_of(alpha->map), "").data);
  EXPECT_EQ(own.all()[0].header.frame_id, "alpha/map");
  EXPECT_LT((ros::Time::now() - own.all()[0].header.stamp).toSec(), 60.0) << "stamped when it was sent";
  const nav_msgs::OccupancyGrid whole = grid_message(grid_of(preview->parts[0].map), "team");
  EXPECT_EQ(team.all()[0].data, whole.data);
  EXPECT_EQ(team.all()[0].info.origin, whole.info.origin);
  EXPECT_EQ(team.all()[0].header.frame_id, "team");
  EXPECT_EQ(path.all()[0].poses.size(), 2u);
  EXPECT_NEAR(path.all()[0].poses[1].pose.position.x, 1.0, 1e-9) << "ahead of where alpha stood first";
  EXPECT_EQ(cloud.all()[0].width, exporters::map_cloud(preview->parts[0].map).size());
  EXPECT_EQ(graph.all()[0].markers.size(), 7u);
  // Nothing changes, nothing is sent; but a new subscriber may get twice what was made for it.
  const auto count = [&] { return own.size() + team.size() + path.size() + cloud.size() + graph.size(); };
  std::size_t before = 0;
  ASSERT_TRUE(eventually([&] {
    const std::size_t last = std::exchange(before, count());
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    return count() == last;
  }));
  for (int i = 0; i < 10; ++i) maps->publish(std::make_shared<runtime::LivePreview>(*preview));
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_EQ(count(), before);
}

TEST_F(MapPublisherTest, who_takes_no_updates_gets_whole_grids) {
  begin();
  const auto maps = publisher();
  const Inbox<nav_msgs::OccupancyGrid> whole(*node_, "alpha/map");
  for (const double ahead_m : {1.5, 1.0}) {
    const auto preview = preview_at({1'500'000'000}, ahead_m);
    const auto expected = grid_message(grid_of(robot_map(*preview, RobotId("alpha"))->map), "").data;
    EXPECT_TRUE(publishing(*maps, preview, [&] { return whole.size() > 0 && whole.all().back().data == expected; }));
  }
}

TEST_F(MapPublisherTest, who_takes_updates_gets_what_changed) {
  begin();
  const auto maps = publisher();
  const Inbox<map_msgs::OccupancyGridUpdate> updates(*node_, "alpha/map_updates");
  const Inbox<nav_msgs::OccupancyGrid> whole(*node_, "alpha/map");
  const auto first = preview_at({1'500'000'000}, 1.5), second = preview_at({1'500'000'000}, 1.0);
  ASSERT_TRUE(publishing(*maps, first, [&] { return whole.size() > 0; }));
  // Whole grids go out until the publisher knows who takes updates.
  auto now = first;
  ASSERT_TRUE(eventually([&] {
    now = now == first ? second : first;
    maps->publish(now);
    return eventually([&] { return updates.size() > 0; }, 0.2);
  }));
  ASSERT_EQ(updates.size(), 1u);
  const std::size_t whole_ones = whole.size();
  const auto grid_in = [&](const auto& preview) {
    return grid_message(grid_of(robot_map(*preview, RobotId("alpha"))->map), "alpha/map");
  };
  nav_msgs::OccupancyGrid grid = grid_in(now == first ? second : first);
  const map_msgs::OccupancyGridUpdate update = updates.all()[0];
  EXPECT_LT(update.data.size(), grid.data.size() / 2);
  for (std::uint32_t y = 0, i = 0; y < update.height; ++y)
    for (std::uint32_t x = 0; x < update.width; ++x)
      grid.data[(static_cast<std::uint32_t>(update.y) + y) * grid.info.width + static_cast<std::uint32_t>(update.x) +
                x] = update.data[i++];
  EXPECT_EQ(grid.data, grid_in(now).data);
  now = now == first ? second : first;
  ASSERT_TRUE(publishing(*maps, now, [&] { return updates.size() == 2; }));
  EXPECT_EQ(whole.size(), whole_ones);

  // Another node comes late, while nothing is published: it gets the grid as it is now, not as it was sent last.
  const std::string file = (master_->folder() / "grid").string();
  test::PythonProcess late({"-c",
                            "import rospy, sys\n"
                            "rospy.init_node('late', disable_rosout=True)\n"
                            "message = rospy.wait_for_message('/alpha/map', rospy.AnyMsg, 30)\n"
                            "open(sys.argv[1], 'wb').write(message._buff)\n",
                            file},
                           master_->folder() / "late.log");
  ASSERT_EQ(late.wait(), 0) << read_file(master_->folder() / "late.log", 1 << 20);
  std::string bytes = read_file(file, 1 << 24);
  ros::serialization::IStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                     static_cast<std::uint32_t>(bytes.size()));
  nav_msgs::OccupancyGrid read;
  ros::serialization::deserialize(stream, read);
  EXPECT_EQ(read.data, grid_in(now).data);
}

TEST_F(MapPublisherTest, what_another_program_publishes_now_is_shown_no_more) {
  begin();
  const auto preview = preview_at({1'500'000'000});
  const auto maps = publisher();
  const Inbox<nav_msgs::OccupancyGrid> own(*node_, "alpha/map");
  const Inbox<nav_msgs::Path> path(*node_, "alpha/path");
  const std::shared_ptr<const Map> map(preview, &preview->parts[0].map);
  ASSERT_TRUE(eventually([&] {
    maps->publish_robots(map);
    return own.size() > 0 && path.size() > 0;
  })) << "before there is any preview";
  maps->publish_robots(nullptr);
  const std::string waits =
      "import rospy, sys\nrospy.init_node('late', disable_rosout=True)\n"
      "rospy.wait_for_message('/alpha/path', rospy.AnyMsg, 2)\n";
  test::PythonProcess late({"-c", waits}, master_->folder() / "late.log");
  EXPECT_NE(late.wait(), 0) << "it is latched no more";
  EXPECT_THAT(read_file(master_->folder() / "late.log", 1 << 20), HasSubstr("timeout exceeded"));
  const std::size_t before = path.size();
  EXPECT_TRUE(eventually([&] {
    maps->publish_robots(map);
    return path.size() > before;
  }));
}

TEST_F(MapPublisherTest, transforms_lead_from_the_team_to_where_each_robot_is) {
  begin();
  const Stamp now = stamp_of(ros::Time::now());
  const auto preview = preview_at(now);
  const auto maps = publisher();
  tf2_ros::Buffer buffer;
  const tf2_ros::TransformListener listener(buffer, *node_);
  tf2_ros::TransformBroadcaster broadcaster;
  auto topic = node_->advertise<nav_msgs::Odometry>("alpha/odometry", 100);
  ASSERT_TRUE(eventually([&] { return topic.getNumSubscribers() == 1; }));
  const Pose3 odometry_of_alpha = pose(-3, 7, 0.3), odometry_of_beta = pose(5, 5, 3.0);
  // What the robots' drivers say. Alpha's odometry drifts on after the newest node.
  const auto drive = [&] {
    std::vector<geometry_msgs::TransformStamped> transforms;
    for (const auto& [name, at] : {std::pair("alpha", odometry_of_alpha), {"beta", odometry_of_beta}})
      for (const double ago_s : {3.0, 0.0}) {
        geometry_msgs::TransformStamped& one = transforms.emplace_back();
        one.header.frame_id = std::string(name) + "/odom";
        one.child_frame_id = std::string(name) + "/base_link";
        one.header.stamp = ros::Time::now() - ros::Duration(ago_s);
        one.transform = transform_message(at);
      }
    broadcaster.sendTransform(transforms);
    for (const double later_s : {-0.1, 0.1}) {
      nav_msgs::Odometry message;
      message.header.stamp = ros_time(now) + ros::Duration(later_s);
      message.header.frame_id = "alpha/odom";
      message.child_frame_id = "alpha/base_link";
      message.pose.pose = pose_message(odometry_of_alpha);
      topic.publish(message);
    }
  };
  for (const auto& [robot, index] : {std::pair("alpha", 1u), {"beta", 1u}}) {
    std::optional<Pose3> found;
    ASSERT_TRUE(publishing(*maps, preview, [&] {
      drive();
      const std::string base = std::string(robot) + "/base_link";
      if (!buffer.canTransform("team", base, ros::Time(0))) return false;
      found = pose_of(buffer.lookupTransform("team", base, ros::Time(0)).transform);
      return found.has_value();
    })) << robot;
    const Pose3& expected = preview->parts[0].map.nodes.find(node_id(robot, index))->map_from_node;
    EXPECT_LT((found->t - expected.t).norm(), 1e-6) << robot;
    EXPECT_LT(found->q.angularDistance(expected.q), 1e-6) << robot;
  }
  const auto map_of_beta = pose_of(buffer.lookupTransform("team", "beta/map", ros::Time(0)).transform);
  EXPECT_LT(map_of_beta->t.norm(), 1e-9);
  EXPECT_GE(buffer.lookupTransform("team", "beta/map", ros::Time(0)).header.stamp, ros_time(now));
}

TEST_F(MapPublisherTest, the_frames_of_odometry_are_found_in_tf_whatever_their_names) {
  begin();
  const auto preview = preview_at(stamp_of(ros::Time::now()));
  const auto alone = std::make_shared<const Map>(preview->parts[0].map);
  RobotMapsOptions robots;
  robots.robots = {{RobotId("alpha"), [] { return std::optional<std::string>(); }, "", ""}};
  RobotMapsPublisher maps(
      *node_, RosNames({"alpha"}), robots, [&](const RobotId&) { return alone; }, pool_);
  tf2_ros::Buffer buffer;
  const tf2_ros::TransformListener listener(buffer, *node_);
  tf2_ros::TransformBroadcaster broadcaster;
  EXPECT_TRUE(eventually([&] {
    std::vector<geometry_msgs::TransformStamped> transforms;
    for (const double ago_s : {3.0, 0.0})
      for (const auto& [parent, child] : {std::pair("odom_combined", "base_footprint"), {"base_footprint", "laser"}}) {
        geometry_msgs::TransformStamped& one = transforms.emplace_back();
        one.header.frame_id = parent;
        one.child_frame_id = child;
        one.header.stamp = ros::Time::now() - ros::Duration(ago_s);
        one.transform = transform_message(pose(1, 2, 0.5));
      }
    broadcaster.sendTransform(transforms);
    maps.publish();
    return buffer.canTransform("alpha/map", "odom_combined", ros::Time(0));
  }));
}

TEST_F(MapPublisherTest, a_robot_s_odometry_is_the_topic_that_would_be_recorded) {
  begin();
  const auto scan = node_->advertise<sensor_msgs::LaserScan>("/scan", 1);
  const auto odometry = node_->advertise<nav_msgs::Odometry>("/odom", 1);
  runtime::RunConfiguration team;
  team.robots.resize(1);
  const runtime::PlannedRobot tb0{RobotId("tb0"), {}, {}};
  runtime::PlannedRobot tb1{RobotId("tb1"), {}, {}};
  const auto found = [&](const runtime::PlannedRobot& robot) { return RobotTopics(robot, team).odometry(); };
  EXPECT_TRUE(eventually([&] { return found(tb0) == "/odom"; })) << "a robot without a namespace";
  const auto other_scan = node_->advertise<sensor_msgs::LaserScan>("/tb1/scan", 1);
  const auto wheels = node_->advertise<nav_msgs::Odometry>("/tb1/wheels", 1);
  const auto filtered = node_->advertise<nav_msgs::Odometry>("/tb1/filtered", 1);
  team.robots.resize(2);
  EXPECT_EQ(found(tb0), std::nullopt) << "of several, each has one";
  EXPECT_EQ(found(tb1), std::nullopt) << "which of two is not clear";
  auto own = std::make_shared<runtime::RunConfiguration>(team);
  own->reading.topics = {"/tb1/scan", "/tb1/filtered"};
  tb1.configuration = own;
  EXPECT_EQ(found(tb1), "/tb1/filtered");
}

TEST_F(MapPublisherTest, a_lower_tier_s_team_frame_hangs_below_a_robot_s_map) {
  begin();
  const auto preview = preview_at({5'000'000'000});
  const auto maps = publisher(TeamTransforms::below);
  tf2_ros::Buffer buffer;
  const tf2_ros::TransformListener listener(buffer, *node_);
  ASSERT_TRUE(publishing(*maps, preview, [&] { return buffer.canTransform("alpha/map", "team", ros::Time(0)); }));
  const auto found = pose_of(buffer.lookupTransform("team", "alpha/map", ros::Time(0)).transform);
  EXPECT_LT((found->t - Eigen::Vector3d(4, 1, 0)).norm(), 1e-6);
  EXPECT_FALSE(buffer.canTransform("team", "beta/map", ros::Time(0)));
}

TEST_F(MapPublisherTest, robots_whose_odometry_frames_have_one_name_do_not_fight_for_it) {
  begin();
  MapPublisherOptions options;
  options.tier = "cloud";
  options.team_transforms = TeamTransforms::none;
  options.robots = {RobotId("alpha"), RobotId("beta")};
  RobotMapsOptions robots;
  robots.robots = {{RobotId("alpha"), named("odometry"), "", ""}, {RobotId("beta"), named("odometry"), "", ""}};
  Publishers maps(*node_, options, robots, pool_);
  const Inbox<tf2_msgs::TFMessage> sent(*node_, "/tf");
  auto topic = node_->advertise<nav_msgs::Odometry>("odometry", 100, true);
  const Stamp newest{1'700'000'000'000'000'000};
  for (const double ago_s : {1.2, 0.8, 0.2, 0.0}) {
    nav_msgs::Odometry message;
    message.header.stamp = ros_time(newest) - ros::Duration(ago_s);
    message.header.frame_id = "odom";
    message.pose.pose.orientation.w = 1.0;
    topic.publish(message);
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  ASSERT_TRUE(publishing(maps, preview_at(newest), [&] { return sent.size() >= 3; }));
  for (const auto& message : sent.all()) {
    ASSERT_EQ(message.transforms.size(), 1u);
    EXPECT_EQ(message.transforms[0].header.frame_id, "alpha/map");
    EXPECT_EQ(message.transforms[0].child_frame_id, "odom");
  }
  options.tier = "beta";
  EXPECT_THROW(MapPublisher(*node_, RosNames({"alpha", "beta"}), options, pool_), Error);
}

TEST_F(MapPublisherTest, transforms_follow_simulated_time) {
  ros::param::set("/use_sim_time", true);
  begin();
  auto clock = node_->advertise<rosgraph_msgs::Clock>("/clock", 10);
  const Inbox<tf2_msgs::TFMessage> sent(*node_, "/tf");
  const auto maps = publisher();
  double seconds = 1000.0;
  ASSERT_TRUE(publishing(*maps, preview_at({5'000'000'000}), [&] {
    rosgraph_msgs::Clock message;
    message.clock = ros::Time(seconds += 0.05);
    clock.publish(message);
    return sent.size() >= 3;
  }));
  const auto messages = sent.all();
  for (std::size_t i = 0; i < messages.size(); ++i) {
    const ros::Time stamp = messages[i].transforms.front().header.stamp;
    EXPECT_GT(stamp, i == 0 ? ros::Time(1000.0) : messages[i - 1].transforms.front().header.stamp);
    EXPECT_LT(stamp.toSec(), seconds + 0.2);
  }
}

TEST_F(MapPublisherTest, diagnostics_come_each_second_even_where_the_status_fails) {
  begin();
  std::atomic<bool> fails{false};
  const Inbox<diagnostic_msgs::DiagnosticArray> inbox(*node_, "/diagnostics");
  const DiagnosticsPublisher publisher(*node_, [&] {
    if (fails) throw std::runtime_error("no status");
    return nlohmann::ordered_json{{"name", "hall"},
                                  {"tiers", {{{"role", "edge"}, {"name", "north"}, {"state", "mapping"}}}}};
  });
  ASSERT_TRUE(eventually([&] { return inbox.size() >= 2; }));
  EXPECT_EQ(inbox.all()[0].status[0].level, diagnostic_msgs::DiagnosticStatus::OK);
  const double apart_s = (inbox.all()[1].header.stamp - inbox.all()[0].header.stamp).toSec();
  EXPECT_GT(apart_s, 0.5);
  fails = true;
  ASSERT_TRUE(
      eventually([&] { return inbox.all().back().status[0].level == diagnostic_msgs::DiagnosticStatus::STALE; }));
}

}  // namespace
}  // namespace mapweave::ros_nodes
