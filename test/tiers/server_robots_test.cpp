// Where a robot is by all of its cameras, as their camera map server knows it.
#include <mapweave/core/error.h>
#include <mapweave/core/stamped_pose.h>
#include <support/received_updates.h>

#include <gmock/gmock.h>

namespace mapweave::tiers {
namespace {

using test::FeatureTeam;
using test::hello_of;
using test::sharing;

const RobotId kAlpha("alpha");
const SensorId kAhead("ahead"), kBack("back"), kAside("aside");

FeatureTeam& three_cameras() {
  static FeatureTeam* const team = [] {
    auto options = test::camera_world(simulation::PlanKind::apartment, 7, 1);
    options.cameras.resize(3, options.cameras.front());
    options.cameras[0].id = kAhead.str();
    options.cameras[1].id = kBack.str();
    options.cameras[1].yaw_deg = 180.0;
    options.cameras[1].x_m = -0.15;
    options.cameras[2].id = kAside.str();
    options.cameras[2].yaw_deg = 60.0;
    options.cameras[2].y_m = 0.15;
    options.robots[0].last_room = 3;
    options.robots[0].length_m = 12.0;
    auto* result = new FeatureTeam(options, sharing(Sharing::none));
    result->run();
    return result;
  }();
  return *team;
}

struct Said {
  SensorId camera;
  ClientView view;
  double seconds;  // since the first frame
};

// Twice a second, each camera so much after the one before.
std::vector<Said> said(std::size_t frames_between) {
  std::vector<Said> all;
  std::size_t behind = 0;
  for (const auto& robot : three_cameras().robots) {
    const Stamp begin = robot.client->trajectory().front().stamp;
    for (const visual::PlacedFrame& frame : robot.client->trajectory()) {
      const double seconds = seconds_between(begin, frame.stamp);
      if (static_cast<std::size_t>(std::lround(12.0 * seconds)) % 6 != behind) continue;
      const Pose3 map_from_robot = compose(compose(robot.place.robot_from_camera, frame.map_from_camera),
                                           inverse(robot.place.robot_from_camera));
      all.push_back({robot.place.client.sensor,
                     {visual::map_of(robot.place.client, frame.session), frame.stamp, map_from_robot, 0},
                     seconds});
    }
    behind += frames_between;
  }
  std::stable_sort(all.begin(), all.end(), [](const Said& a, const Said& b) { return a.view.stamp < b.view.stamp; });
  return all;
}

// What a server makes of it that shares nothing. `changed`: updates, on the way.
struct Replay {
  VisualServer server;
  WorkerPool pool{1};
  std::map<SensorId, SessionId> sessions;

  explicit Replay(const rig::RigOptions& rig = {}, const std::function<bool(MapUpdate&)>& changed = {})
      : server(TierId("edge"), sharing(Sharing::none), {}, rig) {
    for (const auto& [from, bytes] : three_cameras().server.snapshot()) {
      MapUpdate update = decode_map_update(bytes, "test");
      if (changed && !changed(update)) continue;
      sessions[from.client.sensor] = from;
      server.greet(hello_of(from));
      server.receive(from, encode(update));
    }
  }
  void join() {
    server.advance({0}, pool);
    server.advance({std::int64_t{1} << 60}, pool);
  }
  void say(const Said& one) { EXPECT_FALSE(server.share(sessions.at(one.camera), one.view)); }
};

// Answers beside what is true.
struct Received {
  std::vector<RobotInTeam> answers;
  std::vector<double> seconds;
  std::vector<Pose3> off;
  int late = 0;  // of a moment before the newest view

  Received(Replay& replay, const std::vector<Said>& all) {
    const auto& ahead = three_cameras().robots[0];
    std::map<Stamp, Pose3> world_from_robot;
    for (std::size_t i = 0; i < ahead.count; ++i) {
      const auto shot = ahead.shoot(i);
      world_from_robot[shot.frame.stamp] = compose(shot.world_from_camera, inverse(ahead.place.robot_from_camera));
    }
    for (const Said& one : all) {
      replay.say(one);
      const auto answer = replay.server.robot(kAlpha);
      if (!answer) continue;
      late += answer->stamp != one.view.stamp;
      answers.push_back(*answer);
      seconds.push_back(one.seconds);
    }
    // The team's frame is that of the camera that began first, or one that began with it.
    const Pose3 world_from_team = world_from_robot.begin()->second;
    for (const RobotInTeam& answer : answers)
      off.push_back(between(world_from_robot.at(answer.stamp), compose(world_from_team, answer.team_from_robot)));
  }
  double farthest_m() const {
    double farthest = 0.0;
    for (const Pose3& one : off) farthest = std::max(farthest, one.t.norm());
    return farthest;
  }
  double farthest_rad() const {
    double farthest = 0.0;
    for (const Pose3& one : off) farthest = std::max(farthest, one.q.angularDistance(Eigen::Quaterniond::Identity()));
    return farthest;
  }
  // Share of answers of a time that rest on so many cameras.
  double share(int cameras, double begin_s, double end_s) const {
    double count = 0.0, all = 0.0;
    for (std::size_t i = 0; i < answers.size(); ++i) {
      if (seconds[i] < begin_s || seconds[i] > end_s) continue;
      ++all;
      if (answers[i].cameras == cameras) ++count;
    }
    return count / all;
  }
};

TEST(ServerRobots, knows_a_robot_by_all_of_its_cameras_whether_or_not_they_speak_together) {
  for (const std::size_t frames_between : {0, 1, 2}) {
    Replay replay;
    replay.join();
    ASSERT_EQ(replay.server.merged().components.size(), 1U);
    const Received received(replay, said(frames_between));
    std::printf("%zu frames between cameras: %.3f m, %.3f rad off at most, %d of %zu answers late\n", frames_between,
                received.farthest_m(), received.farthest_rad(), received.late, received.answers.size());
    EXPECT_LT(received.farthest_m(), 0.06);
    EXPECT_LT(received.farthest_rad(), 0.05);
    EXPECT_LT(received.late, 6);
    // The third one is lost from the seventh second on, begins another map in the 33rd, and is lost once more in the
    // 47th.
    EXPECT_GT(received.share(3, 1.0, 7.0), 0.9);
    EXPECT_GT(received.share(2, 8.5, 33.0), 0.9);
    EXPECT_GT(received.share(3, 35.0, 47.0), 0.9);
    EXPECT_GT(received.share(2, 48.5, 53.0), 0.9);
    for (const RobotInTeam& answer : received.answers) EXPECT_EQ(answer.team, MapId("alpha.ahead"));
  }
}

std::vector<Said> without(std::vector<Said> all, const std::function<bool(const Said&)>& dropped) {
  all.erase(std::remove_if(all.begin(), all.end(), dropped), all.end());
  return all;
}

TEST(ServerRobots, goes_on_by_one_camera_where_another_falls_silent) {
  for (const SensorId& silent : {kAhead, kBack}) {
    Replay replay;
    replay.join();
    const Received received(replay, without(said(1), [&](const Said& one) {
                              return one.camera == kAside ||
                                     (one.camera == silent && one.seconds > 10.0 && one.seconds < 20.0);
                            }));
    EXPECT_GT(received.share(2, 1.0, 10.0), 0.9);
    EXPECT_EQ(received.share(1, 11.5, 20.0), 1.0);
    EXPECT_GT(received.share(2, 21.0, 50.0), 0.9);
    EXPECT_LT(received.farthest_m(), 0.07);
    EXPECT_LT(received.farthest_rad(), 0.05);
    EXPECT_LT(received.late, 6);
  }
}

TEST(ServerRobots, does_not_follow_one_of_three_that_errs) {
  struct Error {
    std::size_t frames_between;
    double aside_m;
  };
  for (const Error& error : {Error{0, 1.4}, Error{2, 1.4}, Error{2, 0.8}})
    for (const SensorId& errs : {kAhead, kBack, kAside}) {
      Replay replay;
      replay.join();
      std::vector<Said> all = without(said(error.frames_between), [](const Said& one) { return one.seconds > 6.9; });
      for (Said& one : all)
        if (one.camera == errs && one.seconds > 3.0) one.view.map_from_robot.t.y() += error.aside_m;
      const Received received(replay, all);
      EXPECT_GT(received.share(3, 1.0, 2.9), 0.9);
      EXPECT_EQ(received.share(2, 4.1, 7.0), 1.0);
      EXPECT_LT(received.farthest_m(), 0.06) << errs.str() << ", " << error.aside_m << " m aside";
    }
}

TEST(ServerRobots, receives_from_cameras_of_one_map_alone) {
  rig::RigOptions without_rigs;
  without_rigs.enabled = false;
  // By another light: nobody knows again what it sees.
  Replay replay(without_rigs, [](MapUpdate& update) {
    for (Node& node : update.nodes) {
      KeyframeFeatures features = *keyframe_of(node);
      if (node.id.session.client.sensor == kAside)
        for (auto& descriptor : features.descriptors)
          for (std::size_t word = 0; word < descriptor.size(); ++word)
            descriptor[word] ^= (word + 1) * 0x9e3779b97f4a7c15ULL;
      node.payload = std::make_shared<const Payload>(std::move(features));
    }
    return true;
  });
  replay.join();
  const auto& components = replay.server.merged().components;
  ASSERT_THAT(components.front().members, testing::ElementsAre(MapId("alpha.ahead"), MapId("alpha.back")));
  const std::vector<Said> all = said(1);
  const Received together(replay, without(all, [](const Said& one) { return one.seconds > 6.9; }));
  EXPECT_GT(together.share(2, 1.0, 7.0), 0.9);
  EXPECT_EQ(together.share(3, 0.0, 7.0), 0.0);
  EXPECT_LT(together.farthest_m(), 0.06);
  for (const RobotInTeam& answer : together.answers) EXPECT_EQ(answer.team, MapId("alpha.ahead"));
  // Where all but one are silent, it speaks of its own map.
  Said alone =
      *std::find_if(all.begin(), all.end(), [](const Said& one) { return one.camera == kAside && one.seconds > 40.0; });
  replay.say(alone);
  const auto answer = replay.server.robot(kAlpha);
  ASSERT_TRUE(answer);
  EXPECT_EQ(answer->team, alone.view.map);
  EXPECT_EQ(answer->cameras, 1);
  EXPECT_LT((answer->team_from_robot.t - alone.view.map_from_robot.t).norm(), 0.01);
  // Of as many here as there, those that spoke last.
  Said after = *std::find_if(all.begin(), all.end(),
                             [&](const Said& one) { return one.camera == kBack && one.seconds > alone.seconds; });
  replay.say(after);
  ASSERT_TRUE(replay.server.robot(kAlpha));
  EXPECT_EQ(replay.server.robot(kAlpha)->team, MapId("alpha.ahead"));
}

TEST(ServerRobots, receives_from_the_newest_run_of_each_camera) {
  Replay replay;
  replay.join();
  for (const Said& one : without(said(0), [](const Said& one) { return one.seconds > 3.0; })) replay.say(one);
  ASSERT_TRUE(replay.server.robot(kAlpha));
  EXPECT_EQ(replay.server.robot(kAlpha)->cameras, 3);
  SessionId again = replay.sessions.at(kBack);
  again.run += 3'000'000'000;
  replay.server.greet(hello_of(again));
  ASSERT_TRUE(replay.server.robot(kAlpha));
  EXPECT_EQ(replay.server.robot(kAlpha)->cameras, 2) << "it begins anew, and has not said where it is";
  replay.server.leave(again);
  EXPECT_EQ(replay.server.robot(kAlpha)->cameras, 3);
  SessionId before = replay.sessions.at(kBack);
  before.run -= 3'000'000'000;
  replay.server.greet(hello_of(before));
  EXPECT_EQ(replay.server.robot(kAlpha)->cameras, 3);
}

TEST(ServerRobots, does_not_know_who_said_nothing_or_is_in_no_joined_map) {
  Replay replay;
  const std::vector<Said> all = said(0);
  replay.say(all.front());
  EXPECT_FALSE(replay.server.robot(kAlpha)) << "nothing is joined yet";
  replay.join();
  ASSERT_TRUE(replay.server.robot(kAlpha)) << "what was said before counts";
  EXPECT_EQ(replay.server.robot(kAlpha)->stamp, all.front().view.stamp);
  EXPECT_FALSE(replay.server.robot(RobotId("alph")));
  EXPECT_FALSE(replay.server.robot(RobotId("alpha2")));
  EXPECT_FALSE(replay.server.robot(RobotId()));
  for (const auto& [camera, session] : replay.sessions) replay.server.leave(session);
  EXPECT_FALSE(replay.server.robot(kAlpha)) << "all have gone";
  Said elsewhere = all.front();
  elsewhere.view.map = MapId("alpha." + elsewhere.camera.str() + ".7");
  replay.say(elsewhere);
  EXPECT_FALSE(replay.server.robot(kAlpha)) << "nobody knows that map";
  Said never = all.front();
  never.view.stamp = {std::numeric_limits<std::int64_t>::max()};
  replay.say(never);
  EXPECT_FALSE(replay.server.robot(kAlpha)) << "no clock shows that";
}

TEST(ServerRobots, receives_from_a_client_that_is_sent_nothing_now) {
  Replay replay;
  replay.join();
  const Said first = said(0).front();
  replay.server.note(replay.sessions.at(first.camera), first.view);
  ASSERT_TRUE(replay.server.robot(kAlpha));
  EXPECT_EQ(replay.server.robot(kAlpha)->stamp, first.view.stamp);
  ClientView foreign = first.view;
  foreign.map = MapId("beta.ahead");
  EXPECT_THROW(replay.server.note(replay.sessions.at(first.camera), foreign), Error);
  EXPECT_THROW(replay.server.note({{RobotId("beta"), kAhead}, 1}, first.view), Error);
}

TEST(ServerRobots, knows_a_robot_with_one_camera) {
  Replay replay({}, [](const MapUpdate& update) { return update.nodes.front().id.session.client.sensor == kBack; });
  replay.join();
  const Received received(replay, without(said(0), [](const Said& one) { return one.camera != kBack; }));
  EXPECT_GT(received.answers.size(), 100U);
  EXPECT_EQ(received.share(1, 0.0, 100.0), 1.0);
  EXPECT_EQ(received.late, 0);
  EXPECT_LT(received.farthest_m(), 0.1);
}

TEST(ServerRobots, knows_a_robot_by_a_camera_without_depth_of_unknown_scale) {
  constexpr double kScale = 0.4;
  Replay replay({}, [](MapUpdate& update) {
    const SensorId camera = update.nodes.front().id.session.client.sensor;
    if (camera == kBack) update = test::single(update, kScale);
    return camera != kAside;
  });
  replay.join();
  ASSERT_EQ(replay.server.merged().components.size(), 1U);
  ASSERT_NE(replay.server.merged().components.front().scales.find(MapId("alpha.back")), nullptr);
  const Eigen::Vector3d back_m = three_cameras().robots[1].place.robot_from_camera.t;
  std::vector<Said> all = without(said(0), [](const Said& one) { return one.camera != kBack; });
  for (Said& one : all) one.view.map_from_robot = test::single(one.view.map_from_robot, back_m, kScale);
  const Received received(replay, all);
  EXPECT_GT(received.answers.size(), 100U);
  std::printf("%.3f m off at most\n", received.farthest_m());
  EXPECT_LT(received.farthest_m(), 0.1);
}

}  // namespace
}  // namespace mapweave::tiers
