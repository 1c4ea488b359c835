// A robot with two cameras in an apartment, by features.
#include <mapweave/matching/rigid_from_points.h>
#include <mapweave/rig/robot_rigs.h>
#include <support/rig_members.h>

#include <gmock/gmock.h>

#include <map>

namespace mapweave::rig {
namespace {

using test::drive;
using test::DrivenRobot;
using test::maps_of;
using test::single;

// Root mean square, laid on the truth.
double error_m(const std::vector<StampedPose>& trajectory, const std::vector<StampedPose>& truth) {
  std::vector<matching::PointPair> pairs;
  for (const StampedPose& pose : trajectory)
    if (const auto there = pose_at(truth, pose.stamp, 0.5)) pairs.push_back({there->t, pose.map_from_robot.t, 1.0});
  const auto laid = matching::align_points(pairs, matching::Freedom::rigid);
  if (!laid) return 1e9;
  double sum = 0.0;
  for (const matching::PointPair& pair : pairs) sum += (transformed(pair.in_b, laid->pose) - pair.in_a).squaredNorm();
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

std::vector<StampedPose> trajectory_of(const RigMap& merged, const std::vector<RigMember>& members,
                                       const std::vector<StampedPose>& odometry) {
  std::map<std::string, CameraTrajectory> by_name;
  for (std::size_t i = 0; i < merged.members.size(); ++i) {
    auto& frames = by_name[members[merged.members[i]].camera].frames;
    frames.insert(frames.end(), merged.frames[i].begin(), merged.frames[i].end());
    std::stable_sort(frames.begin(), frames.end(), [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
  }
  std::vector<CameraTrajectory> cameras;
  for (const auto& entry : by_name) cameras.push_back(entry.second);
  return robot_trajectory(cameras, odometry);
}

// What is left of a member between two times, without landmarks.
RigMember part_of(RigMember member, double begin_s, double end_s) {
  const Stamp first = member.frames.front().stamp;
  const auto is_out = [&](Stamp stamp) {
    return seconds_between(first, stamp) < begin_s || seconds_between(first, stamp) >= end_s;
  };
  member.map.landmarks = {};
  Table<NodeId, Node> nodes;
  for (const auto& [id, node] : member.map.nodes)
    if (!is_out(node.stamp)) nodes.set(id, node);
  member.map.nodes = nodes;
  auto& frames = member.frames;
  frames.erase(
      std::remove_if(frames.begin(), frames.end(), [&](const StampedPose& frame) { return is_out(frame.stamp); }),
      frames.end());
  return member;
}

std::string bytes_of(const Map& map) {
  MapUpdate update = difference({}, map);
  update.origin = {TierId("test"), map.id};
  update.sequence = 1;
  return encode(update);
}

class TwoCameras : public testing::Test {
 protected:
  static void SetUpTestSuite() { robot_ = new DrivenRobot(drive(40.0)); }
  static void TearDownTestSuite() { delete robot_; }
  static const DrivenRobot& robot() { return *robot_; }

 private:
  static DrivenRobot* robot_;
};
DrivenRobot* TwoCameras::robot_ = nullptr;

TEST_F(TwoCameras, know_the_trajectory_better_than_either_alone) {
  ASSERT_EQ(robot().members.size(), 2U);
  const RigMerge rig = merge_rig(robot().members, robot().odometry);
  ASSERT_EQ(rig.maps.size(), 1U) << testing::PrintToString(rig.notes);
  const RigMap& both = rig.maps[0];
  EXPECT_TRUE(both.solved);
  EXPECT_LT(both.apart_after_m, 0.5 * both.apart_before_m);
  EXPECT_EQ(both.map.nodes.size(), robot().members[0].map.nodes.size() + robot().members[1].map.nodes.size());
  EXPECT_EQ(both.map.landmarks.size(),
            robot().members[0].map.landmarks.size() + robot().members[1].map.landmarks.size());
  const double ahead_m = error_m(robot().members[0].frames, robot().truth),
               back_m = error_m(robot().members[1].frames, robot().truth);
  const double both_m = error_m(trajectory_of(both, robot().members, robot().odometry), robot().truth);
  RecordProperty("errors", std::to_string(ahead_m) + " " + std::to_string(back_m) + " " + std::to_string(both_m));
  EXPECT_LT(both_m, 1.25 * std::min(ahead_m, back_m));
  EXPECT_LT(both_m, 0.5 * (ahead_m + back_m));
}

TEST_F(TwoCameras, are_left_as_they_lie_where_they_agree_well_enough) {
  RigOptions options;
  options.threshold_m = 1.0;
  options.threshold_rad = 1.0;
  const RigMerge rig = merge_rig(robot().members, robot().odometry, options);
  ASSERT_EQ(rig.maps.size(), 1U);
  EXPECT_FALSE(rig.maps[0].solved);
  EXPECT_EQ(rig.maps[0].apart_before_m, rig.maps[0].apart_after_m);
}

TEST_F(TwoCameras, give_the_same_bytes_each_time) {
  const RigMerge one = merge_rig(robot().members, robot().odometry),
                 other = merge_rig(robot().members, robot().odometry);
  EXPECT_EQ(bytes_of(one.maps[0].map), bytes_of(other.maps[0].map));
}

TEST_F(TwoCameras, are_merged_by_keyframes_alone_too) {
  std::vector<RigMember> members = robot().members;
  for (RigMember& member : members) member.frames.clear();
  RigOptions options;
  options.longest_gap_s = 3.0;
  const RigMerge rig = merge_rig(members, {}, options);
  ASSERT_EQ(rig.maps.size(), 1U) << testing::PrintToString(rig.notes);
  double error = 0.0;
  for (const auto& frames : rig.maps[0].frames) error = std::max(error, error_m(frames, robot().truth));
  EXPECT_LT(error, std::max(error_m(robot().members[0].frames, robot().truth),
                            error_m(robot().members[1].frames, robot().truth)));
}

TEST_F(TwoCameras, give_the_scale_to_the_one_without_depth) {
  std::vector<RigMember> members = robot().members;
  members[1] = single(members[1], 0.4, 0.3);
  ASSERT_GT(error_m(members[1].frames, robot().truth), 0.5);
  const RigMerge rig = merge_rig(members, {});
  ASSERT_EQ(rig.maps.size(), 1U) << testing::PrintToString(rig.notes);
  EXPECT_EQ(rig.maps[0].members.front(), 0U);
  EXPECT_LT(error_m(rig.maps[0].frames[1], robot().truth), 0.02);
  EXPECT_LT(error_m(trajectory_of(rig.maps[0], members, {}), robot().truth),
            1.1 * error_m(members[0].frames, robot().truth));
  // Landmarks too: each lies where the camera with depth has it.
  double worst = 0.0;
  for (const auto& [id, landmark] : robot().members[1].map.landmarks) {
    const Landmark* found = rig.maps[0].map.landmarks.find(id);
    ASSERT_NE(found, nullptr);
    const double far_m = landmark.point_in_anchor().norm();
    worst = std::max(worst, (found->point_in_anchor() - landmark.point_in_anchor()).norm() / far_m);
  }
  EXPECT_LT(worst, 0.05);
}

TEST_F(TwoCameras, without_depth_take_the_scale_from_wheels) {
  const std::vector<RigMember> members{single(robot().members[0], 1.2, 0.5), single(robot().members[1], 0.8, -0.3)};
  const RigMerge rig = merge_rig(members, robot().odometry);
  ASSERT_EQ(rig.maps.size(), 1U) << testing::PrintToString(rig.notes);
  EXPECT_EQ(rig.maps[0].members.size(), 2U);
  const double both_m = error_m(trajectory_of(rig.maps[0], members, robot().odometry), robot().truth);
  RecordProperty("errors", std::to_string(error_m(robot().odometry, robot().truth)) + " " + std::to_string(both_m));
  EXPECT_LT(both_m, 0.1);
  EXPECT_LT(both_m,
            0.3 * std::min(error_m(members[0].frames, robot().truth), error_m(members[1].frames, robot().truth)));
  for (const auto& entry : rig.maps[0].map.nodes) EXPECT_NE(entry.first.session.client.sensor, SensorId("wheels"));
}

TEST_F(TwoCameras, stay_apart_where_a_single_one_did_not_move) {
  const std::vector<RigMember> members{robot().members[0], part_of(single(robot().members[1], 0.4, 0.0), 0.0, 0.9)};
  RigOptions options;
  options.least_common_s = 0.5;
  const RigMerge rig = merge_rig(members, {}, options);
  EXPECT_EQ(rig.maps.size(), 2U);
  EXPECT_THAT(rig.notes, testing::ElementsAre(testing::HasSubstr("'back', which has no depth")));
}

TEST_F(TwoCameras, that_never_saw_at_the_same_time_stay_apart) {
  const std::vector<RigMember> members{part_of(robot().members[0], 0.0, 20.0), part_of(robot().members[1], 25.0, 1e9)};
  EXPECT_EQ(merge_rig(members, robot().odometry).maps.size(), 2U) << "wheels turn in the air where a robot is carried";
}

TEST_F(TwoCameras, believe_the_one_that_wheels_agree_with) {
  std::vector<RigMember> members = robot().members;
  const Pose3 aside{{0.0, 0.4, 0.0}, Eigen::Quaterniond::Identity()};
  const Stamp then{members[0].frames.front().stamp.ns + 30'000'000'000};
  for (auto& [id, node] : members[0].map.nodes)
    if (then < node.stamp) node.map_from_node = compose(aside, node.map_from_node);
  for (StampedPose& frame : members[0].frames)
    if (then < frame.stamp) frame.map_from_robot = compose(aside, frame.map_from_robot);
  test::forget(members[0].map, 2.4);
  ASSERT_GT(error_m(members[0].frames, robot().truth), 0.1);
  const double back_m = error_m(members[1].frames, robot().truth);
  const auto error = [&](const std::vector<StampedPose>& odometry) {
    const RigMerge rig = merge_rig(members, odometry);
    return rig.maps.size() == 1 ? error_m(trajectory_of(rig.maps[0], members, odometry), robot().truth) : 1e9;
  };
  EXPECT_LT(error(robot().odometry), 1.5 * back_m);
  EXPECT_GT(error({}), error(robot().odometry));
}

TEST_F(TwoCameras, are_merged_to_the_same_bytes_in_any_order) {
  std::vector<Map> maps = maps_of(robot().members);
  for (int i = 0; i < 2; ++i) {  // two robots more
    Map lonely;
    lonely.id = MapId(i == 0 ? "beta.camera" : "gamma.camera");
    const NodeId id{{{RobotId(i == 0 ? "beta" : "gamma"), SensorId("camera")}, 5}, 0};
    lonely.nodes.set(id, {id, Stamp{5}, {}, robot().members[0].map.nodes.front().second.payload});
    maps.push_back(lonely);
  }
  WorkerPool one(1), two(2);
  const RobotRigs in_order = merge_rigs(maps, {}, one);
  std::reverse(maps.begin(), maps.end());
  const RobotRigs reversed = merge_rigs(maps, {}, two);
  ASSERT_EQ(in_order.maps.size(), 3U);
  ASSERT_EQ(reversed.maps.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(bytes_of(in_order.maps[i]), bytes_of(reversed.maps[i]));
}

TEST(Rig, brings_a_camera_that_was_blind_back_by_the_other) {
  const DrivenRobot robot = drive(40.0, {"back", 15.0, 25.0});
  ASSERT_EQ(robot.members.size(), 3U) << "the camera begins anew";
  const RigMerge rig = merge_rig(robot.members, robot.odometry);
  ASSERT_EQ(rig.maps.size(), 1U) << testing::PrintToString(rig.notes);
  const auto trajectory = trajectory_of(rig.maps[0], robot.members, robot.odometry);
  EXPECT_LT(error_m(trajectory, robot.truth), 1.1 * error_m(robot.members[0].frames, robot.truth));
  // Every session lies right in the one map, not only in itself.
  std::vector<StampedPose> all;
  for (const auto& frames : rig.maps[0].frames) all.insert(all.end(), frames.begin(), frames.end());
  EXPECT_LT(error_m(all, robot.truth), 0.05);
}

TEST(Rig, says_so_where_a_camera_is_not_mounted_as_the_log_says) {
  const DrivenRobot robot = drive(20.0, {}, -20.0 * M_PI / 180.0);
  const RigMerge rig = merge_rig(robot.members, robot.odometry);
  EXPECT_EQ(rig.maps.size(), 2U);
  ASSERT_EQ(rig.notes.size(), 1U);
  EXPECT_THAT(rig.notes[0],
              testing::AllOf(testing::HasSubstr("'ahead'"), testing::HasSubstr("'back'"),
                             testing::HasSubstr("contradict"), testing::HasSubstr("20 deg farther to the left")));
}

}  // namespace
}  // namespace mapweave::rig
