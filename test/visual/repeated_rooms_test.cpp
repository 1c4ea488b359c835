// Rooms that look alike to the last picture on the wall, and a robot that is carried from one into another.
#include <mapweave/matching/rigid_from_points.h>
#include <mapweave/simulation/feature_sensor.h>
#include <mapweave/visual/visual_client.h>
#include <support/seen_frame.h>

#include <gmock/gmock.h>
#include <map>

namespace mapweave::visual {
namespace {

struct Outcome {
  std::map<int, double> error_m;  // of each session that stands apart: the greatest, laid on the truth
  int frames = 0, placed = 0, loops = 0;
};

simulation::WorldOptions world_of(simulation::PlanKind kind, std::int64_t seed) {
  simulation::WorldOptions options;
  options.seed = seed;
  options.buildings.resize(1);
  options.buildings[0].kind = kind;
  options.buildings[0].seed = seed;
  options.cameras.resize(1);
  options.cameras[0].kind = simulation::SimulatedCameraKind::rgbd;
  options.cameras[0].frames_per_second = 12.0;
  options.robots.resize(1);
  options.robots[0].id = "alpha";
  return options;
}

simulation::KidnappingOptions carried(double after_m, double skip_m, double duration_s) {
  simulation::KidnappingOptions kidnapping;
  kidnapping.after_m = after_m;
  kidnapping.skip_m = skip_m;
  kidnapping.duration_s = duration_s;
  return kidnapping;
}

Outcome drive(const simulation::WorldOptions& options, bool has_wheels) {
  WorkerPool here(1);
  const simulation::World world(options, here);
  const simulation::FeatureOptions features;
  const simulation::LandmarkField field(world.scene(0), world.buildings()[0], features);
  const simulation::FeatureRecording recording(world, field, features, 0, 0);
  const auto& model = options.cameras[0].intrinsics();
  VisualClient client({model.width, model.height, model.fx, model.fy, model.cx, model.cy}, 0.0, {},
                      matching::shipped_vocabulary());
  const Pose3 robot_from_camera =
      compose(inverse(world.world_from_robot(0, 0.0)), recording.frame(0).world_from_camera);
  simulation::Recording wheels(world, 0);
  auto wheels_said = wheels.next(), next = wheels_said;
  Outcome outcome;
  std::map<std::int64_t, Eigen::Vector3d> truth;
  for (std::size_t i = 0; i < recording.frame_count(); ++i) {
    const simulation::SimulatedFeatureFrame seen = recording.frame(i);
    for (; next && !(seen.stamp < next->stamp); next = wheels.next()) wheels_said = next;
    FeatureFrame frame = test::frame_of(seen);
    if (has_wheels) frame.odometry_from_camera = compose(spatial(wheels_said->odometry_from_robot), robot_from_camera);
    client.add(frame);
    truth[seen.stamp.ns] = seen.world_from_camera.t;
  }
  client.finish();
  std::map<int, std::vector<matching::PointPair>> pairs;
  for (const PlacedFrame& placed : client.trajectory()) {
    pairs[placed.session].push_back({truth.at(placed.stamp.ns), placed.map_from_camera.t});
    ++outcome.placed;
  }
  for (const auto& [session, of_session] : pairs) {
    const auto laid = matching::align_points(of_session, matching::Freedom::rigid);
    double& worst = outcome.error_m[session];
    for (const matching::PointPair& pair : of_session)
      worst = std::max(worst, laid ? (transformed(pair.in_b, laid->pose) - pair.in_a).norm() : 0.0);
  }
  outcome.frames = static_cast<int>(recording.frame_count());
  outcome.loops = static_cast<int>(client.loops().size());
  return outcome;
}

class RepeatedRooms : public testing::TestWithParam<int> {};

TEST_P(RepeatedRooms, are_not_taken_for_one_another_by_who_was_carried) {
  simulation::WorldOptions options = world_of(simulation::PlanKind::repeated_rooms, GetParam());
  options.robots[0].last_room = 2;
  options.robots[0].kidnappings = {carried(15.0, 6.0, 4.0)};
  const Outcome outcome = drive(options, GetParam() % 2 == 1);
  EXPECT_GE(outcome.error_m.size(), 2U);
  for (const auto& [session, error_m] : outcome.error_m) EXPECT_LT(error_m, 0.1) << "session " << session;
  EXPECT_GT(outcome.placed, 0.8 * outcome.frames);
}
INSTANTIATE_TEST_SUITE_P(Seeds, RepeatedRooms, testing::Values(1, 2, 3, 4, 7));

TEST(UniqueRooms, are_known_again_by_who_was_carried) {
  simulation::WorldOptions options = world_of(simulation::PlanKind::apartment, 7);
  options.robots[0].last_room = 2;
  options.robots[0].laps = 3;
  options.robots[0].kidnappings = {carried(35.0, 8.0, 4.0)};
  const Outcome outcome = drive(options, true);
  ASSERT_EQ(outcome.error_m.size(), 1U);
  EXPECT_LT(outcome.error_m.begin()->second, 0.1);
  EXPECT_GE(outcome.loops, 2);
}

}  // namespace
}  // namespace mapweave::visual
