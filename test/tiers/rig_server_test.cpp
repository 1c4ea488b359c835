// Several cameras of one robot, each a client of its own, at one camera map server.
#include <support/received_updates.h>

#include <gmock/gmock.h>

namespace mapweave::tiers {
namespace {

using test::FeatureTeam;
using test::hello_of;
using test::sharing;

// One robot, whose second camera is turned by so much.
simulation::WorldOptions two_cameras(double yaw_deg, double length_m) {
  auto options = test::camera_world(simulation::PlanKind::apartment, 7, 1);
  options.cameras.push_back(options.cameras.front());
  options.cameras[0].id = "ahead";
  options.cameras[1].id = "other";
  options.cameras[1].yaw_deg = yaw_deg;
  options.cameras[1].x_m = -0.15;
  options.robots[0].last_room = 3;
  options.robots[0].length_m = length_m;
  return options;
}

rig::RigOptions without_rigs() {
  rig::RigOptions rig;
  rig.enabled = false;
  return rig;
}

std::size_t count_of(const fusion::Component& component, ConstraintKind kind) {
  return static_cast<std::size_t>(std::count_if(component.map.constraints.begin(), component.map.constraints.end(),
                                                [&](const auto& entry) { return entry.first.kind == kind; }));
}

// What a server makes of what another one received.
fusion::FusionResult sealed_again(const VisualServer& known, const rig::RigOptions& rig, int threads = 1,
                                  bool reversed = false) {
  VisualServer server(TierId("edge"), {}, {}, rig);
  VisualServer::Snapshot snapshot = known.snapshot();
  if (reversed) std::reverse(snapshot.begin(), snapshot.end());
  for (const auto& [from, update] : snapshot) {
    server.greet(hello_of(from));
    server.receive(from, update);
  }
  WorkerPool pool(threads);
  return server.seal(pool, *make_silent_progress());
}

std::string bytes_of(const fusion::FusionResult& result) {
  std::string bytes;
  for (const auto& component : result.components) bytes += encode(difference(Map{}, component.map));
  return bytes;
}

// The robot's second camera sees nothing for a while.
void blind(FeatureTeam::Robot& camera, double begin_s, double end_s) {
  camera.shoot = [see = camera.shoot, begin_s, end_s](std::size_t number) {
    FeatureTeam::Shot shot = see(number);
    const double now_s = static_cast<double>(number) / 12.0;
    if (now_s >= begin_s && now_s < end_s) {
      shot.frame.features = {};
      shot.frame.inverse_depths.clear();
    }
    return shot;
  };
}

FeatureTeam& back_to_back() {
  static FeatureTeam* const team = [] {
    auto* result = new FeatureTeam(two_cameras(180.0, 15.0), sharing(Sharing::view));
    result->run();
    return result;
  }();
  return *team;
}

TEST(RigServer, merges_cameras_that_never_see_the_same_by_extrinsic_constraints_alone) {
  FeatureTeam team(two_cameras(180.0, 15.0), sharing(Sharing::none));
  team.robots[1].shoot = test::in_other_looks(team.robots[1].shoot);
  team.run();
  const fusion::FusionResult &joined = team.server.merged(), sealed = sealed_again(team.server, {});
  EXPECT_THAT(team.server.notes(), testing::IsEmpty());
  for (const fusion::FusionResult* result : {&joined, &sealed}) {
    ASSERT_EQ(result->components.size(), 1U);
    const fusion::Component& both = result->components.front();
    EXPECT_THAT(both.members, testing::ElementsAre(MapId("alpha.ahead"), MapId("alpha.other")));
    EXPECT_GT(count_of(both, ConstraintKind::extrinsic), 50U);
    EXPECT_EQ(count_of(both, ConstraintKind::between_maps), 0U);
    EXPECT_LT(team.error_m(both), 0.03);
  }
  EXPECT_EQ(sealed_again(team.server, without_rigs()).components.size(), 2U);
}

TEST(RigServer, shares_with_each_camera_what_other_cameras_of_its_rig_made) {
  for (const auto& camera : back_to_back().robots)
    EXPECT_GT(camera.borrowed_seen, 50U) << camera.place.client.sensor.str();
}

TEST(RigServer, seals_and_joins_the_same_whatever_came_first) {
  const std::string bytes = bytes_of(sealed_again(back_to_back().server, {}));
  EXPECT_EQ(bytes, bytes_of(sealed_again(back_to_back().server, {}, 1, true)));
  EXPECT_EQ(bytes, bytes_of(sealed_again(back_to_back().server, {}, 2)));
  FeatureTeam again(two_cameras(180.0, 15.0), sharing(Sharing::view), {}, 2);
  again.run();
  EXPECT_EQ(bytes_of(again.server.merged()), bytes_of(back_to_back().server.merged()));
}

TEST(RigServer, gives_a_single_camera_the_scale_of_its_rig) {
  constexpr double kScale = 0.4;
  ServerOptions options = sharing(Sharing::full);
  options.wait = false;
  VisualServer server(TierId("edge"), options, {});
  WorkerPool pool(1);
  std::optional<SessionId> ahead, other;
  for (const auto& [from, update] : back_to_back().server.snapshot()) {
    server.greet(hello_of(from));
    const bool has_depth = from.client.sensor == SensorId("ahead");
    (has_depth ? ahead : other) = from;
    server.receive(from, has_depth ? update : encode(test::single(decode_map_update(update, "test"), kScale)));
  }
  ASSERT_TRUE(ahead && other);
  server.advance({}, pool);
  server.pending()->run();
  server.advance({}, pool);
  const MapId name("alpha.other");
  for (const fusion::FusionResult& result : {server.merged(), server.seal(pool, *make_silent_progress())}) {
    ASSERT_EQ(result.components.size(), 1U);
    const fusion::Component& both = result.components.front();
    EXPECT_EQ(both.scales.find(MapId("alpha.ahead")), nullptr);
    ASSERT_NE(both.scales.find(name), nullptr);
    EXPECT_NEAR(*both.scales.find(name), 1.0 / kScale, 0.03 / kScale);
    EXPECT_LT(back_to_back().error_m(both), 0.03);
  }
  for (const Map& map : server.maps())
    for (const auto& [id, node] : map.nodes)
      if (id.session == *ahead) {
        EXPECT_FALSE(server.share(*ahead, {map.id, node.stamp, node.map_from_node, 0}))
            << "a scale that came from it does not come back to it";
      }
  // It receives shared landmarks in its own scale, and the true scale where it is corrected.
  const std::vector<Map> maps = server.maps();
  const auto own = std::find_if(maps.begin(), maps.end(), [&](const Map& map) { return map.id == name; });
  ASSERT_NE(own, maps.end());
  const auto& [id, node] = *(own->nodes.begin() + static_cast<std::ptrdiff_t>(own->nodes.size() / 2));
  const ClientView here{name, node.stamp, node.map_from_node, 0};
  const auto corrected = server.share(*other, here), shared = server.share(*other, here);
  ASSERT_TRUE(corrected && shared);
  EXPECT_NEAR(corrected->scale, 1.0 / kScale, 0.03 / kScale);
  ASSERT_GT(corrected->corrected.size(), 20U);
  const Map& team = server.merged().components.front().map;
  ASSERT_GT(shared->landmarks.size(), 10U);
  for (const DescribedLandmark& landmark : shared->landmarks) {
    const Pose3& team_from_node = team.nodes.find(id)->map_from_node;
    const Landmark* known = team.landmarks.find(landmark.id);
    ASSERT_NE(known, nullptr);
    const Eigen::Vector3d in_team =
        transformed(known->point_in_anchor(), team.nodes.find(known->anchor)->map_from_node);
    const Eigen::Vector3d& camera_m =
        keyframe_of(node)->geometry->robot_from_camera.t;  // on the robot, whatever its map's scale
    const Eigen::Vector3d truly = transformed(in_team, inverse(team_from_node)) - camera_m,
                          published = transformed(landmark.point_in_map, inverse(node.map_from_node)) - camera_m;
    EXPECT_LT((published / kScale - truly).norm(), 0.05 * truly.norm());
  }
}

TEST(RigServer, keeps_cameras_apart_that_are_not_mounted_as_they_say) {
  auto options = two_cameras(180.0, 15.0);
  options.robots.push_back(options.robots.front());
  options.robots[1].id = "beta";
  options.robots[1].first_room = 1;
  FeatureTeam team(options, sharing(Sharing::none));
  auto& turned = team.robots[1];
  turned.place.robot_from_camera.q =
      Eigen::AngleAxisd(0.35, Eigen::Vector3d::UnitZ()) * turned.place.robot_from_camera.q;
  turned.agent.emplace(turned.place);
  team.run();
  const fusion::FusionResult sealed = sealed_again(team.server, {});
  std::size_t extrinsic_constraints = 0;
  for (const auto& component : sealed.components)
    for (const auto& [id, constraint] : component.map.constraints) {
      if (id.kind != ConstraintKind::extrinsic) continue;
      EXPECT_EQ(id.from.session.client.robot, RobotId("beta"));
      ++extrinsic_constraints;
    }
  EXPECT_GT(extrinsic_constraints, 50U) << "another robot's cameras are merged";
  EXPECT_THAT(team.server.notes(),
              testing::ElementsAre(testing::AllOf(testing::HasSubstr("robot 'alpha'"), testing::HasSubstr("20 deg"))));
  for (const auto& component : sealed.components) EXPECT_LT(team.error_m(component), 0.05);
}

// Whatever pictures say is lost on the way: nobody knows them again.
void make_strange(PlaceRequest& request) {
  std::uint64_t number = 1;
  for (auto& descriptor : request.features.descriptors)
    for (std::uint64_t& word : descriptor) word = number = number * 0x9e3779b97f4a7c15ULL + 12345;
}

TEST(RigServer, reports_to_a_lost_camera_where_its_rig_is) {
  std::map<bool, int> lost;
  for (const bool is_merged : {false, true}) {
    FeatureTeam team(two_cameras(60.0, 20.0), sharing(Sharing::view), {}, 1,
                     is_merged ? rig::RigOptions() : without_rigs());
    team.garbled = make_strange;
    auto& camera = team.robots[1];
    blind(camera, 15.0, 30.0);
    int at_sight = 0;
    while (team.round())
      if (camera.next <= 12 * 30) at_sight = camera.lost;
    lost[is_merged] = camera.lost - at_sight;
    std::printf("%s: answered %d times, placed %d times, lost for %d frames more, %zu sessions\n",
                is_merged ? "merged" : "apart", camera.answered, camera.placed, lost[is_merged],
                camera.client->sessions().size());
    EXPECT_EQ(camera.placed > 0, is_merged);
    EXPECT_EQ(camera.client->sessions().size() == 1, is_merged) << "it goes on in its own map, or begins another one";
    if (is_merged) {
      EXPECT_LT(camera.error_m(), 0.05);
    }
  }
  EXPECT_LT(lost[true], 12);
  EXPECT_GT(lost[false], 48);
}

TEST(RigServer, uses_where_a_rig_camera_said_it_was_around_that_time) {
  ServerOptions options = sharing(Sharing::view);
  options.wait = false;
  VisualServer server(TierId("edge"), options, {});
  WorkerPool pool(1);
  std::map<SensorId, SessionId> sessions;
  for (const auto& [from, update] : back_to_back().server.snapshot()) {
    sessions[from.client.sensor] = from;
    server.greet(hello_of(from));
    server.receive(from, update);
  }
  const SessionId ahead = sessions.at(SensorId("ahead")), other = sessions.at(SensorId("other"));
  const auto maps = server.maps();
  ASSERT_EQ(maps.size(), 2U);
  std::vector<const Node*> seen;  // by the one that is not lost
  for (const auto& [id, node] : maps[0].nodes) seen.push_back(&node);
  ASSERT_EQ(maps[0].id, MapId("alpha.ahead"));
  const auto ask = [&](const Node& lost) {
    PlaceRequest request{lost.stamp, *keyframe_of(lost)};
    make_strange(request);
    return server.place(other, request, pool);
  };
  EXPECT_FALSE(ask(maps[1].nodes.begin()->second)) << "nothing is joined yet";
  server.advance({}, pool);
  server.pending()->run();
  server.advance({}, pool);
  int between = 0, after = 0, too_late = 0;
  for (const auto& [id, lost] : maps[1].nodes)
    for (std::size_t i = 1; i + 1 < seen.size(); ++i) {
      if (!(seen[i]->stamp < lost.stamp && lost.stamp < seen[i + 1]->stamp)) continue;
      const double since_s = seconds_between(seen[i]->stamp, lost.stamp),
                   until_s = seconds_between(lost.stamp, seen[i + 1]->stamp);
      const auto say = [&](const Node& node) { server.share(ahead, {maps[0].id, node.stamp, node.map_from_node, 0}); };
      say(*seen[i - 1]);
      say(*seen[i]);
      const auto expect_there = [&](const std::optional<PlaceAnswer>& answer, double most_m) {
        if (!answer) return false;  // it has nothing to see there
        EXPECT_EQ(answer->map, maps[1].id);
        EXPECT_LT((answer->map_from_robot.t - lost.map_from_node.t).norm(), most_m);
        return true;
      };
      const auto late = ask(lost);
      if (since_s > 0.5) {
        EXPECT_FALSE(late) << since_s;
        ++too_late;
      } else {
        after += expect_there(late, 0.15);
      }
      if (std::min(since_s, until_s) > 0.5 || since_s + until_s > 1.5) continue;
      say(*seen[i + 1]);
      between += expect_there(ask(lost), 0.08);
    }
  std::printf("asked between two views %d times, after the last one %d times, too late %d times\n", between, after,
              too_late);
  EXPECT_GT(between, 5);
  EXPECT_GT(after, 5);
  EXPECT_GT(too_late, 0);
}

TEST(RigServer, has_a_camera_that_began_anew_in_the_same_map) {
  FeatureTeam team(two_cameras(180.0, 25.0), sharing(Sharing::view));
  blind(team.robots[1], 15.0, 30.0);
  team.run();
  EXPECT_EQ(team.robots[1].client->sessions().size(), 2U);
  ASSERT_EQ(team.server.merged().components.size(), 1U);
  const fusion::Component& all = team.server.merged().components.front();
  EXPECT_THAT(all.members, testing::ElementsAre(MapId("alpha.ahead"), MapId("alpha.other"), MapId("alpha.other.1")));
  EXPECT_LT(team.error_m(all), 0.03);
}

}  // namespace
}  // namespace mapweave::tiers
