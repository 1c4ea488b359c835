// Clients that keep what the whole team has mapped (CORB-SLAM 2.3, rule 2), with and without their server.
#include <support/landmark_sharing.h>
#include <support/received_updates.h>

#include <gmock/gmock.h>

namespace mapweave::tiers {
namespace {

using test::FeatureTeam;
using test::sharing;
using test::StarryCorridor;
using test::two_in_an_apartment;

struct Sent {
  std::map<NodeId, int> whole, light;
  std::size_t whole_bytes = 0, light_bytes = 0;  // of such shares without landmarks in view
};

// What clients are sent, without what else a share holds.
void count(const Share& share, Sent& sent) {
  for (const SharedKeyframe& keyframe : share.keyframes) {
    Share alone;
    alone.map = share.map;
    alone.keyframes = {keyframe};
    alone.keyframes.front().landmarks.clear();
    ++(keyframe.features ? sent.whole : sent.light)[keyframe.id];
    (keyframe.features ? sent.whole_bytes : sent.light_bytes) += encode(alone).size();
  }
}

// How far from the truth the keyframes of others lie in the client's map, as its own trajectory lies there, at the
// scale that this has where the camera knows none.
double error_of_shared(const FeatureTeam& team, const FeatureTeam::Robot& robot) {
  std::map<NodeId, Stamp> stamps;
  for (const Map& map : team.server.maps())
    for (const auto& [id, node] : map.nodes) stamps[id] = node.stamp;
  std::vector<matching::PointPair> own;
  for (const visual::PlacedFrame& frame : robot.client->trajectory())
    own.push_back({robot.truth.at(frame.stamp.ns), frame.map_from_camera.t});
  const auto world_from_map =
      matching::align_points(own, robot.has_depth ? matching::Freedom::rigid : matching::Freedom::similarity);
  double square = 0.0;
  std::size_t count = 0;
  for (const visual::PlacedShared& one : robot.client->shared_keyframes())
    for (const auto& other : team.robots) {
      if (!(other.place.client == one.id.session.client) || stamps.count(one.id) == 0) continue;  // culled since
      square +=
          (transformed(one.map_from_camera.t, *world_from_map) - other.truth.at(stamps.at(one.id).ns)).squaredNorm();
      ++count;
    }
  return std::sqrt(square / static_cast<double>(count));
}

TEST(GlobalMap, clients_keep_what_others_map_where_it_is_and_own_none_of_it) {
  std::map<Sharing, double> error_m;
  for (const Sharing share : {Sharing::full, Sharing::global}) {
    FeatureTeam team(two_in_an_apartment(), sharing(share));
    Sent sent;
    team.on_share = [&](const FeatureTeam::Robot&, const Share& one) { count(one, sent); };
    team.run();
    for (const auto& robot : team.robots) {
      error_m[share] += 0.5 * robot.error_m();
      const SessionId own = *robot.client->run(robot.place);
      const auto shared = robot.client->shared_keyframes();
      std::printf("%s: error %.4f m, keeps %zu keyframes of others (%.3f m off), %d lost, received %.1f kB\n",
                  robot.place.client.robot.str().c_str(), robot.error_m(), shared.size(),
                  shared.empty() ? 0.0 : error_of_shared(team, robot), robot.lost,
                  1e-3 * static_cast<double>(robot.agent->received_bytes()));
      EXPECT_EQ(shared.size() > 20, share == Sharing::global);
      std::size_t landmarks = 0;
      for (const visual::PlacedShared& one : shared) {
        EXPECT_NE(one.id.session, own);
        landmarks += one.landmarks;
      }
      if (share == Sharing::full) continue;
      EXPECT_GT(landmarks, 10 * shared.size());
      EXPECT_LT(error_of_shared(team, robot), 0.1);
      for (const Map& map : robot.client->maps(robot.place))
        for (const auto& [id, node] : map.nodes) ASSERT_EQ(id.session, own) << "nobody publishes what others made";
    }
    EXPECT_EQ(sent.whole.empty(), share == Sharing::full);
    for (const auto& [id, times] : sent.whole) EXPECT_EQ(times, 1) << "its features go once to the one other client";
    if (share == Sharing::full) continue;
    ASSERT_FALSE(sent.light.empty());
    int light = 0;
    for (const auto& [id, times] : sent.light) light += times;
    std::printf("%zu whole, %d light\n", sent.whole.size(), light);
    EXPECT_LT(20.0 * static_cast<double>(sent.light_bytes) / light,
              static_cast<double>(sent.whole_bytes) / static_cast<double>(sent.whole.size()));
  }
  EXPECT_LT(error_m[Sharing::global], 1.05 * error_m[Sharing::full]);
}

// A share that is lost on its way: the next one shows it, the client says so, and the server sends again what it had.
TEST(GlobalMap, what_was_lost_with_a_share_comes_again) {
  auto options = two_in_an_apartment();
  for (auto& robot : options.robots) robot.length_m = 15.0;
  std::map<bool, std::set<NodeId>> kept;
  for (const bool loses : {false, true}) {
    FeatureTeam team(options, sharing(Sharing::global));
    int count = 0, lost = 0;
    if (loses)
      team.is_lost = [&](const Share& share) {
        const bool is_lost = !share.keyframes.empty() && ++count % 4 == 2;
        lost += is_lost;
        return is_lost;
      };
    team.run();
    for (const auto& robot : team.robots) {
      std::printf("%s: %d shares lost, keeps %zu keyframes of others (%.3f m off), received %.1f kB\n",
                  robot.place.client.robot.str().c_str(), lost, robot.client->shared_keyframes().size(),
                  error_of_shared(team, robot), 1e-3 * static_cast<double>(robot.agent->received_bytes()));
      for (const visual::PlacedShared& one : robot.client->shared_keyframes()) kept[loses].insert(one.id);
      EXPECT_LT(error_of_shared(team, robot), 0.1);
    }
    EXPECT_EQ(lost > 5, loses);
  }
  EXPECT_GT(static_cast<double>(kept[true].size()), 0.95 * static_cast<double>(kept[false].size()));
}

// A camera without depth begins where its server places it: with keyframes of others around it, at their scale.
TEST(GlobalMap, a_single_camera_keeps_what_others_map) {
  auto options = two_in_an_apartment();
  options.robots[1] = options.robots[0];
  options.robots[1].id = "beta";
  for (auto& robot : options.robots) robot.length_m = 15.0;
  FeatureTeam team(options, sharing(Sharing::global));
  FeatureTeam::Robot& beta = team.robots[1];
  beta.has_depth = false;
  beta.options.session.await_place = true;
  beta.client.emplace(beta.camera, 0.0, beta.options, matching::shipped_vocabulary());
  beta.begin = 12 * 20;  // alpha is there first
  team.run();
  double scale = 0.0;
  const double error_m = beta.error_m(0, true, &scale);
  std::printf("beta: error %.4f m, scale %.3f, keeps %zu keyframes of alpha's (%.3f m off), %d lost\n", error_m, scale,
              beta.client->shared_keyframes().size(), error_of_shared(team, beta), beta.lost);
  EXPECT_NEAR(scale, 1.0, 0.02);
  EXPECT_LT(error_m, 0.05);
  EXPECT_GT(beta.client->shared_keyframes().size(), 10U);
  EXPECT_LT(error_of_shared(team, beta), 0.1);
  const FeatureTeam::Robot& alpha = team.robots[0];
  std::printf("alpha: error %.4f m, keeps %zu keyframes of beta's\n", alpha.error_m(),
              alpha.client->shared_keyframes().size());
  EXPECT_LT(alpha.error_m(), 0.05);
}

// Both robots' maps, each as one update.
const VisualServer::Snapshot& snapshot_of_two() {
  static const VisualServer::Snapshot snapshot = [] {
    VisualServer server(TierId("edge"), {}, {});
    for (const test::ReceivedUpdate& one : test::received_updates()) {
      server.greet(test::hello_of(one.from));
      server.receive(one.from, one.bytes);
    }
    return server.snapshot();
  }();
  return snapshot;
}

double team_scale(const fusion::Component& team, const Map& own) {
  const double* scale = team.scales.find(own.id);
  return scale == nullptr ? 1.0 : *scale;
}

Pose3 camera_of(const Node& node) {
  return compose(node.map_from_node, keyframe_of(node)->geometry->robot_from_camera);
}

// Keyframes of another map, as they should lie around one of the own ones.
void expect_in_own_scale(const fusion::Component& team, const Map& own, const Map& other, const Node& here,
                         const std::vector<SharedKeyframe>& keyframes) {
  const double scale = team_scale(team, own);
  const Eigen::Vector3d from_team = camera_of(*team.map.nodes.find(here.id)).t, from = camera_of(here).t;
  std::size_t near = 0, landmarks = 0;
  for (const SharedKeyframe& shared : keyframes) {
    EXPECT_NEAR(shared.scale, team_scale(team, other) / scale, 0.03 * shared.scale);
    const Pose3 camera_in_team = camera_of(*team.map.nodes.find(shared.id));
    if ((camera_in_team.t - from_team).norm() > 3.0) continue;  // maps bend
    ++near;
    EXPECT_NEAR(scale * (shared.map_from_camera.t - from).norm(), (camera_in_team.t - from_team).norm(), 0.1);
    for (const DescribedLandmark& landmark : shared.landmarks) {
      const Landmark* known = team.map.landmarks.find(landmark.id);
      if (known == nullptr) continue;
      const Eigen::Vector3d in_team =
          transformed(known->point_in_anchor(), team.map.nodes.find(known->anchor)->map_from_node);
      const double range_m = (in_team - camera_in_team.t).norm();
      EXPECT_NEAR(scale * (landmark.point_in_map - shared.map_from_camera.t).norm(), range_m, 0.05 * range_m);
      ++landmarks;
    }
  }
  EXPECT_GT(near, 5U);
  EXPECT_GT(landmarks, 2 * near);
}

// Maps of cameras without depth, each so many times as large as what it shows.
TEST(GlobalMap, keyframes_come_in_the_scale_of_who_keeps_them) {
  for (const auto& [alpha_scale, beta_scale] : {std::pair(1.0, 0.4), std::pair(1.7, 0.4)}) {
    const std::map<RobotId, double> scales{{RobotId("alpha"), alpha_scale}, {RobotId("beta"), beta_scale}};
    ServerOptions options = sharing(Sharing::global);
    options.wait = false;
    VisualServer server(TierId("edge"), options, {});
    WorkerPool pool(1);
    std::map<RobotId, SessionId> sessions;
    for (const auto& [from, bytes] : snapshot_of_two()) {
      const RobotId& robot = from.client.robot;
      sessions[robot] = from;
      server.greet(test::hello_of(from));
      MapUpdate update = decode_map_update(bytes, "test");
      if (scales.at(robot) != 1.0) update = test::single(std::move(update), scales.at(robot));
      server.receive(from, encode(update));
    }
    server.advance({}, pool);
    server.pending()->run();
    server.advance({}, pool);
    ASSERT_EQ(server.merged().components.size(), 1U);
    const fusion::Component& team = server.merged().components.front();
    const std::vector<Map> maps = server.maps();
    ASSERT_EQ(maps.size(), 2U);
    EXPECT_NEAR(team_scale(team, maps[1]) / team_scale(team, maps[0]), alpha_scale / beta_scale,
                0.05 * alpha_scale / beta_scale);
    for (const std::size_t i : {0U, 1U}) {
      const Map& own = maps[i];
      const Node& here = std::next(own.nodes.begin(), static_cast<std::ptrdiff_t>(own.nodes.size() / 2))->second;
      ClientView view{own.id, here.stamp, here.map_from_node, 0};
      view.room = 300;
      std::vector<SharedKeyframe> keyframes;
      for (int times = 0; times < 40; ++times)
        if (const auto share = server.share(sessions.at(own.robots().front()), view))
          for (const SharedKeyframe& shared : share->keyframes)
            if (shared.features) keyframes.push_back(shared);
      expect_in_own_scale(team, own, maps[1 - i], here, keyframes);
    }
  }
}

simulation::WorldOptions two_cameras_of_one_robot(double yaw_deg, double length_m) {
  auto options = test::camera_world(simulation::PlanKind::apartment, 7, 2);
  options.cameras.push_back(options.cameras.front());
  options.cameras[0].id = "ahead";
  options.cameras[1].id = "other";
  options.cameras[1].yaw_deg = yaw_deg;
  options.cameras[1].x_m = -0.15;
  for (auto& robot : options.robots) {
    robot.last_room = 3;
    robot.length_m = length_m;
  }
  options.robots[1].first_room = 1;
  return options;
}

// Each of two robots has two cameras that look to opposite sides; the second one of alpha may know no depth.
TEST(GlobalMap, cameras_of_one_robot_keep_what_the_other_maps) {
  for (const bool has_single : {false, true}) {
    FeatureTeam team(two_cameras_of_one_robot(180.0, 12.0), sharing(Sharing::global));
    if (has_single) team.robots[1].has_depth = false;
    team.run();
    EXPECT_THAT(team.server.notes(), testing::IsEmpty());
    for (const auto& robot : team.robots) {
      const ClientId& own = robot.place.client;
      std::map<ClientId, std::size_t> kept;
      for (const visual::PlacedShared& one : robot.client->shared_keyframes()) ++kept[one.id.session.client];
      double scale = 0.0;
      const double error_m = robot.error_m(0, !robot.has_depth, &scale);
      std::printf("%s.%s: error %.4f m, scale %.3f, %.3f m off, keeps", own.robot.str().c_str(),
                  own.sensor.str().c_str(), error_m, scale, error_of_shared(team, robot));
      for (const auto& [client, count] : kept)
        std::printf(" %zu of %s.%s", count, client.robot.str().c_str(), client.sensor.str().c_str());
      std::printf("\n");
      for (const auto& other : team.robots) {
        const ClientId& client = other.place.client;
        // Its scale came from this one: it would come to rest on it.
        const bool is_withheld = client == own || (!other.has_depth && client.robot == own.robot);
        EXPECT_EQ(kept.count(client), is_withheld ? 0U : 1U) << own.sensor.str() << " of " << client.sensor.str();
      }
      EXPECT_LT(error_m, 0.05);
      EXPECT_NEAR(scale, 1.0, 0.02);
      EXPECT_LT(error_of_shared(team, robot), 0.1);
    }
  }
}

// Maps that were one and are not any longer: nobody is to be found, or to close a loop, by what came of that.
TEST(GlobalMap, goes_where_a_merge_is_taken_back) {
  auto options = two_in_an_apartment();
  for (auto& robot : options.robots) robot.length_m = 15.0;
  FeatureTeam team(options, sharing(Sharing::global));
  const auto kept = [&](const FeatureTeam::Robot& robot) { return robot.client->shared_keyframes().size(); };
  while (team.round() && (kept(team.robots[0]) < 10 || kept(team.robots[1]) < 10)) {}
  ASSERT_GE(std::min(kept(team.robots[0]), kept(team.robots[1])), 10U);
  team.server.refuse({{RobotId("alpha"), RobotId("beta")}});
  team.run();
  EXPECT_EQ(team.server.merged().components.size(), 2U);
  for (const auto& robot : team.robots) {
    EXPECT_EQ(kept(robot), 0U) << robot.place.client.robot.str();
    EXPECT_EQ(robot.client->borrowed(), 0U) << robot.place.client.robot.str();
  }
}

TEST(GlobalMap, does_not_depend_on_threads) {
  std::string bytes[2];
  for (const int threads : {1, 2}) {
    auto options = two_in_an_apartment();
    for (auto& robot : options.robots) robot.length_m = 12.0;
    FeatureTeam team(options, sharing(Sharing::global), {}, threads);
    team.on_share = [&](const FeatureTeam::Robot&, const Share& share) { bytes[threads - 1] += encode(share); };
    team.run();
    EXPECT_FALSE(team.robots.front().client->shared_keyframes().empty());
  }
  EXPECT_EQ(bytes[0], bytes[1]);
}

TEST(GlobalMap, keeps_within_a_clients_wire) {
  auto options = two_in_an_apartment();
  for (auto& robot : options.robots) robot.length_m = 15.0;
  ServerOptions narrow = sharing(Sharing::global);
  narrow.most_bytes_per_s = 3000.0;
  FeatureTeam team(options, narrow);
  team.run();
  for (const auto& robot : team.robots) {
    const double seconds = static_cast<double>(robot.next) / 12.0,
                 bytes_per_s = static_cast<double>(robot.agent->received_bytes()) / seconds;
    std::printf("%.0f B/s, %zu keyframes\n", bytes_per_s, robot.client->shared_keyframes().size());
    EXPECT_LT(bytes_per_s, 1.1 * narrow.most_bytes_per_s);
    EXPECT_GT(robot.client->shared_keyframes().size(), 0U);
  }
}

TEST(GlobalMap, clients_keep_the_nearest_where_there_is_no_room_for_all) {
  constexpr int kRoom = 10;
  FeatureTeam team(two_in_an_apartment(), sharing(Sharing::global));
  for (auto& robot : team.robots) {
    robot.options.memory.shared_keyframes = kRoom;
    robot.client.emplace(robot.camera, 0.0, robot.options, matching::shipped_vocabulary());
  }
  std::size_t most = 0, dropped = 0;
  while (team.round())
    for (const auto& robot : team.robots) most = std::max(most, robot.client->shared_keyframes().size());
  team.finish();
  for (const auto& robot : team.robots) dropped += robot.client->dropped_shared();
  std::printf("at most %zu, %zu dropped\n", most, dropped);
  EXPECT_EQ(most, static_cast<std::size_t>(kRoom));
  EXPECT_GT(dropped, 0U);
  for (const auto& robot : team.robots) EXPECT_LT(robot.error_m(), 0.05);
}

// Alpha has driven down the corridor. Beta sees its beginning, is cut off, carried with its lens covered to where only
// alpha was, and drives on there.
TEST(GlobalMap, a_client_that_is_cut_off_is_found_again_where_another_was) {
  constexpr std::size_t kSeen = 100, kStands = 180, kDark = 200, kThere = 60;
  constexpr int kLate = 400;  // frames after alpha's first one
  constexpr double kStep_m = 0.04;
  for (const Sharing share : {Sharing::full, Sharing::global}) {
    FeatureTeam team(sharing(share));
    StarryCorridor first(1), second(2);
    team.add(test::place_of("alpha"), first.camera, 450, [&](std::size_t i) {
      const Pose3 there{{0.0, 0.0, kStep_m * static_cast<double>(i)}, Eigen::Quaterniond::Identity()};
      return FeatureTeam::Shot{first.frame(test::at(static_cast<int>(i)), there, 0.2, 0.002), there};
    });
    team.add(test::place_of("beta"), second.camera, kSeen + kStands + kDark + kThere, [&](std::size_t i) {
      const std::size_t steps = std::min(i, kSeen) + (i > kSeen + kStands ? i - kSeen - kStands : 0);
      const Pose3 there{{0.1, 0.0, kStep_m * static_cast<double>(steps)}, Eigen::Quaterniond::Identity()};
      FeatureTeam::Shot shot{second.frame(test::at(kLate + static_cast<int>(i)), there, 0.2, 0.002), there};
      shot.frame.odometry_from_camera = there;
      if (i >= kSeen + kStands && i < kSeen + kStands + kDark) {
        shot.frame.features = {};
        shot.frame.inverse_depths.clear();
      }
      return shot;
    });
    FeatureTeam::Robot& beta = team.robots[1];
    beta.begin = kLate;
    while (team.round()) beta.cut_off = beta.next >= kSeen + kStands;
    const auto last = beta.client->trajectory().back();
    std::printf("beta keeps %zu keyframes of alpha's, %zu times found by them, %zu sessions, %d frames lost\n",
                beta.client->shared_keyframes().size(), beta.client->found_by_shared(), beta.client->sessions().size(),
                beta.lost);
    if (share == Sharing::global) {
      EXPECT_GE(beta.client->found_by_shared(), 1U);
      EXPECT_EQ(last.session, 0);
      EXPECT_LT((last.map_from_camera.t - Eigen::Vector3d(0, 0, kStep_m * (kSeen + kDark + kThere - 1))).norm(), 0.2);
      EXPECT_LT(beta.lost, static_cast<int>(kDark) + 10);
    } else {
      EXPECT_FALSE(last.session == 0 && last.stamp == beta.last) << "nothing that it has itself shows where it is";
    }
  }
}

// CORB-SLAM, figure 5, without the server: a corridor that closes on itself, and beta, who has driven around it, comes
// to where alpha was before beta was cut off.
TEST(GlobalMap, a_client_that_is_cut_off_closes_a_loop_on_anothers_keyframes) {
  constexpr double kStep_m = 0.06, kAround_m = 2.0 * M_PI * StarryCorridor::kRadius_m;
  constexpr std::size_t kCutAt = 330;  // frames
  std::map<Sharing, double> error_m;
  for (const Sharing share : {Sharing::none, Sharing::global}) {
    ServerOptions options = sharing(share);
    options.correct_m = 100.0;
    FeatureTeam team(options);
    StarryCorridor good(1, true), poor(2, true);
    const auto drive = [&](StarryCorridor& corridor, const char* name, double begin_m, double end_m, double noise) {
      visual::ClientOptions seeing;
      seeing.window.learn_depth_offset = false;
      team.add(
          test::place_of(name), corridor.camera, static_cast<std::size_t>((end_m - begin_m) / kStep_m),
          [=, &corridor](std::size_t i) {
            const Pose3 there = StarryCorridor::along_ring(begin_m + kStep_m * static_cast<double>(i));
            return FeatureTeam::Shot{
                corridor.frame(test::at(static_cast<int>(i)), there, noise, 0.01 * noise, 0.01 * noise), there};
          },
          seeing);
    };
    drive(good, "alpha", -9.0, 9.0, 0.02);
    drive(poor, "beta", 2.0, kAround_m - 2.0, 1.0);
    FeatureTeam::Robot& beta = team.robots[1];
    while (team.round()) beta.cut_off = beta.next >= kCutAt;
    beta.client->finish();
    error_m[share] = beta.error_m();
    std::size_t on_shared = 0;
    for (const visual::ClosedLoop& loop : beta.client->loops()) on_shared += loop.on_shared.has_value();
    std::printf("beta: error %.3f m, keeps %zu keyframes of alpha's, %zu loops on them, %d lost\n", beta.error_m(),
                beta.client->shared_keyframes().size(), on_shared, beta.lost);
    EXPECT_EQ(on_shared > 0, share == Sharing::global);
    EXPECT_EQ(beta.client->loops().size(), on_shared) << "it saw nothing of its own again";
  }
  EXPECT_LT(error_m[Sharing::global], 0.8 * error_m[Sharing::none]);
}

}  // namespace
}  // namespace mapweave::tiers
