#include <mapweave/tiers/camera_agent.h>

#include <mapweave/core/error.h>
#include <support/heard_updates.h>

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

  explicit Drive(int keyframes = 400)
      : team(alone(), ServerOptions{}), robot(team.robots[0]), client(camera(robot, keyframes)), agent(robot.place) {}
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
    for (const std::size_t end = std::min(robot.count, next + frames); next < end; ++next) client.add(robot.shoot(next).frame);
  }
  Hello hello() const { return hello_of(*client.run(robot.place)); }
  // What there is to tell, to a server that confirms it.
  std::vector<std::string> tell(VisualServer& server) {
    const auto updates = agent.updates(client, {});
    for (const std::string& update : updates) agent.stored(server.receive(hello().session, update).receipt);
    return updates;
  }
  void meet(VisualServer& server) { agent.reconnected(client, server.greet(hello())); }
};

std::string bytes_of(const std::vector<Map>& maps) {
  std::string bytes;
  for (const Map& map : maps) bytes += encode(difference(Map{}, map));
  return bytes;
}

TEST(CameraAgent, tells_what_waited_long_in_parts_that_together_say_the_same) {
  Drive drive(20), whole(20);
  drive.go(1), whole.go(1);
  VisualServer server(TierId("edge"), {}, {});
  drive.meet(server);
  std::map<MapId, Map> expected;
  std::size_t parts = 0, removed = 0;
  std::uint64_t last = 0;
  while (whole.next < whole.robot.count) {
    drive.go(100), whole.go(100);
    for (const MapUpdate& update : whole.client.take_updates(whole.robot.place, visual::PublishedDetail::light)) {
      Map& map = expected[update.origin.map];
      map = updated(std::move(map), update);
      removed += update.removed_nodes.size();
    }
    for (const std::string& bytes : drive.tell(server)) {
      EXPECT_LT(bytes.size(), kShortestQueue);
      EXPECT_EQ(decode_map_update(bytes, "test").sequence, ++last);
      ++parts;
    }
    std::vector<Map> all;
    for (const auto& [id, map] : expected) all.push_back(map);
    ASSERT_EQ(bytes_of(server.maps()), bytes_of(all));
  }
  EXPECT_EQ(drive.agent.waiting_bytes(), 0U);
  EXPECT_GT(removed, 5U);
  EXPECT_GT(parts, 2 * whole.robot.count / 100) << "more than one for each time";
}

TEST(CameraAgent, tells_all_again_where_a_server_lacks_what_another_confirmed) {
  Drive drive;
  drive.go(1);
  VisualServer first(TierId("edge"), {}, {}), younger(TierId("edge"), {}, {});
  drive.meet(first), younger.greet(drive.hello());
  drive.go(60);
  for (const std::string& update : drive.tell(first)) younger.receive(drive.hello().session, update);
  const auto began = younger.maps().at(0).nodes.size();
  drive.go(60), drive.tell(first), drive.go(60);
  drive.meet(first);
  std::size_t told_before = 0;
  for (const std::string& update : drive.tell(first)) told_before += decode_map_update(update, "test").base == 0;
  EXPECT_EQ(told_before, 0U) << "the same server hears what is new alone";

  VisualServer empty(TierId("edge"), {}, {});
  drive.meet(empty), drive.tell(empty);
  drive.meet(younger), drive.tell(younger);
  EXPECT_EQ(drive.agent.waiting_bytes(), 0U);
  EXPECT_GT(empty.maps().at(0).nodes.size(), began);
  EXPECT_EQ(bytes_of(empty.maps()), bytes_of(younger.maps()));
  drive.go(60), drive.tell(younger);
  ASSERT_EQ(younger.maps().size(), 1U);
  EXPECT_EQ(younger.maps()[0].nodes.size(), drive.client.keyframes().size());
  // What another server would take for its own from the journal.
  VisualServer again(TierId("edge"), {}, {});
  for (const auto& [from, update] : younger.snapshot()) again.greet(hello_of(from)), again.receive(from, update);
  EXPECT_EQ(bytes_of(again.maps()), bytes_of(younger.maps()));
}

TEST(CameraAgent, takes_the_place_of_what_a_server_was_told_by_an_earlier_one_of_the_same_run) {
  Drive before, drive;
  VisualServer server(TierId("edge"), {}, {});
  before.go(120), before.meet(server);
  while (before.next < 180) before.tell(server), before.go(10);
  drive.go(150), drive.meet(server), drive.tell(server);
  EXPECT_EQ(drive.agent.waiting_bytes(), 0U);
  ASSERT_EQ(server.maps().size(), 1U);
  EXPECT_EQ(server.maps()[0].nodes.size(), drive.client.keyframes().size());
}

}  // namespace
}  // namespace mapweave::tiers
