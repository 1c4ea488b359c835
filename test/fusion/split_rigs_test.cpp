#include <mapweave/fusion/split_rigs.h>
#include <support/rig_members.h>

#include <gmock/gmock.h>

namespace mapweave::fusion {
namespace {

FusionResult joined(const rig::RobotRigs& rigs, const std::vector<Map>& maps) {
  FusionInput input;
  input.maps = rigs.maps;
  WorkerPool pool(1);
  Memo memo;
  FusionResult result = fuse(input, {}, memo, pool, *make_silent_progress());
  split_rigs(result, rigs.rigs, maps);
  return result;
}

TEST(SplitRigs, gives_each_camera_its_own_transform_and_scale) {
  std::vector<rig::RigMember> members = test::drive(40.0).members;
  members[1] = test::single(members[1], 0.4, 0.0);
  const std::vector<Map> maps = test::maps_of(members);
  WorkerPool pool(2);
  const rig::RobotRigs rigs = rig::merge_rigs(maps, {}, pool);
  ASSERT_EQ(rigs.maps.size(), 1U) << testing::PrintToString(rigs.notes);
  const FusionResult result = joined(rigs, maps);
  ASSERT_EQ(result.components.size(), 1U);
  const Component& team = result.components.front();
  EXPECT_THAT(team.members, testing::ElementsAre(maps[0].id, maps[1].id));
  EXPECT_EQ(team.scales.find(maps[0].id), nullptr);
  ASSERT_NE(team.scales.find(maps[1].id), nullptr);
  EXPECT_NEAR(*team.scales.find(maps[1].id), 1.0 / 0.4, 0.05);
  for (const Map& map : maps) {
    const Pose3& team_from_map = *team.team_from_map.find(map.id);
    const double* scale = team.scales.find(map.id);
    double worst_m = 0.0;
    for (const auto& [id, node] : map.nodes) {
      const Pose3& robot_from_camera = keyframe_of(node)->geometry->robot_from_camera;
      const Eigen::Vector3d in_map = compose(node.map_from_node, robot_from_camera).t,
                            in_team = compose(team.map.nodes.find(id)->map_from_node, robot_from_camera).t;
      worst_m =
          std::max(worst_m, (transformed((scale != nullptr ? *scale : 1.0) * in_map, team_from_map) - in_team).norm());
    }
    EXPECT_LT(worst_m, 0.2) << map.id.str();
  }
  // The frame is that of who began first.
  const Map& first =
      *std::find_if(maps.begin(), maps.end(), [&](const Map& map) { return map.id == rigs.rigs.front().map; });
  EXPECT_LT(
      (team.map.nodes.find(first.nodes.front().first)->map_from_node.t - first.nodes.front().second.map_from_node.t)
          .norm(),
      1e-9);
}

}  // namespace
}  // namespace mapweave::fusion
