// Robots whose cameras share while they drive (server.share), as programs of their own: over channels of this process.
#include "live_team.h"

#include <mapweave/evaluation/absolute_error.h>
#include <mapweave/evaluation/tum_trajectory.h>

#include <gmock/gmock.h>

namespace mapweave::runtime {
namespace {

using namespace test_support;

// Two robots that drive through the same rooms, each with a small camera.
class CameraLogs {
 public:
  CameraLogs() {
    simulation::WorldOptions world;
    world.seed = 7;
    world.look.posters_per_10_m = 3.0;
    world.laser.rays = 31;
    world.laser.scans_per_second = 1.0;
    world.buildings.resize(1);
    world.buildings.front().furniture.round = 0.3;
    world.buildings.front().apartment.width_m = 10.0;
    world.buildings.front().apartment.height_m = 8.0;
    world.cameras.resize(1);
    simulation::CameraOptions& camera = world.cameras.front();
    camera.id = "front";
    camera.width = 240;
    camera.height = 180;
    camera.fx = camera.fy = 197.0;
    camera.frames_per_second = 8.0;
    for (const char* id : {"alpha", "beta"}) {
      simulation::RobotOptions robot;
      robot.id = id;
      robot.edge = "north";
      robot.last_room = 1;
      robot.length_m = 7.0;
      world.robots.push_back(robot);
    }
    WorkerPool pool(2);
    simulation::simulate(world, folder_.path(), pool, *make_silent_progress());
  }
  RunConfiguration configuration() const {
    RunConfiguration result;
    load(result, {{folder_ / "run.yaml"}, {}, {}});
    for (RobotEntry& robot : result.robots) robot.log = folder_ / robot.log;
    result.sensor = "rgbd";
    result.output.report = false;
    result.server.fuse_after = 3;
    return result;
  }
  // Of both in one frame.
  double error_m(const fs::path& results) const {
    std::vector<evaluation::Compared> robots;
    for (const char* id : {"alpha", "beta"})
      robots.push_back({evaluation::read_tum(results / "team/trajectories" / (std::string(id) + ".tum")),
                        evaluation::read_tum(folder_ / (std::string(id) + ".truth.tum"))});
    evaluation::TrajectoryErrorOptions options;
    options.align = evaluation::AlignmentKind::se3;
    return evaluation::absolute_error(evaluation::aligned_tracks(robots, options)).translation_m.rmse;
  }

 private:
  test::TemporaryFolder folder_;
};

const CameraLogs& logs() {
  static const CameraLogs logs;
  return logs;
}

struct LiveSharing : LiveTeam {
  void share(tiers::Sharing share, int most_keyframes = 500) {
    configuration = logs().configuration();
    configuration.server.share = share;
    configuration.visual.client.memory.keyframes = most_keyframes;
    plan = make_plan(configuration, {});
    expect_live(configuration, plan);
    choose_sensors(plan, configuration, pool);
    options.speed = 3.0 / kSlowness;
  }
  std::uint64_t received() const {
    std::uint64_t bytes = 0;
    for (const auto& robot : robots) bytes += robot->counts().sharing->received_bytes;
    return bytes;
  }
  std::uint64_t sent() const {
    std::uint64_t bytes = 0;
    for (const auto& robot : robots) bytes += robot->counts().sharing->sent_bytes;
    return bytes;
  }
  // What `run` makes of the same.
  Report as_batch(const fs::path& out) {
    return run_batch(configuration, make_plan(configuration, {}), {out, false, false}, pool, *silent);
  }
  void print(const char* what, const Report& report, double error_m) const {
    std::printf("%s: error %.4f m;", what, error_m);
    for (const RobotReport& robot : report.robots)
      for (const CameraReport& camera : robot.cameras)
        std::printf(
            " %s: %d of %d frames, sent %d, received %d bytes, borrowed %d, shared keyframes %d, kept %d of %d;",
            robot.id.str().c_str(), static_cast<int>(camera.tracked), static_cast<int>(camera.frames),
            static_cast<int>(camera.sent_bytes), static_cast<int>(camera.received_bytes),
            static_cast<int>(camera.borrowed), static_cast<int>(camera.shared_keyframes), static_cast<int>(camera.kept),
            static_cast<int>(camera.forgotten));
    std::printf("\n");
  }
  // All frames were mapped, and the team's map is as good as that of `run`.
  void expect_as_good(const Report& report, const char* what) {
    const fs::path run = folder / "batch";
    const Report batch = as_batch(run);
    const double live_m = logs().error_m(settings.out), batch_m = logs().error_m(run);
    print("run", batch, batch_m);
    print(what, report, live_m);
    EXPECT_LT(live_m, std::max(1.1 * batch_m, batch_m + 0.02));  // what is shared when depends on the machine's load
    EXPECT_LT(live_m, 0.06);
    ASSERT_EQ(report.robots.size(), 2U);
    for (std::size_t i = 0; i < 2; ++i) {
      ASSERT_EQ(report.robots[i].cameras.size(), 1U);
      EXPECT_EQ(report.robots[i].cameras.front().frames, batch.robots[i].cameras.front().frames);
    }
  }
};

std::uint64_t borrowed(const Report& report) {
  std::uint64_t sum = 0;
  for (const RobotReport& robot : report.robots)
    for (const CameraReport& camera : robot.cameras) sum += camera.borrowed;
  return sum;
}

TEST_F(LiveSharing, of_views_shows_cameras_what_others_saw) {
  share(tiers::Sharing::view);
  start_cloud();
  start_edge("north", "north");
  start_robots();
  const Report report = result();
  EXPECT_GT(borrowed(report), 0U);
  const ServerCounts server = edges.at("north")->counts().cameras.value();
  ASSERT_EQ(server.clients.size(), 2U);
  std::uint64_t received = 0;
  for (const ClientCounts& client : server.clients) {
    EXPECT_GT(client.updates, 3U);
    EXPECT_GT(client.views, 10U);
    EXPECT_EQ(client.refused, 0U);
    received += client.received_bytes;
  }
  EXPECT_GE(server.merges, 1);
  EXPECT_GT(received, 50'000U);
  EXPECT_EQ(edges.at("north")->cameras_of(RobotId("alpha")), 1U);
  EXPECT_EQ(edges.at("north")->cameras_of(RobotId("nobody")), 0U);
  for (const auto& robot : robots) {
    const LiveRobotCounts::Sharing counts = robot->counts().sharing.value();
    EXPECT_EQ(counts.cameras, 1U);
    EXPECT_EQ(counts.refusal, "");
  }
  for (const RobotReport& robot : report.robots) {
    std::uint64_t by_seconds = 0;
    for (const CameraReport::Traffic& one : robot.cameras.front().traffic) by_seconds += one.sent_bytes;
    EXPECT_EQ(by_seconds, robot.cameras.front().sent_bytes);
  }
  expect_as_good(report, "view");
}

TEST_F(LiveSharing, of_the_global_map_gets_over_wires_that_lose_and_double_and_break) {
  badness = {0.03, 0.05, 0.02, 11};
  share(tiers::Sharing::global);
  start_cloud();
  start_edge("north", "north");
  start_robots();
  const Report report = result();
  EXPECT_GT(connected, 9U) << "wires broke";
  std::uint64_t kept = 0;
  for (const RobotReport& robot : report.robots) kept += robot.cameras.front().shared_keyframes;
  EXPECT_GT(kept, 0U);
  expect_as_good(report, "global");
}

// What cameras had no room for is at their camera map server, which goes on from its journal.
TEST_F(LiveSharing, goes_on_with_a_killed_edge_and_gets_back_what_cameras_forgot) {
  share(tiers::Sharing::view, 20);
  start_cloud();
  start_edge("north", "north");
  start_robots();
  await([&] { return sent() > 150'000; });
  end_edge("north");
  const std::uint64_t at_end = sent(), read = robots.front()->counts().records;
  await([&] { return robots.front()->counts().records > read + 10; });
  start_edge("north", "north");
  await([&] { return sent() > at_end; });
  const Report report = result();
  EXPECT_TRUE(fs::exists(folder / "cameras/north.mwj"));
  std::uint64_t forgotten = 0;
  for (const RobotReport& robot : report.robots) {
    const CameraReport& camera = robot.cameras.front();
    forgotten += camera.forgotten;
    EXPECT_LE(camera.forgotten - camera.kept, 2U) << "what was made and forgotten between two updates";
  }
  EXPECT_GT(forgotten, 5U);
  expect_as_good(report, "killed edge");
}

// It maps anew what it mapped before, and its camera map server takes that in place of the other.
TEST_F(LiveSharing, goes_on_with_a_robot_that_begins_again) {
  share(tiers::Sharing::view);
  start_cloud();
  start_edge("north", "north");
  start_robots();
  await([&] { return robots.front()->counts().sharing->sent_bytes > 100'000; });
  robots.front().reset();
  robots.erase(robots.begin());
  start_robot(plan.robots.front());
  const Report report = result();
  EXPECT_EQ(edges.at("north")->cameras_of(RobotId("alpha")), 1U);
  const LiveEdgeCounts edge = edges.at("north")->counts();
  for (const ClientCounts& client : edge.cameras->clients) EXPECT_EQ(client.refused, 0U);
  EXPECT_GT(report.robots.front().cameras.front().sent_bytes, 100'000U);
  expect_as_good(report, "begun again");
}

// The camera map server is away from the beginning to the end: nobody waits for it.
TEST_F(LiveSharing, goes_without_a_map_server_that_is_not_there) {
  share(tiers::Sharing::view);
  options.speed = 0.0;
  start_robots();
  await([&] { return robots.front()->counts().is_read && robots.back()->counts().is_read; });
  EXPECT_EQ(received(), 0U);
  start_cloud();
  start_edge("north");
  const Report report = result();
  EXPECT_EQ(borrowed(report), 0U);
  EXPECT_TRUE(report.robots.front().mapped && report.robots.back().mapped);
  EXPECT_THAT(report.notes, testing::Contains(testing::HasSubstr("camera 'front' mapped alone")));
}

matching::BinaryVocabulary other_words() {
  matching::VocabularyPictures picture;
  picture.add({matching::OrbDescriptor{}, {1, 2, 3, 4}});
  return matching::train_vocabulary(picture, {}, *make_silent_progress());
}

TEST_F(LiveSharing, refuses_who_has_other_words_and_says_so) {
  share(tiers::Sharing::view);
  start_cloud();
  start_edge("north");
  const PlannedRobot& alpha = plan.robots.front();
  RunConfiguration other = configuration_of(configuration, alpha);
  other.visual.chosen_vocabulary = matching::ChosenVocabulary(other_words());
  PlannedRobot stranger = alpha;
  stranger.configuration = std::make_shared<RunConfiguration>(other);
  start_robot(stranger);
  start_robot(plan.robots.back());
  await([&] { return !robots.front()->counts().sharing->refusal.empty(); });
  EXPECT_THAT(robots.front()->counts().sharing->refusal, testing::HasSubstr("vocabulary"));
  const Report report = result();
  EXPECT_TRUE(report.robots.front().mapped && report.robots.back().mapped);
  EXPECT_EQ(report.robots.front().cameras.front().sent_bytes, 0U);
  EXPECT_GT(report.robots.back().cameras.front().sent_bytes, 1000U);
  EXPECT_THAT(report.notes, testing::Contains(testing::HasSubstr("its edge's camera map server refused")));
}

}  // namespace
}  // namespace mapweave::runtime
