#include <mapweave/tiers/camera_agent.h>

#include <mapweave/core/error.h>
#include <support/received_updates.h>

#include <gmock/gmock.h>

namespace mapweave::tiers {
namespace {

using test::hello_of;

constexpr std::size_t kShortestQueue = std::size_t{64} << 10;  // bytes, of a live server

// One camera in the apartment, which forgets what is long ago.
struct Drive {
  test::FeatureTeam team;
  const test::FeatureTeam::Robot& robot;
  visual::VisualClient client;
  CameraAgent agent;
  std::size_t next = 0;

  explicit Drive(int keyframes = 400, const UplinkOptions& uplink = {})
      : team(alone(), ServerOptions{}),
        robot(team.robots[0]),
        client(camera(robot, keyframes)),
        agent(robot.place, uplink) {}
  static simulation::WorldOptions alone() {
    auto options = test::two_in_an_apartment();
    options.robots.resize(1);
    return options;
  }
  static visual::VisualClient camera(const test::FeatureTeam::Robot& robot, int keyframes) {
    visual::ClientOptions options = robot.options;
    options.memory.keyframes = keyframes;
    return visual::VisualClient(robot.camera, 0.0, options, matching::shipped_vocabulary());
  }
  void go(std::size_t frames) {
    for (const std::size_t end = std::min(robot.count, next + frames); next < end; ++next)
      client.add(robot.shoot(next).frame);
  }
  Hello hello() const { return hello_of(*client.run(robot.place)); }
  // What there is to publish, to a server that confirms it.
  std::vector<std::string> publish(VisualServer& server) {
    std::vector<std::string> published;
    for (const transport::Envelope& update : agent.updates(client, {})) {
      agent.stored(server.receive(hello().session, update.bytes).receipt);
      published.push_back(update.bytes);
    }
    return published;
  }
  void meet(VisualServer& server) { agent.reconnected(client, server.greet(hello())); }
};

std::string bytes_of(const std::vector<Map>& maps) {
  std::string bytes;
  for (const Map& map : maps) bytes += encode(difference(Map{}, map));
  return bytes;
}

TEST(CameraAgent, publishes_what_waited_long_in_parts_that_together_say_the_same) {
  Drive drive(20), whole(20);
  drive.go(1);
  whole.go(1);
  VisualServer server(TierId("edge"), {}, {});
  drive.meet(server);
  VisualServer at_once(TierId("edge"), {}, {});
  at_once.greet(whole.hello());
  std::size_t parts = 0, removed = 0;
  std::uint64_t last = 0;
  while (whole.next < whole.robot.count) {
    drive.go(100);
    whole.go(100);
    for (const MapUpdate& update : whole.client.take_updates(whole.robot.place, visual::PublishedDetail::light)) {
      at_once.receive(*whole.client.run(whole.robot.place), encode(update));
      removed += update.removed_nodes.size() + update.forgotten_nodes.size();
    }
    for (const std::string& bytes : drive.publish(server)) {
      EXPECT_LT(bytes.size(), kShortestQueue);
      EXPECT_EQ(decode_map_update(bytes, "test").sequence, ++last);
      ++parts;
    }
    ASSERT_TRUE(bytes_of(server.maps()) == bytes_of(at_once.maps()));
  }
  EXPECT_EQ(drive.agent.waiting_bytes(), 0U);
  EXPECT_GT(removed, 5U);
  EXPECT_GT(parts, 2 * whole.robot.count / 100) << "more than one for each time";
}

TEST(CameraAgent, publishes_all_again_where_a_server_lacks_what_another_confirmed) {
  Drive drive;
  drive.go(1);
  VisualServer first(TierId("edge"), {}, {}), younger(TierId("edge"), {}, {});
  drive.meet(first);
  younger.greet(drive.hello());
  drive.go(60);
  for (const std::string& update : drive.publish(first)) younger.receive(drive.hello().session, update);
  const auto began = younger.maps().at(0).nodes.size();
  drive.go(60);
  drive.publish(first);
  drive.go(60);
  drive.meet(first);
  std::size_t published_before = 0;
  for (const std::string& update : drive.publish(first))
    published_before += decode_map_update(update, "test").base == 0;
  EXPECT_EQ(published_before, 0U) << "the same server receives what is new alone";

  VisualServer empty(TierId("edge"), {}, {});
  drive.meet(empty);
  drive.publish(empty);
  drive.meet(younger);
  drive.publish(younger);
  EXPECT_EQ(drive.agent.waiting_bytes(), 0U);
  EXPECT_GT(empty.maps().at(0).nodes.size(), began);
  EXPECT_EQ(bytes_of(empty.maps()), bytes_of(younger.maps()));
  drive.go(60);
  drive.publish(younger);
  ASSERT_EQ(younger.maps().size(), 1U);
  EXPECT_EQ(younger.maps()[0].nodes.size(), drive.client.keyframes().size());
  // What another server would take for its own from the journal.
  VisualServer again(TierId("edge"), {}, {});
  for (const auto& [from, update] : younger.snapshot()) {
    again.greet(hello_of(from));
    again.receive(from, update);
  }
  EXPECT_EQ(bytes_of(again.maps()), bytes_of(younger.maps()));
}

TEST(CameraAgent, takes_the_place_of_what_an_earlier_one_of_the_same_run_published) {
  Drive before, drive;
  VisualServer server(TierId("edge"), {}, {});
  before.go(120);
  before.meet(server);
  while (before.next < 180) {
    before.publish(server);
    before.go(10);
  }
  drive.go(150);
  drive.meet(server);
  drive.publish(server);
  EXPECT_EQ(drive.agent.waiting_bytes(), 0U);
  ASSERT_EQ(server.maps().size(), 1U);
  EXPECT_EQ(server.maps()[0].nodes.size(), drive.client.keyframes().size());
}

// What a server receives of a drive, twice a second, over a wire of so many bytes a second (0: any).
struct Received {
  double kB_per_s = 0.0;
  std::size_t rounds = 0, views = 0, corrections = 0;
  std::size_t behind = 0;  // rounds after which the server lacked a keyframe, or had one elsewhere than the client
  double features = 0.0;   // of a keyframe, on the mean
  std::size_t most_features_behind = 0;  // of a keyframe that was published when the server was behind before
  // At the end: keyframes at the server, at the client, and those that are not where the client has them.
  std::size_t keyframes = 0, kept = 0, lacking = 0;
};

// Keyframes that the server lacks or has farther off than what is worth a message.
std::size_t lacking(const Drive& drive, const VisualServer& server) {
  const Pose3& robot_from_camera = drive.robot.place.robot_from_camera;
  std::map<Stamp, Pose3> published;
  for (const Map& map : server.maps())
    for (const auto& [id, node] : map.nodes)
      published[node.stamp] = compose(compose(inverse(robot_from_camera), node.map_from_node), robot_from_camera);
  std::size_t count = 0;
  for (const visual::PlacedFrame& keyframe : drive.client.keyframes()) {
    const auto known = published.find(keyframe.stamp);
    count += known == published.end() || !((known->second.t - keyframe.map_from_camera.t).norm() < 0.004);
  }
  return count;
}

// Its keyframes all turn out to lie elsewhere.
bool correct(Drive& drive) {
  const Pose3 motion{{0.1, 0.0, 0.0}, Eigen::Quaterniond(Eigen::AngleAxisd(0.02, Eigen::Vector3d::UnitZ()))};
  std::vector<MovedNode> corrected;
  for (const Map& map : drive.client.maps(drive.robot.place))
    for (const auto& [id, node] : map.nodes) corrected.push_back({id, compose(motion, node.map_from_node)});
  return drive.client.correct(drive.robot.place, 0, corrected, 1.0);
}

Received received_over(double bytes_per_s) {
  UplinkOptions uplink;
  uplink.most_bytes_per_s = bytes_per_s;
  Drive drive(400, uplink);
  VisualServer server(TierId("edge"), {}, {});
  drive.go(1);
  drive.meet(server);
  Received received;
  std::size_t nodes = 0;
  bool was_behind = false;
  while (drive.next < drive.robot.count) {
    drive.go(6);
    received.corrections += received.rounds % 20 == 19 && correct(drive);
    const Stamp now = drive.client.trajectory().back().stamp;
    for (const transport::Envelope& update : drive.agent.updates(drive.client, now)) {
      for (const Node& node : decode_map_update(update.bytes, "test").nodes) {
        const std::size_t features = keyframe_of(node)->points.size();
        received.features += static_cast<double>(features);
        ++nodes;
        if (was_behind) received.most_features_behind = std::max(received.most_features_behind, features);
      }
      drive.agent.stored(server.receive(drive.hello().session, update.bytes).receipt);
    }
    received.views += drive.agent.view(drive.client).has_value();
    was_behind = lacking(drive, server) > 0;
    ++received.rounds;
    received.behind += was_behind;
  }
  received.kB_per_s = 12e-3 * static_cast<double>(drive.agent.sent_bytes()) / static_cast<double>(drive.robot.count);
  received.features /= static_cast<double>(nodes);
  drive.agent.lift_limit();
  drive.publish(server);
  for (const Map& map : server.maps()) received.keyframes += map.nodes.size();
  received.kept = drive.client.keyframes().size();
  received.lacking = lacking(drive, server);
  std::printf(
      "bound %.1f kB/s: %.1f kB/s, %.0f features a keyframe (%zu at most when behind), behind after %zu of %zu rounds, "
      "%zu views\n",
      1e-3 * bytes_per_s, received.kB_per_s, received.features, received.most_features_behind, received.behind,
      received.rounds, received.views);
  return received;
}

// The order in which it publishes less: features, then keyframes and where they are, never where the client is.
TEST(CameraAgent, publishes_fewer_features_first_then_keyframes_later_and_always_its_pose) {
  const Received wide = received_over(0.0), narrow = received_over(25e3), narrowest = received_over(10e3);
  EXPECT_GT(wide.kB_per_s, 30.0) << "or there is nothing to save";
  EXPECT_EQ(wide.behind, 0U);
  EXPECT_LT(narrow.features, 0.5 * wide.features);
  EXPECT_LT(narrow.behind, narrow.rounds / 5) << "features pay for it";
  EXPECT_LT(narrowest.features, 0.7 * narrow.features);
  EXPECT_GT(narrowest.behind, 2 * narrow.behind);
  EXPECT_EQ(narrowest.most_features_behind, UplinkOptions().least_features)
      << "who is late has given up all features that he may";
  EXPECT_LT(narrow.kB_per_s, 1.2 * 25.0);
  EXPECT_LT(narrowest.kB_per_s, 1.2 * 10.0);
  for (const Received& received : {wide, narrow, narrowest}) {
    EXPECT_EQ(received.views, received.rounds);
    EXPECT_GT(received.corrections, 4U);
    EXPECT_EQ(received.keyframes, received.kept);
    EXPECT_EQ(received.lacking, 0U) << "in the end";
  }
}

}  // namespace
}  // namespace mapweave::tiers
