#include <gtest/gtest.h>
#include <mapweave/core/median.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/maps/map_update.h>
#include <mapweave/rig/aligned_trajectories.h>
#include <mapweave/rig/laser_camera_alignment.h>
#include <support/simulated_maps.h>
#include <support/starry_maps.h>

#include <algorithm>
#include <set>

namespace mapweave::fusion {
namespace {

std::vector<Pose2> path_of(const simulation::SimulatedRobot& robot, const Pose2& start) {
  std::vector<Pose2> path;
  for (std::size_t i = 0; i < robot.steps.size(); i += 15)
    path.push_back(compose(start, between(robot.steps.front().world_from_robot, robot.steps[i].world_from_robot)));
  return path;
}

// A robot's walls and stars. The camera's world is laid so that the robot stands at `stars_from_start` when it begins.
Map of_two_senses(const simulation::SimulatedRobot& robot, const simulation::SimulatedLaserOptions& laser,
                  const test::StarryBuilding& stars, const Pose2& stars_from_start) {
  Map camera = stars.keyframe_map(robot.id.str(), path_of(robot, stars_from_start));
  for (auto& entry : camera.nodes) entry.second.stamp = robot.steps[15 * entry.first.index].stamp;
  return rig::align_cameras(test::truth_map(robot, laser), {camera}).map;
}

FusionResult fused(std::vector<Map> maps, const FusionOptions& options = {}, int threads = 2) {
  WorkerPool pool(threads);
  Memo memo;
  const auto progress = make_silent_progress();
  return fuse({std::move(maps), {}, TierId("cloud")}, options, memo, pool, *progress);
}

FusionOptions adjusted(int rounds) {
  FusionOptions options;
  options.visual.adjustments = rounds;
  return options;
}

TEST(LaserCameraFusion, joins_robots_by_both_senses_in_one_graph) {
  simulation::TeamOptions options;
  options.shared = 0.6;
  const auto team = simulation::make_apartment({}, options);
  const test::StarryBuilding stars({1, 2}, 2500);
  std::vector<Map> maps;
  for (const auto& robot : team.robots)
    maps.push_back(of_two_senses(robot, team.laser, stars, robot.steps.front().world_from_robot));
  const auto result = fused(maps);
  ASSERT_EQ(result.components.size(), 1U) << to_text(result.verdicts[0].reason);
  EXPECT_EQ(result.verdicts[0].kind, "laser and vision");
  const Pose2 truth =
                  between(team.robots[0].steps.front().world_from_robot, team.robots[1].steps.front().world_from_robot),
              pose = planar(*result.components[0].team_from_map.find(MapId("robot1")));
  EXPECT_LT(std::hypot(pose.x - truth.x, pose.y - truth.y), 0.05);
}

double off_m(const test::StarryBuilding& stars, const Eigen::Vector3d& point) {
  return (stars.point(stars.nearest(point)) - point).norm();
}

// A robot of two senses and one that has a camera alone, in one flat.
struct OneOfTwoSenses {
  simulation::SimulatedTeam team = [] {
    simulation::TeamOptions options;
    options.shared = 1.0;
    return simulation::make_apartment({}, options);
  }();
  test::StarryBuilding stars{{1, 2}, 2500};
  Map both = of_two_senses(team.robots[0], team.laser, stars, team.robots[0].steps.front().world_from_robot);
  std::vector<Pose2> path = path_of(team.robots[1], team.robots[1].steps.front().world_from_robot);

  Map camera_alone(const char* name, const test::StarryOptions& options) const {
    return stars.keyframe_map(name, path, options);
  }
  Map camera_of_both() const {
    return stars.keyframe_map(team.robots[0].id.str(),
                              path_of(team.robots[0], team.robots[0].steps.front().world_from_robot));
  }

  struct Error {
    double keyframe_m = 0.0, heading_rad = 0.0,
           landmark_m = 0.0;  // of keyframes the greatest, of landmarks the middle one
  };
  // After the keyframes of both were laid on the truth by one rigid alignment. true_scale: the map that the camera
  // alone would have drawn, had it known its scale and how it turned.
  std::pair<Error, Error> errors(const Component& component, const Map& true_scale) const {
    const Map& joined = component.map;
    const Map own = camera_of_both();
    const auto truth_of = [&](const Map& map, const Pose2& start) {
      std::map<NodeId, Pose3> truth;
      for (const auto& [id, node] : map.nodes) truth.emplace(id, compose(spatial(start), node.map_from_node));
      return truth;
    };
    const std::map<NodeId, Pose3> truth_own = truth_of(own, team.robots[0].steps.front().world_from_robot),
                                  truth_alone = truth_of(true_scale, path.front());
    std::vector<rig::CommonPose> pairs;
    for (const auto* truth : {&truth_own, &truth_alone})
      for (const auto& [id, pose] : *truth) pairs.push_back({pose, joined.nodes.find(id)->map_from_node});
    const Pose3 world_from_team = rig::aligned(pairs, 1.0).pose;
    const auto error = [&](const Map& map, const std::map<NodeId, Pose3>& truth) {
      Error result;
      for (const auto& [id, pose] : truth) {
        const Pose3 placed = compose(world_from_team, joined.nodes.find(id)->map_from_node);
        result.keyframe_m = std::max(result.keyframe_m, (placed.t - pose.t).norm());
        result.heading_rad = std::max(result.heading_rad, placed.q.angularDistance(pose.q));
      }
      std::vector<double> apart;
      for (const auto& [id, own_landmark] : map.landmarks) {
        const LandmarkId* same = component.same_as.find(id);
        const Landmark& landmark = *joined.landmarks.find(same != nullptr ? *same : id);
        const Pose3 placed = compose(world_from_team, joined.nodes.find(landmark.anchor)->map_from_node);
        apart.push_back(off_m(stars, transformed(landmark.point_in_anchor(), placed)));
      }
      result.landmark_m = median(std::move(apart));
      return result;
    };
    return {error(own, truth_own), error(true_scale, truth_alone)};
  }
};

TEST(LaserCameraFusion, bends_all_of_a_depth_cameras_map_to_a_robot_with_a_laser) {
  OneOfTwoSenses flat;
  flat.path.resize(24);
  test::StarryOptions bent;
  bent.drift_rad_per_keyframe = 0.0015;
  const Map alone = flat.camera_alone("robot1", bent);
  const auto result = fused({flat.both, alone});
  ASSERT_EQ(result.components.size(), 1U) << to_text(result.verdicts[0].reason);
  const auto [of_both, of_alone] = flat.errors(result.components[0], flat.camera_alone("robot1", {}));
  EXPECT_LT(of_both.keyframe_m, 0.05);
  EXPECT_LT(of_both.landmark_m, 0.05);
  EXPECT_LT(of_alone.keyframe_m, 0.06);
  EXPECT_LT(of_alone.heading_rad, 0.015);
  EXPECT_LT(of_alone.landmark_m, 0.05);
  EXPECT_EQ(result.components[0].scales.size(), 0U);
}

TEST(LaserCameraFusion, weighs_what_a_camera_saw_as_the_options_say) {
  const OneOfTwoSenses flat;
  FusionOptions options;
  options.laser_cameras.covisibility_sigma_m = 0.5;
  const auto scan_matches_weighted = [](const Map& map, double information) {
    return std::any_of(map.constraints.begin(), map.constraints.end(), [&](const auto& entry) {
      return entry.first.kind == ConstraintKind::scan_match &&
             std::abs(entry.second.information(0, 0) - information) < 1e-9;
    });
  };
  options.laser_cameras.covisibility_sigma_per_m = 0.0;
  const auto result = fused({flat.both, flat.camera_alone("robot1", {})}, options);
  ASSERT_EQ(result.components.size(), 1U) << to_text(result.verdicts[0].reason);
  EXPECT_TRUE(scan_matches_weighted(result.components[0].map, 4.0));
}

// Before and behind the other in the order of names.
TEST(LaserCameraFusion, gives_a_robot_with_a_single_camera_the_scale_of_one_with_a_laser) {
  const OneOfTwoSenses flat;
  test::StarryOptions single, true_scale;
  single.depth = true_scale.depth = false;
  single.scale = 0.4;
  for (const char* name : {"robot1", "beside"}) {
    const Map alone = flat.camera_alone(name, single);
    const auto result = fused({flat.both, alone});
    ASSERT_EQ(result.components.size(), 1U) << name << " " << to_text(result.verdicts[0].reason);
    const Component& team = result.components[0];
    ASSERT_NE(team.scales.find(MapId(name)), nullptr) << name;
    EXPECT_NEAR(*team.scales.find(MapId(name)), 2.5, 0.02 * 2.5) << name;
    EXPECT_EQ(team.scales.size(), 1U) << name;
    const auto [of_both, of_alone] = flat.errors(team, flat.camera_alone(name, true_scale));
    EXPECT_LT(of_both.keyframe_m, 0.05) << name;
    EXPECT_LT(of_both.landmark_m, 0.05) << name;
    EXPECT_LT(of_alone.keyframe_m, 0.03) << name;
    EXPECT_LT(of_alone.heading_rad, 0.01) << name;
    EXPECT_LT(of_alone.landmark_m, 0.02) << name;
    const auto& [first, node] = alone.nodes.front();
    const Pose3& robot_from_camera = keyframe_of(node)->geometry->robot_from_camera;
    const Eigen::Vector3d in_map = transformed(robot_from_camera.t, node.map_from_node),
                          in_team = transformed(robot_from_camera.t, team.map.nodes.find(first)->map_from_node);
    EXPECT_LT(
        (transformed(*team.scales.find(MapId(name)) * in_map, *team.team_from_map.find(MapId(name))) - in_team).norm(),
        1e-9)
        << name;
  }
}

std::string bytes_of(const Component& team) {
  MapUpdate update = difference({}, team.map);
  update.origin = {TierId("cloud"), team.map.id};
  update.sequence = 1;
  return encode(update);
}

Pose3 team_from_start(const Component& team, const char* robot) {
  for (const auto& [id, node] : team.map.nodes)
    if (id.session.client == ClientId{RobotId(robot), SensorId("laser")}) return node.map_from_node;
  return {};
}

// Robots of one flat, whose lasers know where they are.
struct FlatWithStars {
  simulation::SimulatedTeam team = [] {
    simulation::TeamOptions options;
    options.robots = 3;
    options.shared = 1.0;
    return simulation::make_apartment({}, options);
  }();
  test::StarryBuilding stars{{1, 2}, 2500};

  const simulation::SimulatedRobot& robot(std::size_t i) const { return team.robots[i]; }
  Map of_both(std::size_t i) const {
    return of_two_senses(robot(i), team.laser, stars, robot(i).steps.front().world_from_robot);
  }
  Map of_laser(std::size_t i) const { return test::truth_map(robot(i), team.laser); }
  Map of_camera(std::size_t i, const char* name, const test::StarryOptions& options = {}) const {
    return stars.keyframe_map(name, path_of(robot(i), robot(i).steps.front().world_from_robot), options);
  }

  struct Quality {
    std::size_t landmarks = 0, duplicates = 0;                         // that show what another one shows
    double landmarks_m = 0.0, keyframes_m = 0.0, keyframes_rad = 0.0;  // root mean square
  };
  // In the frame of robot0's laser. Keyframes of the first `robots`, whose maps hold that of the truth.
  Quality quality(const Component& joined, std::size_t robots) const {
    Quality result;
    const Pose3 world_from_team =
        compose(spatial(robot(0).steps.front().world_from_robot), inverse(team_from_start(joined, "robot0")));
    std::set<std::size_t> shown;
    double squares = 0.0;
    for (const auto& [id, landmark] : joined.map.landmarks) {
      const Eigen::Vector3d point = transformed(
          landmark.point_in_anchor(), compose(world_from_team, joined.map.nodes.find(landmark.anchor)->map_from_node));
      const std::size_t star = stars.nearest(point);
      squares += (stars.point(star) - point).squaredNorm();
      if (!shown.insert(star).second) ++result.duplicates;
    }
    result.landmarks = joined.map.landmarks.size();
    result.landmarks_m = std::sqrt(squares / static_cast<double>(result.landmarks));
    double count = 0.0, turns = 0.0;
    squares = 0.0;
    for (std::size_t i = 0; i < robots; ++i)
      for (const auto& [id, node] : joined.map.nodes) {
        if (id.session.client.robot != robot(i).id || keyframe_of(node) == nullptr) continue;
        const Pose3 truth = spatial(robot(i).steps[15 * id.index].world_from_robot),
                    placed = compose(world_from_team, node.map_from_node);
        squares += (placed.t - truth.t).squaredNorm();
        turns += std::pow(placed.q.angularDistance(truth.q), 2);
        ++count;
      }
    result.keyframes_m = std::sqrt(squares / count);
    result.keyframes_rad = std::sqrt(turns / count);
    return result;
  }
};

void expect_lasers_where_they_were(const Map& before, const Map& after, const Pose3& after_from_before) {
  for (const auto& [id, node] : before.nodes) {
    if (keyframe_of(node) != nullptr) continue;
    const Pose3 expected = compose(after_from_before, node.map_from_node);
    EXPECT_LT((after.nodes.find(id)->map_from_node.t - expected.t).norm(), 1e-9);
    EXPECT_LT(after.nodes.find(id)->map_from_node.q.angularDistance(expected.q), 1e-7);
  }
}

TEST(LaserCameraFusion, makes_landmarks_one_beside_lasers_and_adjusts_them) {
  const FlatWithStars flat;
  const std::vector<Map> maps{flat.of_both(0), flat.of_both(1)};
  const auto before = fused(maps, adjusted(0)), after = fused(maps);
  ASSERT_EQ(before.components.size(), 1U);
  ASSERT_EQ(after.components.size(), 1U);
  const Component &graph = before.components[0], &team = after.components[0];
  EXPECT_EQ(graph.same_as.size(), 0U);
  EXPECT_EQ(team.map.landmarks.size() + team.same_as.size(), maps[0].landmarks.size() + maps[1].landmarks.size());
  std::size_t of_other = 0;
  for (const auto& [gone, kept] : team.same_as) {
    EXPECT_LT(kept, gone);
    EXPECT_FALSE(team.map.landmarks.contains(gone));
    ASSERT_TRUE(team.map.landmarks.contains(kept));
    const auto& seen = team.map.landmarks.find(kept)->seen;
    const auto sees = [&](const auto& sighting) { return sighting.node.session == gone.session; };
    EXPECT_TRUE(std::any_of(seen.begin(), seen.end(), sees));
    of_other += gone.session.client.robot != kept.session.client.robot;
  }
  EXPECT_GT(of_other, 500U);
  const auto apart = flat.quality(graph, 2), shared = flat.quality(team, 2);
  EXPECT_LT(shared.duplicates, apart.duplicates / 4) << apart.duplicates;
  EXPECT_LT(shared.landmarks_m, 0.9 * apart.landmarks_m) << apart.landmarks_m;
  EXPECT_LE(shared.keyframes_m, apart.keyframes_m);
  EXPECT_LE(shared.keyframes_rad, apart.keyframes_rad);
}

TEST(LaserCameraFusion, leaves_lasers_where_their_graph_has_them_when_cameras_are_adjusted) {
  const FlatWithStars flat;
  const std::vector<Map> maps{flat.of_both(0), flat.of_laser(1), flat.of_camera(2, "robot2")};
  const auto before = fused(maps, adjusted(0)), after = fused(maps);
  ASSERT_EQ(before.components.size(), 1U);
  ASSERT_EQ(after.components.size(), 1U);
  EXPECT_GT(after.components[0].same_as.size(), 100U);
  for (const auto& [id, node] : before.components[0].map.nodes) {
    if (keyframe_of(node) != nullptr) continue;
    EXPECT_EQ(after.components[0].map.nodes.find(id)->map_from_node.t, node.map_from_node.t);
  }
  for (const char* robot : {"robot0", "robot1"})
    EXPECT_EQ(after.components[0].team_from_map.find(MapId(robot))->t,
              before.components[0].team_from_map.find(MapId(robot))->t);
  const auto apart = flat.quality(before.components[0], 1), shared = flat.quality(after.components[0], 1);
  EXPECT_LT(shared.duplicates, apart.duplicates / 4) << apart.duplicates;
  EXPECT_LT(shared.landmarks_m, apart.landmarks_m);
  EXPECT_LE(shared.keyframes_m, 1.02 * apart.keyframes_m);
}

// The first map has no laser: its first keyframe, which moves, is the frame.
TEST(LaserCameraFusion, moves_lasers_as_a_whole_where_the_frame_is_a_cameras) {
  const FlatWithStars flat;
  const std::vector<Map> maps{flat.of_both(0), flat.of_camera(1, "beside")};
  const auto before = fused(maps, adjusted(0)), after = fused(maps);
  ASSERT_EQ(after.components.size(), 1U);
  const Component &graph = before.components[0], &team = after.components[0];
  ASSERT_EQ(team.members.front(), MapId("beside"));
  EXPECT_GT(team.same_as.size(), 100U);
  EXPECT_LT(team.team_from_map.find(MapId("beside"))->t.norm(), 1e-9);
  const Pose3 shift = compose(team_from_start(team, "robot0"), inverse(team_from_start(graph, "robot0")));
  expect_lasers_where_they_were(graph.map, team.map, shift);
  const Pose3 frame = compose(shift, *graph.team_from_map.find(MapId("robot0")));
  EXPECT_LT((frame.t - team.team_from_map.find(MapId("robot0"))->t).norm(), 1e-9);
}

TEST(LaserCameraFusion, adjusts_nothing_where_one_robot_alone_has_a_camera) {
  const FlatWithStars flat;
  const std::vector<Map> maps{flat.of_both(0), flat.of_laser(1)};
  const auto before = fused(maps, adjusted(0)), after = fused(maps);
  ASSERT_EQ(after.components.size(), 1U);
  EXPECT_EQ(bytes_of(before.components[0]), bytes_of(after.components[0]));
}

TEST(LaserCameraFusion, adjusts_to_the_same_bytes_for_any_threads_and_order) {
  const FlatWithStars flat;
  std::vector<Map> maps{flat.of_both(0), flat.of_both(1), flat.of_laser(2)};
  const auto expected = fused(maps, {}, 1);
  ASSERT_EQ(expected.components.size(), 1U);
  EXPECT_GT(expected.components[0].same_as.size(), 100U);
  std::swap(maps[0], maps[2]);
  for (int threads = 2; threads <= 4; ++threads) {
    const auto result = fused(maps, {}, threads);
    ASSERT_EQ(result.components.size(), 1U);
    EXPECT_EQ(bytes_of(result.components[0]), bytes_of(expected.components[0])) << threads;
    const auto &same = result.components[0].same_as, &as = expected.components[0].same_as;
    EXPECT_TRUE(std::equal(same.begin(), same.end(), as.begin(), as.end())) << threads;
  }
}

TEST(LaserCameraFusion, distinguishes_floors_of_one_plan_by_what_cameras_see) {
  simulation::TeamOptions options;
  options.shared = 0.6;
  const auto team = simulation::make_apartment({}, options);
  std::vector<Map> maps, walls;
  for (int i = 0; i < 2; ++i) {
    const auto& robot = team.robots[static_cast<std::size_t>(i)];
    const test::StarryBuilding stars({10 + i, 20 + i}, 2500);
    maps.push_back(of_two_senses(robot, team.laser, stars, robot.steps.front().world_from_robot));
    walls.push_back(test::truth_map(robot, team.laser));
  }
  EXPECT_EQ(fused(walls).components.size(), 1U);
  const auto result = fused(maps);
  EXPECT_EQ(result.components.size(), 2U);
  EXPECT_EQ(result.verdicts[0].decision, Decision::refused);
  EXPECT_EQ(result.verdicts[0].reason, Reason::contradiction);
}

TEST(LaserCameraFusion, distinguishes_houses_of_one_wallpaper_by_their_walls) {
  const auto team = simulation::make_two_strangers();
  const test::StarryBuilding stars({1, 2}, 2500);
  std::vector<Map> maps, seen;
  for (const auto& robot : team.robots) {
    maps.push_back(of_two_senses(robot, team.laser, stars, {1.0, 0.5, 0.2}));
    seen.push_back(maps.back());
    seen.back().submaps = {};
    Table<NodeId, Node> keyframes;
    for (const auto& [id, node] : maps.back().nodes)
      if (id.session.client.sensor == SensorId("camera")) keyframes.set(id, node);
    seen.back().nodes = keyframes;
    seen.back().constraints = {};
  }
  EXPECT_EQ(fused(seen).components.size(), 1U);
  const auto result = fused(maps);
  EXPECT_EQ(result.components.size(), 2U);
  EXPECT_EQ(result.verdicts[0].decision, Decision::refused);
  EXPECT_EQ(result.verdicts[0].reason, Reason::contradiction);
}

// Each robot knows two rooms of one look: agreement says nothing of which is which.
TEST(LaserCameraFusion, does_not_join_rooms_of_one_wallpaper_that_repeats) {
  const test::StarryBuilding stars({1, 1}, 2500);
  std::vector<Map> seen;
  for (const auto& robot : simulation::make_two_strangers().robots) {
    seen.push_back(stars.keyframe_map(robot.id.str(), path_of(robot, {1.0, 0.5, 0.2})));
  }
  const auto result = fused(seen);
  EXPECT_EQ(result.components.size(), 2U);
  EXPECT_EQ(result.verdicts[0].decision, Decision::deferred);
  EXPECT_EQ(result.verdicts[0].reason, Reason::ambiguous);
  EXPECT_FALSE(result.verdicts[0].contradicted.empty());
}

}  // namespace
}  // namespace mapweave::fusion
