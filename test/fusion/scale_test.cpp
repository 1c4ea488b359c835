// Maps of single cameras that sit off the base of their robot, each of a scale of its own.

#include <gtest/gtest.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/rig/laser_camera_alignment.h>
#include <mapweave/rig/rig.h>
#include <mapweave/rig/scale.h>
#include <support/starry_maps.h>

namespace mapweave::fusion {
namespace {

constexpr double kOwn = 0.4;  // of their scale to metres
const Eigen::Vector3d kOff(0.3, -0.2, 0.6);

test::StarryOptions single(double scale) {
  test::StarryOptions options;
  options.depth = false;
  options.scale = scale;
  options.camera_m = kOff;
  return options;
}

FusionResult fused(std::vector<Map> maps) {
  WorkerPool pool(2);
  Memo memo;
  return fuse({std::move(maps), {}, TierId("cloud")}, {}, memo, pool, *make_silent_progress());
}

// Turning as it goes, so that a camera swings about the base.
std::vector<Pose2> turning(double x, double y, double first_yaw, double turn, int count) {
  std::vector<Pose2> path;
  for (int i = 0; i < count; ++i) path.push_back({x + 0.15 * i, y, first_yaw + turn * i / count});
  return path;
}

double farthest_m(const Map& team, const Map& truth, const Pose3& team_from_truth) {
  double result = 0.0;
  for (const auto& [id, node] : truth.nodes)
    result = std::max(
        result, (team.nodes.find(id)->map_from_node.t - transformed(node.map_from_node.t, team_from_truth)).norm());
  return result;
}

// Of landmarks: nine of ten lie within it. same_as: which one stands for each that is not there.
double landmarks_m(const Map& map, const Map& truth, const Pose3& map_from_truth,
                   const Table<LandmarkId, LandmarkId>& same_as = {}) {
  const auto at = [](const Map& of, const Landmark& l) {
    return transformed(l.point_in_anchor(), of.nodes.find(l.anchor)->map_from_node);
  };
  std::vector<double> apart;
  for (const auto& [id, landmark] : truth.landmarks) {
    const LandmarkId* other = same_as.find(id);
    const Landmark& placed = *map.landmarks.find(other != nullptr ? *other : id);
    apart.push_back((at(map, placed) - transformed(at(truth, landmark), map_from_truth)).norm());
  }
  std::sort(apart.begin(), apart.end());
  return apart[apart.size() * 9 / 10];
}

// How far what the joins say of nodes of two maps is from where the nodes lie.
double untold_m(const Map& team) {
  double result = 0.0;
  for (const auto& [id, constraint] : team.constraints)
    if (id.kind == ConstraintKind::between_maps) {
      const Pose3 lies = between(team.nodes.find(id.from)->map_from_node, team.nodes.find(id.to)->map_from_node);
      result = std::max(result, (lies.t - constraint.from_from_to.pose.t).norm());
    }
  return result;
}

// Of cameras of a member, from where its frame and its scale have them.
double off_frame_m(const Component& team, const Map& map) {
  const double* scale = team.scales.find(map.id);
  double result = 0.0;
  for (const auto& [id, node] : map.nodes) {
    const Eigen::Vector3d& camera_m = keyframe_of(node)->geometry->robot_from_camera.t;
    const Eigen::Vector3d in_team = transformed(camera_m, team.map.nodes.find(id)->map_from_node),
                          grown = (scale != nullptr ? *scale : 1.0) * transformed(camera_m, node.map_from_node);
    result = std::max(result, (transformed(grown, *team.team_from_map.find(map.id)) - in_team).norm());
  }
  return result;
}

TEST(Scale, of_a_camera_off_the_base_is_found_by_a_map_with_depth) {
  const test::StarryBuilding building({1});
  const auto path_a = test::look_around(-1.0, -0.5, 0.0, 2.4, 14), path_b = turning(-1.5, 0.3, 0.6, 1.2, 14);
  const Map a = building.keyframe_map("alpha", path_a), b = building.keyframe_map("beta", path_b, single(kOwn)),
            truth = building.keyframe_map("beta", path_b, single(1.0));
  const auto result = fused({a, b});
  ASSERT_EQ(result.components.size(), 1U) << to_text(result.verdicts[0].reason);
  const Component& team = result.components[0];
  ASSERT_NE(team.scales.find(b.id), nullptr);
  EXPECT_NEAR(*team.scales.find(b.id) * kOwn, 1.0, 0.02);
  const Pose3 team_from_truth = spatial(between(path_a.front(), path_b.front()));
  EXPECT_LT(farthest_m(team.map, truth, team_from_truth), 0.02);
  EXPECT_LT(landmarks_m(team.map, truth, team_from_truth, team.same_as), 0.03);
  EXPECT_LT(untold_m(team.map), 0.05);
  EXPECT_LT(off_frame_m(team, a), 0.02);
  EXPECT_LT(off_frame_m(team, b), 0.05);
}

// Then the first map takes the scale of the other.
TEST(Scale, is_that_of_the_metric_map_though_a_single_camera_comes_first) {
  const test::StarryBuilding building({1});
  const Map first = building.keyframe_map("aaron", turning(-1.5, 0.3, 0.6, 1.2, 14), single(kOwn)),
            deep = building.keyframe_map("alpha", test::look_around(-1.0, -0.5, 0.0, 2.4, 14));
  const auto result = fused({first, deep});
  ASSERT_EQ(result.components.size(), 1U) << to_text(result.verdicts[0].reason);
  const Component& team = result.components[0];
  EXPECT_EQ(team.scales.find(deep.id), nullptr);
  ASSERT_NE(team.scales.find(first.id), nullptr);
  EXPECT_NEAR(*team.scales.find(first.id) * kOwn, 1.0, 0.02);
  EXPECT_LT(untold_m(team.map), 0.05);
  for (const Map& map : {first, deep}) EXPECT_LT(off_frame_m(team, map), 0.05) << map.id.str();
}

TEST(Scale, of_a_rig_of_single_cameras_leaves_it_one_robot) {
  const test::StarryBuilding building({1});
  const auto path_a = test::look_around(-1.0, -0.5, 0.0, 2.4, 14), path_b = turning(-1.5, 0.3, 0.6, 0.5, 14);
  test::StarryOptions ahead = single(0.6), aside = single(0.6);
  aside.sensor = "side";
  aside.camera_m = {0.3, 0.1, 0.9};
  const Map map_ahead = building.keyframe_map("beta", path_b, ahead),
            map_aside = building.keyframe_map("beta", path_b, aside);
  const rig::RigMerge merge = rig::merge_rig({{"camera", map_ahead, {}}, {"side", map_aside, {}}}, {});
  ASSERT_EQ(merge.maps.size(), 1U) << testing::PrintToString(merge.notes);
  const Map& both = merge.maps[0].map;
  const auto apart_m = [&](const Map& map) {
    double result = 0.0;
    for (std::uint32_t i = 0; i < path_b.size(); ++i) {
      const auto at = [&](const char* sensor) {
        return map.nodes.find({{{RobotId("beta"), SensorId(sensor)}, 1'000'000'000}, i})->map_from_node.t;
      };
      result = std::max(result, (at("camera") - at("side")).norm());
    }
    return result;
  };
  EXPECT_LT(apart_m(both), 0.03) << "before";
  EXPECT_LT(apart_m(rig::rescaled(both, 1.0 / 0.6)), 0.06);
  const auto result = fused({building.keyframe_map("alpha", path_a), both});
  ASSERT_EQ(result.components.size(), 1U) << to_text(result.verdicts[0].reason);
  const Map& team = result.components[0].map;
  EXPECT_LT(apart_m(team), 0.06);
  for (const auto& [id, constraint] : team.constraints) {
    if (id.kind != ConstraintKind::extrinsic) continue;
    EXPECT_LT(constraint.from_from_to.pose.t.norm(), 0.06) << to_string(id.from);
  }
  const Map truth = building.keyframe_map("beta", path_b, single(1.0));
  EXPECT_LT(farthest_m(team, truth, spatial(between(path_a.front(), path_b.front()))), 0.06);
}

TEST(Scale, of_a_camera_off_the_base_is_that_of_the_laser_beside_it) {
  const test::StarryBuilding building({1});
  const auto path = turning(-1.5, 0.3, 0.6, 1.2, 14);
  const Map truth = building.keyframe_map("alpha", path, single(1.0));
  Map laser;
  laser.id = MapId("alpha");
  for (const auto& [id, node] : truth.nodes) {
    const NodeId there{{{RobotId("alpha"), SensorId("laser")}, 1'000'000'000}, id.index};
    laser.nodes.set(there, {there, node.stamp, node.map_from_node, nullptr});
    if (id.index == 0) continue;
    const Pose2 step = between(path[id.index - 1], path[id.index]);
    const ConstraintId odometry{ConstraintKind::odometry, {there.session, id.index - 1}, there, 0};
    laser.constraints.set(odometry, planar_constraint(odometry, step, Eigen::Vector3d(1e6, 1e6, 1e6).asDiagonal()));
  }
  const rig::LaserCameraMap both = rig::align_cameras(laser, {building.keyframe_map("alpha", path, single(kOwn))});
  ASSERT_TRUE(both.apart.empty());
  EXPECT_LT(farthest_m(both.map, truth, {}), 0.01);
  EXPECT_LT(landmarks_m(both.map, truth, {}), 0.03);
}

}  // namespace
}  // namespace mapweave::fusion
