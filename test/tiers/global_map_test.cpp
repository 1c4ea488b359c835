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

// How far from the truth the keyframes of others lie in the client's map, as its own trajectory lies there.
double error_of_shared(const FeatureTeam& team, const FeatureTeam::Robot& robot) {
  std::map<NodeId, Stamp> stamps;
  for (const Map& map : team.server.maps())
    for (const auto& [id, node] : map.nodes) stamps[id] = node.stamp;
  std::vector<matching::PointPair> own;
  for (const visual::PlacedFrame& frame : robot.client->trajectory())
    own.push_back({robot.truth.at(frame.stamp.ns), frame.map_from_camera.t});
  const auto world_from_map = matching::align_points(own, matching::Freedom::rigid);
  double square = 0.0;
  const auto shared = robot.client->shared_keyframes();
  for (const visual::PlacedShared& one : shared)
    for (const auto& other : team.robots)
      if (other.place.client == one.id.session.client)
        square += (transformed(one.map_from_camera.t, world_from_map->pose) - other.truth.at(stamps.at(one.id).ns))
                      .squaredNorm();
  return std::sqrt(square / static_cast<double>(shared.size()));
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
