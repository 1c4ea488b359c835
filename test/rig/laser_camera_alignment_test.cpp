#include <mapweave/rig/laser_camera_alignment.h>

#include <gtest/gtest.h>
#include <support/starry_maps.h>

namespace mapweave::rig {
namespace {

// A trajectory that comes back to where it began.
std::vector<Pose2> round_trip() {
  std::vector<Pose2> trajectory;
  for (int i = 0; i <= 40; ++i) {
    const double angle = 2.0 * M_PI * i / 40;
    trajectory.push_back({1.5 * std::sin(angle), 1.5 - 1.5 * std::cos(angle), wrap_angle(angle)});
  }
  return trajectory;
}

SessionId laser_session(const char* robot) { return {{RobotId(robot), SensorId("laser")}, 1'000'000'000}; }
SessionId camera_session(const char* robot) { return {{RobotId(robot), SensorId("camera")}, 1'000'000'000}; }

// Nodes of a laser at the times of keyframes, bending by `drift` from each to the next.
Map laser_map(const char* robot, const std::vector<Pose2>& trajectory, double drift_rad, double sigma_m = 0.02,
              double sigma_rad = 0.02) {
  Map map;
  map.id = MapId(robot);
  Pose2 pose;
  const Eigen::Matrix3d information =
      Eigen::Vector3d(1 / (sigma_m * sigma_m), 1 / (sigma_m * sigma_m), 1 / (sigma_rad * sigma_rad)).asDiagonal();
  for (std::uint32_t i = 0; i < trajectory.size(); ++i) {
    const NodeId id{laser_session(robot), i};
    if (i > 0) {
      Pose2 step = between(trajectory[i - 1], trajectory[i]);
      step.phi += drift_rad;
      pose = compose(pose, step);
      const NodeId before{laser_session(robot), i - 1};
      map.constraints.set({ConstraintKind::odometry, before, id, 0},
                          planar_constraint({ConstraintKind::odometry, before, id, 0}, step, information));
    }
    map.nodes.set(id, {id, {1'000'000'000 + std::int64_t{i} * 100'000'000}, spatial(pose), nullptr});
  }
  return map;
}

double gap_m(const Map& map, const SessionId& session) {
  const Pose3 &first = map.nodes.find({session, 0})->map_from_node,
              &last = map.nodes.find({session, 40})->map_from_node;
  return (first.t - last.t).head<2>().norm();
}

TEST(LaserCameraAlignment, lets_what_a_camera_knows_again_move_the_laser) {
  const test::StarryBuilding building({1});
  const Map laser = laser_map("alpha", round_trip(), 0.004), camera = building.keyframe_map("alpha", round_trip());
  ASSERT_GT(gap_m(laser, laser_session("alpha")), 0.2);
  const LaserCameraMap result = align_cameras(laser, {camera});
  EXPECT_TRUE(result.apart.empty());
  EXPECT_EQ(result.map.nodes.size(), laser.nodes.size() + camera.nodes.size());
  EXPECT_EQ(result.map.landmarks.size(), camera.landmarks.size());
  EXPECT_LT(gap_m(result.map, laser_session("alpha")), 0.05);
}

TEST(LaserCameraAlignment, lets_a_sure_laser_move_keyframes) {
  const test::StarryBuilding building({1});
  test::StarryOptions bent;
  bent.drift_rad_per_keyframe = 0.006;
  std::vector<Pose2> trajectory = round_trip();
  trajectory.resize(24);
  const Map laser = laser_map("alpha", trajectory, 0.0, 0.001, 0.0005),
            camera = building.keyframe_map("alpha", trajectory, bent);
  const Map& both = align_cameras(laser, {camera}).map;
  const auto error_rad = [&](const Map& map) {
    const Pose2 first = planar(map.nodes.find({camera_session("alpha"), 0})->map_from_node),
                last = planar(map.nodes.find({camera_session("alpha"), 23})->map_from_node);
    return std::abs(wrap_angle(between(first, last).phi - between(trajectory[0], trajectory[23]).phi));
  };
  EXPECT_GT(error_rad(camera), 0.1);
  EXPECT_LT(error_rad(both), 0.06);
}

TEST(LaserCameraAlignment, gives_a_single_camera_the_lasers_scale) {
  const test::StarryBuilding building({1});
  test::StarryOptions single;
  single.depth = false;
  single.scale = 0.25;
  const Map laser = laser_map("alpha", round_trip(), 0.0);
  const LaserCameraMap result = align_cameras(laser, {building.keyframe_map("alpha", round_trip(), single)});
  const Pose3 &start = result.map.nodes.find({camera_session("alpha"), 0})->map_from_node,
              &middle = result.map.nodes.find({camera_session("alpha"), 20})->map_from_node;
  EXPECT_NEAR((start.t - middle.t).norm(), 3.0, 0.1);
}

TEST(LaserCameraAlignment, leaves_a_camera_apart_that_saw_another_time) {
  const test::StarryBuilding building({1});
  Map camera = building.keyframe_map("alpha", round_trip());
  for (auto& entry : camera.nodes) entry.second.stamp.ns += 1'000'000'000'000;
  const Map laser = laser_map("alpha", round_trip(), 0.004);
  const LaserCameraMap result = align_cameras(laser, {camera});
  ASSERT_EQ(result.apart.size(), 1U);
  EXPECT_EQ(result.map.nodes.size(), laser.nodes.size());
  EXPECT_EQ(gap_m(result.map, laser_session("alpha")), gap_m(laser, laser_session("alpha")));
}

}  // namespace
}  // namespace mapweave::rig
