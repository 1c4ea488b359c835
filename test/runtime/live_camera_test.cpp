#include <mapweave/runtime/live_map_server.h>
#include <support/live_camera.h>
#include <support/received_updates.h>
#include <support/slowness.h>
#include <support/temporary_folder.h>

#include <gmock/gmock.h>
#include <thread>
#include <utility>

namespace mapweave::runtime {
namespace {

using namespace std::chrono_literals;
using Robot = test::FeatureTeam::Robot;

test::FeatureTeam alone(double length_m) {
  auto options = test::two_in_an_apartment();
  options.robots.resize(1);
  options.robots[0].length_m = length_m;
  return test::FeatureTeam(options, tiers::ServerOptions{});
}

// Frames [begin, end), so far apart in time that few are dropped.
void drive(test::LiveCamera& camera, const Robot& robot, std::size_t begin, std::size_t end,
           std::chrono::milliseconds apart) {
  int dropped = camera.dropped();
  for (std::size_t i = begin; i < end; ++i) {
    camera.add(robot.shoot(i).frame);
    const int now = camera.dropped();
    if (std::exchange(dropped, now) < now)
      apart = std::min(apart + 5ms * test::kSlowness, 200ms * test::kSlowness);  // a busy machine
    std::this_thread::sleep_for(apart);
  }
}

// What a server has is what the client has: light updates leave out what moved by millimetres, and what one keyframe
// alone saw.
void expect_agreement(const std::vector<Map>& server, const visual::VisualClient& client, const Robot& robot) {
  const auto maps = client.maps(robot.place);
  ASSERT_EQ(server.size(), maps.size());
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const Map& here = server[i];
    ASSERT_EQ(here.nodes.size(), maps[i].nodes.size());
    for (const auto& [id, node] : maps[i].nodes) {
      const Node* known = here.nodes.find(id);
      ASSERT_NE(known, nullptr);
      EXPECT_LT((known->map_from_node.t - node.map_from_node.t).norm(), 0.005);
      EXPECT_EQ(keyframe_of(*known)->points.size(), keyframe_of(node)->points.size());
    }
    std::size_t published = 0;
    for (const auto& [id, landmark] : maps[i].landmarks) {
      const Landmark* known = here.landmarks.find(id);
      if (landmark.seen.size() < 2) continue;
      ASSERT_NE(known, nullptr) << to_string(id);
      EXPECT_EQ(known->anchor, landmark.anchor);
      EXPECT_EQ(known->seen.size(), landmark.seen.size());
      ++published;
    }
    EXPECT_EQ(here.landmarks.size(), published);
  }
}

TEST(LiveCamera, publishes_all_and_goes_on_when_nobody_listens) {
  auto team = alone(4.0);
  const Robot& robot = team.robots[0];
  for (const bool listens : {true, false}) {
    LiveMapServer server(TierId("edge"), {}, {}, {}, std::nullopt);
    test::LiveCamera camera(robot.place, robot.camera, 0.0, {}, server.connect());
    if (!listens) server.finish();
    drive(camera, robot, 0, robot.count, 5ms);
    const visual::VisualClient& client = camera.finish(10s * test::kSlowness);
    EXPECT_GT(client.keyframes().size(), 2U);
    EXPECT_EQ(camera.refusal(), "");
    EXPECT_EQ(camera.agent().waiting_bytes(), 0U);
    const auto maps = server.finish().maps();
    ASSERT_EQ(maps.size(), listens ? 1U : 0U);
    if (listens) expect_agreement(maps, client, robot);
  }
}

// Its server ends while it drives, and another one goes on from the same journal.
TEST(LiveCamera, comes_back_to_a_server_that_was_gone) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "server.mwj";
  auto team = alone(6.0);
  const Robot& robot = team.robots[0];
  auto first = std::make_unique<LiveMapServer>(TierId("edge"), tiers::ServerOptions{}, fusion::FusionOptions{},
                                               LiveServerOptions{}, path);
  test::LiveCamera camera(robot.place, robot.camera, 0.0, {}, first->connect());
  drive(camera, robot, 0, robot.count / 3, 15ms);
  first.reset();
  drive(camera, robot, robot.count / 3, 2 * robot.count / 3, 15ms);
  LiveMapServer second(TierId("edge"), {}, {}, {}, path);
  camera.reconnect(second.connect());
  drive(camera, robot, 2 * robot.count / 3, robot.count, 15ms);
  const visual::VisualClient& client = camera.finish(20s * test::kSlowness);
  EXPECT_EQ(camera.refusal(), "");
  EXPECT_EQ(camera.agent().waiting_bytes(), 0U);
  expect_agreement(second.finish().maps(), client, robot);
}

TEST(LiveCamera, catches_up_through_the_shortest_queue_after_a_minute_without_a_server) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "server.mwj";
  auto team = alone(60.0);
  const Robot& robot = team.robots[0];
  LiveServerOptions options;
  options.queue_kb = 64;
  constexpr std::size_t kBefore = 60, kMinute = 60 * 12;
  ASSERT_GT(robot.count, kBefore + kMinute);
  auto first =
      std::make_unique<LiveMapServer>(TierId("edge"), tiers::ServerOptions{}, fusion::FusionOptions{}, options, path);
  test::LiveCamera camera(robot.place, robot.camera, 0.0, {}, first->connect());
  drive(camera, robot, 0, kBefore, 5ms);
  first.reset();
  drive(camera, robot, kBefore, kBefore + kMinute, 5ms);
  LiveMapServer second(TierId("edge"), {}, {}, options, path);
  camera.reconnect(second.connect());
  const visual::VisualClient& client = camera.finish(60s * test::kSlowness);
  EXPECT_EQ(camera.refusal(), "");
  EXPECT_EQ(camera.agent().waiting_bytes(), 0U);
  expect_agreement(second.finish().maps(), client, robot);
  const auto counts = second.counts().clients;
  ASSERT_EQ(counts.size(), 1U);
  std::printf("%zu keyframes, %d frames dropped; %.2f MB in %d updates\n", client.keyframes().size(), camera.dropped(),
              1e-6 * static_cast<double>(counts[0].received_bytes), static_cast<int>(counts[0].updates));
  EXPECT_GT(counts[0].received_bytes, 1'100'000U) << "more than a camera keeps apart";
}

TEST(LiveCamera, goes_on_with_another_server_that_knows_nothing) {
  auto team = alone(12.0);
  const Robot& robot = team.robots[0];
  auto first = std::make_unique<LiveMapServer>(TierId("edge"), tiers::ServerOptions{}, fusion::FusionOptions{},
                                               LiveServerOptions{}, std::nullopt);
  test::LiveCamera camera(robot.place, robot.camera, 0.0, {}, first->connect());
  drive(camera, robot, 0, robot.count / 2, 8ms);
  EXPECT_GT(first->finish().maps().size(), 0U);
  LiveMapServer second(TierId("edge"), {}, {}, {}, std::nullopt);
  camera.reconnect(second.connect());
  drive(camera, robot, robot.count / 2, robot.count, 8ms);
  const visual::VisualClient& client = camera.finish(20s * test::kSlowness);
  EXPECT_EQ(camera.refusal(), "");
  EXPECT_EQ(camera.agent().waiting_bytes(), 0U);
  expect_agreement(second.finish().maps(), client, robot);
}

// What a camera has no room for its server keeps. One that knows nothing of it cannot get that back from the camera.
TEST(LiveCamera, says_what_went_with_the_server_that_kept_it) {
  const test::TemporaryFolder folder;
  auto team = alone(15.0);
  const Robot& robot = team.robots[0];
  test::LiveCameraOptions small;
  small.client.memory.keyframes = 20;
  for (const bool has_journal : {true, false}) {
    const auto path = has_journal ? std::optional(folder.path() / "server.mwj") : std::nullopt;
    tiers::ServerOptions sharing;
    sharing.share = tiers::Sharing::view;
    auto first =
        std::make_unique<LiveMapServer>(TierId("edge"), sharing, fusion::FusionOptions{}, LiveServerOptions{}, path);
    test::LiveCamera camera(robot.place, robot.camera, 0.0, small, first->connect());
    drive(camera, robot, 0, 2 * robot.count / 3, 8ms);
    first.reset();
    testing::internal::CaptureStderr();
    LiveMapServer second(TierId("edge"), sharing, {}, {}, path);
    camera.reconnect(second.connect());
    drive(camera, robot, 2 * robot.count / 3, robot.count, 8ms);
    const visual::VisualClient& client = camera.finish(20s * test::kSlowness);
    const std::string log = testing::internal::GetCapturedStderr();
    ASSERT_GT(client.forgotten(), 5U);
    std::size_t kept = 0;
    for (const Map& map : second.finish().maps()) kept += map.nodes.size();
    std::printf("%zu keyframes, %zu forgotten; the server has %zu\n", client.keyframes().size(), client.forgotten(),
                kept);
    EXPECT_THAT(log,
                testing::Conditional(has_journal, testing::Not(testing::HasSubstr("lacks")),
                                     testing::AllOf(testing::HasSubstr("alpha.camera: the camera map server lacks"),
                                                    testing::HasSubstr("visual.memory.keyframes"))));
    EXPECT_EQ(kept + 5 > client.keyframes().size() + client.forgotten(), has_journal);
  }
}

TEST(LiveCamera, says_what_to_do_where_a_keyframe_is_longer_than_the_queue) {
  auto team = alone(2.0);
  const Robot& robot = team.robots[0];
  LiveServerOptions options;
  options.queue_kb = 64;
  LiveMapServer server(TierId("edge"), {}, {}, options, std::nullopt);
  test::LiveCamera camera(robot.place, robot.camera, 0.0, {}, server.connect());
  testing::internal::CaptureStderr();
  for (std::size_t i = 0; i < robot.count; ++i) {
    visual::FeatureFrame frame = robot.shoot(i).frame;
    for (std::size_t from = 0; frame.features.points.size() < 2500; ++from) {
      frame.features.points.push_back(frame.features.points[from]);
      frame.features.descriptors.push_back(frame.features.descriptors[from]);
      frame.inverse_depths.push_back(frame.inverse_depths[from]);
    }
    camera.add(frame);
    std::this_thread::sleep_for(5ms);
  }
  camera.finish(300ms);
  const std::string log = testing::internal::GetCapturedStderr();
  ASSERT_NE(log.find("queue_kb"), std::string::npos) << log;
  EXPECT_EQ(log.find("queue_kb"), log.rfind("queue_kb")) << "it says so once\n" << log;
  EXPECT_GT(camera.agent().waiting_bytes(), 64U << 10);
  EXPECT_NE(camera.refusal().find("queue_kb"), std::string::npos) << camera.refusal();
}

// Within a bound that it cannot keep: what is left at the end is published all the same.
TEST(LiveCamera, publishes_the_rest_whatever_its_wire_was) {
  auto team = alone(4.0);
  const Robot& robot = team.robots[0];
  LiveMapServer server(TierId("edge"), {}, {}, {}, std::nullopt);
  test::LiveCameraOptions narrow;
  narrow.uplink.most_bytes_per_s = 2000.0;
  test::LiveCamera camera(robot.place, robot.camera, 0.0, narrow, server.connect());
  drive(camera, robot, 0, robot.count, 5ms);
  const visual::VisualClient& client = camera.finish(10s * test::kSlowness);
  const auto maps = server.finish().maps();
  ASSERT_EQ(maps.size(), 1U);
  EXPECT_EQ(maps.front().nodes.size(), client.keyframes().size());
}

}  // namespace
}  // namespace mapweave::runtime
