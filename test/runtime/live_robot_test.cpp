// What the live camera map server knows of a robot with two cameras, each a client of its own.
#include <mapweave/runtime/live_map_server.h>
#include <support/live_channel.h>
#include <support/received_updates.h>

#include <gmock/gmock.h>
#include <atomic>
#include <thread>

namespace mapweave::runtime {
namespace {

namespace subject = tiers::subject;
using Sent = transport::Channel::Sent;
using test::hello_of;
using test::take;
using namespace std::chrono_literals;

const RobotId kAlpha("alpha");
const SensorId kAhead("ahead"), kBack("back");

// Updates of each camera, as they were stored. turned_rad: by so much more than it says is the second one turned.
std::map<SessionId, std::vector<std::string>> published(double turned_rad) {
  auto options = test::camera_world(simulation::PlanKind::apartment, 7, 1);
  options.cameras.resize(2, options.cameras.front());
  options.cameras[0].id = kAhead.str();
  options.cameras[1].id = kBack.str();
  options.cameras[1].yaw_deg = 180.0;
  options.cameras[1].x_m = -0.15;
  options.robots[0].last_room = 3;
  options.robots[0].length_m = 10.0;
  test::FeatureTeam team(options, tiers::ServerOptions{});
  auto& back = team.robots[1];
  back.place.robot_from_camera.q =
      Eigen::AngleAxisd(turned_rad, Eigen::Vector3d::UnitZ()) * back.place.robot_from_camera.q;
  back.agent.emplace(back.place);
  std::map<SessionId, std::vector<std::string>> all;
  team.overheard = [&](const auto& camera, const std::string& bytes) {
    all[*camera.client->run(camera.place)].push_back(bytes);
  };
  team.run();
  return all;
}
const std::map<SessionId, std::vector<std::string>>& published_well() {
  static const auto all = published(0.0);
  return all;
}

std::shared_ptr<transport::Channel> greeted(LiveMapServer& server, const SessionId& session) {
  auto link = server.connect();
  link->send({subject::kHello, encode(hello_of(session))});
  EXPECT_EQ(take(*link, 10s).size(), 1U);
  return link;
}

void send(transport::Channel& link, const transport::Envelope& message) {
  Sent sent = Sent::later;
  while ((sent = link.send(message)) == Sent::later) std::this_thread::sleep_for(1ms);
  ASSERT_EQ(sent, Sent::taken);
}

ClientView view_at(const Node& node, const MapId& map, std::uint32_t forgotten = 0) {
  return {map, node.stamp, node.map_from_node, forgotten};
}

ClientCounts counts_of(const LiveMapServer& server, const SessionId& session) {
  for (const ClientCounts& client : server.counts().clients)
    if (client.session == session) return client;
  return {};
}

// All of a client's updates, and where it is at each of its keyframes, until all is received.
void publish(LiveMapServer& server, const SessionId& session, const std::vector<std::string>& updates,
             std::chrono::milliseconds apart) {
  const auto link = greeted(server, session);
  std::uint64_t views = counts_of(server, session).views;
  for (const std::string& bytes : updates) {
    send(*link, {subject::kUpdate, bytes});
    const MapUpdate update = decode_map_update(bytes, "test");
    for (const Node& node : update.nodes) {
      send(*link, {subject::kView, encode(view_at(node, update.origin.map))});
      ++views;
    }
    for (const test::ReceivedMessage& message : take(*link, apart))
      EXPECT_NE(message.subject, subject::kRefusal) << message.bytes;
  }
  while (counts_of(server, session).views < views) std::this_thread::sleep_for(1ms);
}

void await_merge(const LiveMapServer& server) {
  while (server.counts().is_merging) std::this_thread::sleep_for(1ms);
}

TEST(LiveRobot, is_known_to_whoever_asks_while_its_cameras_publish) {
  tiers::ServerOptions eager;
  eager.fuse_after = 5;
  LiveMapServer server(TierId("edge"), eager, {}, {}, std::nullopt);
  std::atomic<bool> ends{false};
  std::thread asker([&] {
    std::optional<Stamp> last;
    int answers = 0;
    while (!ends) {
      if (const auto answer = server.robot(kAlpha)) {
        EXPECT_TRUE(is_finite(answer->team_from_robot));
        EXPECT_GE(answer->cameras, 1);
        EXPECT_LE(answer->cameras, 2);
        answers += !last || *last != answer->stamp;
        last = answer->stamp;
      }
      EXPECT_FALSE(server.robot(RobotId("beta")));
      std::this_thread::sleep_for(1ms);
    }
    EXPECT_GE(answers, 1);
  });
  std::vector<std::thread> clients;
  for (const auto& [session, updates] : published_well())
    clients.emplace_back(
        [&server, &session = session, &updates = updates] { publish(server, session, updates, 20ms); });
  for (std::thread& client : clients) client.join();
  await_merge(server);
  ends = true;
  asker.join();
  const auto answer = server.robot(kAlpha);
  const tiers::VisualServer& ended = server.finish();
  ASSERT_TRUE(answer);
  ASSERT_EQ(ended.merged().components.size(), 1U);
  EXPECT_EQ(answer->team, MapId("alpha.ahead"));
  const std::vector<Map> maps = ended.maps();
  ASSERT_EQ(maps.front().id, answer->team);
  const Node* last = nullptr;
  for (const auto& [id, node] : maps.front().nodes)
    if (last == nullptr || last->stamp < node.stamp) last = &node;
  EXPECT_LE(last->stamp, answer->stamp);
  EXPECT_LT(seconds_between(last->stamp, answer->stamp), 1.5);
  EXPECT_LT((answer->team_from_robot.t - last->map_from_node.t).norm(), 0.7);
  const auto again = server.robot(kAlpha);
  ASSERT_TRUE(again) << "after the end too";
  EXPECT_EQ(again->stamp, answer->stamp);
}

TEST(LiveRobot, is_where_a_camera_says_that_takes_no_answers) {
  tiers::ServerOptions sharing;
  sharing.share = tiers::Sharing::view;
  sharing.fuse_after = 5;
  LiveServerOptions narrow;
  narrow.answers_kb = 1;
  LiveMapServer server(TierId("edge"), sharing, {}, narrow, std::nullopt);
  for (const auto& [session, updates] : published_well()) publish(server, session, updates, 20ms);
  await_merge(server);
  const auto& [session, updates] = *published_well().begin();
  const auto link = greeted(server, session);
  const ClientCounts before = counts_of(server, session);
  std::uint32_t views = 0;
  for (const std::string& bytes : updates) {
    const MapUpdate update = decode_map_update(bytes, "test");
    for (const Node& node : update.nodes) {
      send(*link, {subject::kView, encode(view_at(node, update.origin.map, ++views))});
      while (counts_of(server, session).views < before.views + views) std::this_thread::sleep_for(1ms);
      const auto answer = server.robot(kAlpha);
      ASSERT_TRUE(answer);
      EXPECT_LE(node.stamp, answer->stamp) << "after " << views << " views";
    }
  }
  const auto shares = counts_of(server, session).shares - before.shares;
  EXPECT_GT(shares, 0U);
  EXPECT_LT(shares, views) << "nothing more is shared with it";
}

TEST(LiveRobot, says_once_why_its_cameras_are_not_merged) {
  tiers::ServerOptions eager;
  eager.fuse_after = 5;
  eager.fuse_share = 0.0;
  LiveMapServer server(TierId("edge"), eager, {}, {}, std::nullopt);
  testing::internal::CaptureStderr();
  const auto all = published(0.35);
  std::vector<std::string> notes;
  for (const bool later : {false, true}) {
    for (const auto& [session, updates] : all) {
      const auto half = updates.begin() + static_cast<std::ptrdiff_t>(updates.size() / 2);
      publish(server, session, later ? std::vector(half, updates.end()) : std::vector(updates.begin(), half), 20ms);
    }
    await_merge(server);
    ASSERT_EQ(server.counts().notes.size(), 1U);
    notes.push_back(server.counts().notes.front());
    EXPECT_THAT(notes.back(),
                testing::AllOf(testing::HasSubstr("robot 'alpha'"),
                               testing::ContainsRegex("(19|20|21) deg farther to the right")));  // 20 by the truth
  }
  EXPECT_NE(notes.front(), notes.back()) << "it counts more";
  server.finish();
  const std::string log = testing::internal::GetCapturedStderr();
  const std::string contradict = "contradict each other";
  ASSERT_NE(log.find(contradict), std::string::npos) << log;
  EXPECT_EQ(log.find(contradict), log.rfind(contradict)) << log;
}

}  // namespace
}  // namespace mapweave::runtime
