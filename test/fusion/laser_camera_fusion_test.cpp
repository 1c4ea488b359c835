#include <gtest/gtest.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/rig/aligned_trajectories.h>
#include <mapweave/rig/laser_camera_alignment.h>
#include <support/simulated_maps.h>
#include <support/starry_maps.h>

#include <algorithm>

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

FusionResult fused(std::vector<Map> maps, const FusionOptions& options = {}) {
  WorkerPool pool(2);
  Memo memo;
  const auto progress = make_silent_progress();
  return fuse({std::move(maps), {}, TierId("cloud")}, options, memo, pool, *progress);
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
  std::pair<Error, Error> errors(const Map& joined, const Map& true_scale) const {
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
      for (const auto& [id, landmark] : map.landmarks) {
        const Landmark& moved = *joined.landmarks.find(id);
        const Pose3 placed = compose(world_from_team, joined.nodes.find(moved.anchor)->map_from_node);
        apart.push_back((transformed(moved.point_in_anchor(), placed) -
                         transformed(landmark.point_in_anchor(), truth.at(landmark.anchor)))
                            .norm());
      }
      std::nth_element(apart.begin(), apart.begin() + static_cast<std::ptrdiff_t>(apart.size() / 2), apart.end());
      result.landmark_m = apart[apart.size() / 2];
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
  const auto [of_both, of_alone] = flat.errors(result.components[0].map, flat.camera_alone("robot1", {}));
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
    const auto [of_both, of_alone] = flat.errors(team.map, flat.camera_alone(name, true_scale));
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
