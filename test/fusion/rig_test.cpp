// A robot with two cameras in an apartment, by features.
#include <mapweave/fusion/rig.h>
#include <mapweave/fusion/siblings.h>
#include <mapweave/maps/map_update.h>
#include <mapweave/matching/rigid_from_points.h>
#include <mapweave/simulation/feature_sensor.h>
#include <mapweave/visual/visual_client.h>
#include <support/seen_frame.h>

#include <gmock/gmock.h>

#include <map>

namespace mapweave::fusion {
namespace {

struct Blindness {
  std::string camera;
  double begin_s = 0.0, end_s = 0.0;
};

struct Robot {
  std::vector<RigMember> members;
  std::vector<StampedPose> odometry, truth;
};

simulation::WorldOptions world_of_two_cameras(double length_m) {
  simulation::WorldOptions options;
  options.seed = 7;
  options.buildings.resize(1);
  options.buildings[0].seed = 7;
  options.cameras.resize(2);
  for (std::size_t i = 0; i < 2; ++i) {
    simulation::CameraOptions& camera = options.cameras[i];
    camera.id = i == 0 ? "ahead" : "back", camera.kind = simulation::CameraKind::rgbd, camera.frames_per_second = 12.0;
    if (i == 1) camera.yaw_deg = 180.0, camera.x_m = -0.15;
  }
  options.robots.resize(1);
  options.robots[0].id = "alpha", options.robots[0].last_room = 3, options.robots[0].length_m = length_m;
  return options;
}

// What a client leaves: a member for each session.
void finish(visual::VisualClient& client, const std::string& name, const Pose3& robot_from_camera, std::vector<RigMember>& members) {
  client.finish();
  const visual::ClientPlace place{{RobotId("alpha"), SensorId(name)}, robot_from_camera};
  const std::vector<int> sessions = client.sessions();
  std::vector<MapUpdate> updates = client.take_updates(place, visual::PublishedDetail::exact);
  std::sort(updates.begin(), updates.end(), [](const MapUpdate& a, const MapUpdate& b) { return a.nodes.front().id < b.nodes.front().id; });
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    RigMember member{name, updated({}, updates[i]), {}};
    member.map.id = updates[i].origin.map;
    for (const visual::PlacedFrame& frame : client.trajectory())
      if (frame.session == sessions[i])
        member.frames.push_back({frame.stamp, compose(compose(robot_from_camera, frame.map_from_camera), inverse(robot_from_camera))});
    members.push_back(std::move(member));
  }
}

// back_yaw_rad: by which the second camera is turned against what its client believes.
Robot drive(double length_m, const Blindness& blindness = {}, double back_yaw_rad = 0.0) {
  WorkerPool here(1);
  const simulation::WorldOptions options = world_of_two_cameras(length_m);
  const simulation::World world(options, here);
  const simulation::FeatureOptions features;
  const simulation::LandmarkField field(world.scene(0), world.buildings()[0], features);
  Robot robot;
  simulation::Recording wheels(world, 0);
  for (auto step = wheels.next(); step; step = wheels.next()) {
    robot.odometry.push_back({step->stamp, spatial(step->odometry_from_robot)});
    robot.truth.push_back({step->stamp, spatial(step->world_from_robot)});
  }
  for (std::size_t c = 0; c < 2; ++c) {
    const simulation::FeatureRecording recording(world, field, features, 0, c);
    const auto& model = options.cameras[c].intrinsics();
    const std::string& name = options.cameras[c].id;
    Pose3 robot_from_camera = compose(inverse(world.world_from_robot(0, 0.0)), recording.frame(0).world_from_camera);
    if (c == 1) robot_from_camera.q = Eigen::AngleAxisd(back_yaw_rad, Eigen::Vector3d::UnitZ()) * robot_from_camera.q;
    visual::VisualClient client({model.width, model.height, model.fx, model.fy, model.cx, model.cy}, 0.0, {},
                                matching::shipped_vocabulary());
    for (std::size_t i = 0; i < recording.frame_count(); ++i) {
      const simulation::FeatureFrame seen = recording.frame(i);
      visual::FeatureFrame frame = test::frame_of(seen);
      const double seconds = seconds_between(world.first_stamp(0), seen.stamp);
      if (name == blindness.camera && seconds >= blindness.begin_s && seconds < blindness.end_s)
        frame.features = {}, frame.inverse_depths.clear();
      client.add(frame);
    }
    finish(client, name, robot_from_camera, robot.members);
  }
  return robot;
}

// Root mean square, laid on the truth.
double error_m(const std::vector<StampedPose>& way, const std::vector<StampedPose>& truth) {
  std::vector<matching::PointPair> pairs;
  for (const StampedPose& pose : way)
    if (const auto there = pose_at(truth, pose.stamp, 0.5)) pairs.push_back({there->t, pose.map_from_robot.t, 1.0});
  const auto laid = matching::align_points(pairs, matching::Freedom::rigid);
  if (!laid) return 1e9;
  double sum = 0.0;
  for (const matching::PointPair& pair : pairs) sum += (transformed(pair.in_b, laid->pose) - pair.in_a).squaredNorm();
  return std::sqrt(sum / static_cast<double>(pairs.size()));
}

std::vector<StampedPose> way_of(const TiedMap& tied, const std::vector<RigMember>& members, const std::vector<StampedPose>& odometry) {
  std::map<std::string, SeenWay> ways;
  for (std::size_t i = 0; i < tied.members.size(); ++i) {
    auto& frames = ways[members[tied.members[i]].camera].frames;
    frames.insert(frames.end(), tied.frames[i].begin(), tied.frames[i].end());
    std::stable_sort(frames.begin(), frames.end(), [](const auto& a, const auto& b) { return a.stamp < b.stamp; });
  }
  std::vector<SeenWay> cameras;
  for (const auto& entry : ways) cameras.push_back(entry.second);
  return robot_way(cameras, odometry);
}

// A camera that does not know places again that it saw before.
void forget(Map& map, double after_s) {
  for (auto& [id, landmark] : map.landmarks) {
    const Stamp anchored = map.nodes.find(landmark.anchor)->stamp;
    const auto is_later = [&](const LandmarkSighting& seen) {
      return std::abs(seconds_between(anchored, map.nodes.find(seen.node)->stamp)) > after_s;
    };
    landmark.seen.erase(std::remove_if(landmark.seen.begin(), landmark.seen.end(), is_later), landmark.seen.end());
  }
}

// What is left of a member between two times, without landmarks.
RigMember part_of(RigMember member, double begin_s, double end_s) {
  const Stamp first = member.frames.front().stamp;
  const auto is_out = [&](Stamp stamp) { return seconds_between(first, stamp) < begin_s || seconds_between(first, stamp) >= end_s; };
  member.map.landmarks = {};
  Table<NodeId, Node> nodes;
  for (const auto& [id, node] : member.map.nodes)
    if (!is_out(node.stamp)) nodes.set(id, node);
  member.map.nodes = nodes;
  auto& frames = member.frames;
  frames.erase(std::remove_if(frames.begin(), frames.end(), [&](const StampedPose& frame) { return is_out(frame.stamp); }), frames.end());
  return member;
}

// The same camera without depth: its lengths are other ones, and change by `drift` until the end. What they measure is the camera's way and
// what it sees from there; where it sits on the robot is known.
RigMember single(RigMember member, double scale, double drift) {
  const Stamp first = member.frames.front().stamp;
  const double seconds = seconds_between(first, member.frames.back().stamp);
  const auto scale_at = [&](Stamp stamp) { return scale * (1.0 + drift * seconds_between(first, stamp) / seconds); };
  const Pose3 robot_from_camera = keyframe_of(member.map.nodes.front().second)->geometry->robot_from_camera;
  const auto camera_at = [&](const StampedPose& frame) { return compose(frame.map_from_robot, robot_from_camera); };
  std::vector<StampedPose> frames = member.frames;
  Pose3 camera = camera_at(frames.front());
  for (std::size_t i = 1; i < frames.size(); ++i) {
    Pose3 step = between(camera_at(member.frames[i - 1]), camera_at(member.frames[i]));
    step.t *= scale_at(frames[i].stamp);
    camera = compose(camera, step);
    frames[i].map_from_robot = compose(camera, inverse(robot_from_camera));
  }
  for (auto& [id, landmark] : member.map.landmarks) {
    const Eigen::Vector3d seen = landmark.point_in_anchor() - robot_from_camera.t;
    landmark.point_units = landmark_units(robot_from_camera.t + scale_at(member.map.nodes.find(landmark.anchor)->stamp) * seen);
    for (LandmarkSighting& sighting : landmark.seen) sighting.inverse_depth = 0;
  }
  forget(member.map, 8.0);
  for (auto& [id, node] : member.map.nodes) node.map_from_node = *pose_at(frames, node.stamp, 1.0);
  member.frames = frames;
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
  static void SetUpTestSuite() { robot_ = new Robot(drive(40.0)); }
  static void TearDownTestSuite() { delete robot_; }
  static const Robot& robot() { return *robot_; }

 private:
  static Robot* robot_;
};
Robot* TwoCameras::robot_ = nullptr;

TEST_F(TwoCameras, know_the_way_better_than_either_alone) {
  ASSERT_EQ(robot().members.size(), 2U);
  const TiedRig rig = tied(robot().members, robot().odometry);
  ASSERT_EQ(rig.maps.size(), 1U) << testing::PrintToString(rig.notes);
  const TiedMap& both = rig.maps[0];
  EXPECT_TRUE(both.solved);
  EXPECT_LT(both.apart_after_m, 0.5 * both.apart_before_m);
  EXPECT_EQ(both.map.nodes.size(), robot().members[0].map.nodes.size() + robot().members[1].map.nodes.size());
  EXPECT_EQ(both.map.landmarks.size(), robot().members[0].map.landmarks.size() + robot().members[1].map.landmarks.size());
  const double ahead_m = error_m(robot().members[0].frames, robot().truth), back_m = error_m(robot().members[1].frames, robot().truth);
  const double both_m = error_m(way_of(both, robot().members, robot().odometry), robot().truth);
  RecordProperty("errors", std::to_string(ahead_m) + " " + std::to_string(back_m) + " " + std::to_string(both_m));
  EXPECT_LT(both_m, 1.25 * std::min(ahead_m, back_m));
  EXPECT_LT(both_m, 0.5 * (ahead_m + back_m));
}

TEST_F(TwoCameras, are_left_as_they_lie_where_they_agree_well_enough) {
  RigOptions options;
  options.threshold_m = 1.0, options.threshold_rad = 1.0;
  const TiedRig rig = tied(robot().members, robot().odometry, options);
  ASSERT_EQ(rig.maps.size(), 1U);
  EXPECT_FALSE(rig.maps[0].solved);
  EXPECT_EQ(rig.maps[0].apart_before_m, rig.maps[0].apart_after_m);
}

TEST_F(TwoCameras, give_the_same_bytes_each_time) {
  const TiedRig one = tied(robot().members, robot().odometry), other = tied(robot().members, robot().odometry);
  EXPECT_EQ(bytes_of(one.maps[0].map), bytes_of(other.maps[0].map));
}

TEST_F(TwoCameras, are_tied_by_keyframes_alone_too) {
  std::vector<RigMember> members = robot().members;
  for (RigMember& member : members) member.frames.clear();
  RigOptions options;
  options.longest_gap_s = 3.0;
  const TiedRig rig = tied(members, {}, options);
  ASSERT_EQ(rig.maps.size(), 1U) << testing::PrintToString(rig.notes);
  double error = 0.0;
  for (const auto& frames : rig.maps[0].frames) error = std::max(error, error_m(frames, robot().truth));
  EXPECT_LT(error, std::max(error_m(robot().members[0].frames, robot().truth), error_m(robot().members[1].frames, robot().truth)));
}

TEST_F(TwoCameras, give_lengths_to_the_one_without_depth) {
  std::vector<RigMember> members = robot().members;
  members[1] = single(members[1], 0.4, 0.3);
  ASSERT_GT(error_m(members[1].frames, robot().truth), 0.5);
  const TiedRig rig = tied(members, {});
  ASSERT_EQ(rig.maps.size(), 1U) << testing::PrintToString(rig.notes);
  EXPECT_EQ(rig.maps[0].members.front(), 0U);
  EXPECT_LT(error_m(rig.maps[0].frames[1], robot().truth), 0.02);
  EXPECT_LT(error_m(way_of(rig.maps[0], members, {}), robot().truth), 1.1 * error_m(members[0].frames, robot().truth));
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

TEST_F(TwoCameras, without_depth_take_lengths_from_wheels) {
  const std::vector<RigMember> members{single(robot().members[0], 1.2, 0.5), single(robot().members[1], 0.8, -0.3)};
  const TiedRig rig = tied(members, robot().odometry);
  ASSERT_EQ(rig.maps.size(), 1U) << testing::PrintToString(rig.notes);
  EXPECT_EQ(rig.maps[0].members.size(), 2U);
  const double both_m = error_m(way_of(rig.maps[0], members, robot().odometry), robot().truth);
  RecordProperty("errors", std::to_string(error_m(robot().odometry, robot().truth)) + " " + std::to_string(both_m));
  EXPECT_LT(both_m, 0.1);
  EXPECT_LT(both_m, 0.3 * std::min(error_m(members[0].frames, robot().truth), error_m(members[1].frames, robot().truth)));
  for (const auto& entry : rig.maps[0].map.nodes) EXPECT_NE(entry.first.session.client.sensor, SensorId("wheels"));
}

TEST_F(TwoCameras, stay_apart_where_a_single_one_did_not_move) {
  const std::vector<RigMember> members{robot().members[0], part_of(single(robot().members[1], 0.4, 0.0), 0.0, 0.9)};
  RigOptions options;
  options.least_common_s = 0.5;
  const TiedRig rig = tied(members, {}, options);
  EXPECT_EQ(rig.maps.size(), 2U);
  EXPECT_THAT(rig.notes, testing::ElementsAre(testing::HasSubstr("'back', which has no depth")));
}

TEST_F(TwoCameras, that_never_saw_at_the_same_time_stay_apart) {
  const std::vector<RigMember> members{part_of(robot().members[0], 0.0, 20.0), part_of(robot().members[1], 25.0, 1e9)};
  EXPECT_EQ(tied(members, robot().odometry).maps.size(), 2U) << "wheels turn in the air where a robot is carried";
}

TEST_F(TwoCameras, believe_the_one_that_wheels_agree_with) {
  std::vector<RigMember> members = robot().members;
  const Pose3 aside{{0.0, 0.4, 0.0}, Eigen::Quaterniond::Identity()};
  const Stamp then{members[0].frames.front().stamp.ns + 30'000'000'000};
  for (auto& [id, node] : members[0].map.nodes)
    if (then < node.stamp) node.map_from_node = compose(aside, node.map_from_node);
  for (StampedPose& frame : members[0].frames)
    if (then < frame.stamp) frame.map_from_robot = compose(aside, frame.map_from_robot);
  forget(members[0].map, 2.4);
  ASSERT_GT(error_m(members[0].frames, robot().truth), 0.1);
  const double back_m = error_m(members[1].frames, robot().truth);
  const auto error = [&](const std::vector<StampedPose>& odometry) {
    const TiedRig rig = tied(members, odometry);
    return rig.maps.size() == 1 ? error_m(way_of(rig.maps[0], members, odometry), robot().truth) : 1e9;
  };
  EXPECT_LT(error(robot().odometry), 1.5 * back_m);
  EXPECT_GT(error({}), error(robot().odometry));
}

// Maps as a server has them: what clients told, and no more.
std::vector<Map> told(const std::vector<RigMember>& members) {
  std::vector<Map> maps;
  for (const RigMember& member : members) maps.push_back(member.map);
  return maps;
}

FusionResult joined(const SiblingMaps& siblings, const std::vector<Map>& maps) {
  FusionInput input;
  input.maps = siblings.maps;
  WorkerPool pool(1);
  Memo memo;
  FusionResult result = fuse(input, {}, memo, pool, *make_silent_progress());
  tell_apart(result, siblings.tied, maps);
  return result;
}

TEST_F(TwoCameras, are_told_apart_by_name_in_what_they_were_joined_to) {
  std::vector<RigMember> members = robot().members;
  members[1] = single(members[1], 0.4, 0.0);
  const std::vector<Map> maps = told(members);
  WorkerPool pool(2);
  const SiblingMaps siblings = tied_siblings(maps, {}, pool);
  ASSERT_EQ(siblings.maps.size(), 1U) << testing::PrintToString(siblings.notes);
  const FusionResult result = joined(siblings, maps);
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
      worst_m = std::max(worst_m, (transformed((scale != nullptr ? *scale : 1.0) * in_map, team_from_map) - in_team).norm());
    }
    EXPECT_LT(worst_m, 0.2) << map.id.str();
  }
  // The frame is that of who began first.
  const Map& first = *std::find_if(maps.begin(), maps.end(), [&](const Map& map) { return map.id == siblings.tied.front().map; });
  EXPECT_LT((team.map.nodes.find(first.nodes.front().first)->map_from_node.t - first.nodes.front().second.map_from_node.t).norm(), 1e-9);
}

TEST_F(TwoCameras, are_tied_to_the_same_bytes_in_any_order) {
  std::vector<Map> maps = told(robot().members);
  for (int i = 0; i < 2; ++i) {  // two robots more
    Map lonely;
    lonely.id = MapId(i == 0 ? "beta.camera" : "gamma.camera");
    const NodeId id{{{RobotId(i == 0 ? "beta" : "gamma"), SensorId("camera")}, 5}, 0};
    lonely.nodes.set(id, {id, Stamp{5}, {}, robot().members[0].map.nodes.front().second.payload});
    maps.push_back(lonely);
  }
  WorkerPool one(1), two(2);
  const SiblingMaps in_order = tied_siblings(maps, {}, one);
  std::reverse(maps.begin(), maps.end());
  const SiblingMaps reversed = tied_siblings(maps, {}, two);
  ASSERT_EQ(in_order.maps.size(), 3U);
  ASSERT_EQ(reversed.maps.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(bytes_of(in_order.maps[i]), bytes_of(reversed.maps[i]));
}

TEST(Rig, brings_a_camera_that_was_blind_back_by_its_sibling) {
  const Robot robot = drive(40.0, {"back", 15.0, 25.0});
  ASSERT_EQ(robot.members.size(), 3U) << "the camera begins anew";
  const TiedRig rig = tied(robot.members, robot.odometry);
  ASSERT_EQ(rig.maps.size(), 1U) << testing::PrintToString(rig.notes);
  const auto way = way_of(rig.maps[0], robot.members, robot.odometry);
  EXPECT_LT(error_m(way, robot.truth), 1.1 * error_m(robot.members[0].frames, robot.truth));
  // Every session lies right in the one map, not only in itself.
  std::vector<StampedPose> all;
  for (const auto& frames : rig.maps[0].frames) all.insert(all.end(), frames.begin(), frames.end());
  EXPECT_LT(error_m(all, robot.truth), 0.05);
}

TEST(Rig, says_so_where_a_camera_is_not_mounted_as_the_log_says) {
  const Robot robot = drive(20.0, {}, -20.0 * M_PI / 180.0);
  const TiedRig rig = tied(robot.members, robot.odometry);
  EXPECT_EQ(rig.maps.size(), 2U);
  ASSERT_EQ(rig.notes.size(), 1U);
  EXPECT_THAT(rig.notes[0], testing::AllOf(testing::HasSubstr("'ahead'"), testing::HasSubstr("'back'"), testing::HasSubstr("contradict"),
                                           testing::HasSubstr("20 deg farther to the left")));
}

}  // namespace
}  // namespace mapweave::fusion
