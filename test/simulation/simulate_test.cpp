#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/simulation/observations.h>
#include <mapweave/simulation/simulate.h>
#include <mapweave/simulation/world.h>

#include <support/temporary_folder.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>
#include <string>

namespace mapweave::simulation {
namespace {

WorldOptions small_world() {
  WorldOptions options;
  options.robots.resize(3);
  options.robots[0].id = "alpha";
  options.robots[1].id = "beta";
  options.robots[2].id = "gamma";
  options.robots[1].edge = "north";
  for (RobotOptions& robot : options.robots) robot.length_m = 4.0;
  options.edges = 2;
  return options;
}

std::vector<SimulatedLog> simulated(const WorldOptions& options, const std::filesystem::path& folder, int threads = 1) {
  WorkerPool pool(threads);
  const auto progress = make_silent_progress();
  return simulate(options, folder, pool, *progress);
}

TEST(Simulate, writes_the_same_bytes_whatever_the_threads) {
  test::TemporaryFolder one, two, other;
  WorldOptions options = small_world();
  simulated(options, one.path(), 1);
  simulated(options, two.path(), 2);
  options.seed = 2;
  simulated(options, other.path(), 1);
  for (const char* name : {"alpha.rawlog", "beta.rawlog", "gamma.rawlog", "alpha.truth.tum"}) {
    EXPECT_TRUE(read_file(one / name) == read_file(two / name)) << name;
    EXPECT_FALSE(read_file(one / name) == read_file(other / name)) << name;
  }
}

TEST(Simulate, writes_a_log_that_reads_back_as_it_was_recorded) {
  test::TemporaryFolder folder;
  const WorldOptions options = small_world();
  const auto logs = simulated(options, folder.path());
  ASSERT_EQ(logs.size(), 3u);
  WorkerPool here(1);
  const World world(options, here);
  Recording recording(world, 1);
  const auto stream = rawlog::open_log(folder / "beta.rawlog");
  std::size_t scans = 0;
  while (const auto step = recording.next()) {
    const auto odometry_record = stream->next();
    ASSERT_TRUE(odometry_record);
    EXPECT_EQ(odometry_record->stamp, step->stamp);
    const auto odometry = std::dynamic_pointer_cast<mrpt::obs::CObservationOdometry>(odometry_record->observation);
    ASSERT_TRUE(odometry);
    EXPECT_NEAR(odometry->odometry.x(), step->odometry_from_robot.x, 1e-9);
    EXPECT_NEAR(odometry->odometry.phi(), step->odometry_from_robot.phi, 1e-9);
    if (step->ranges.empty()) continue;
    const auto scan_record = stream->next();
    ASSERT_TRUE(scan_record);
    EXPECT_EQ(scan_record->stamp, step->stamp);
    const auto scan = std::dynamic_pointer_cast<mrpt::obs::CObservation2DRangeScan>(scan_record->observation);
    ASSERT_TRUE(scan);
    ASSERT_EQ(scan->getScanSize(), step->ranges.size());
    for (std::size_t ray = 0; ray < step->ranges.size(); ++ray) {
      EXPECT_EQ(scan->getScanRangeValidity(ray), step->ranges[ray] > 0.0f);
      EXPECT_EQ(scan->getScanRange(ray), step->ranges[ray]);
    }
    ++scans;
  }
  EXPECT_FALSE(stream->next());
  EXPECT_EQ(scans, logs[1].scans);
  EXPECT_EQ(logs[1].robot, "beta");
  EXPECT_NEAR(logs[1].length_m, 4.0, 1e-6);
}

TEST(Simulate, writes_the_truth_of_every_scan) {
  test::TemporaryFolder folder;
  const WorldOptions options = small_world();
  simulated(options, folder.path());
  WorkerPool here(1);
  const World world(options, here);
  Recording recording(world, 0);
  std::istringstream truth(read_file(folder / "alpha.truth.tum"));
  while (const auto step = recording.next()) {
    if (step->ranges.empty()) continue;
    std::string stamp;
    double x, y, z, qx, qy, qz, qw;
    ASSERT_TRUE(truth >> stamp >> x >> y >> z >> qx >> qy >> qz >> qw);
    EXPECT_EQ(std::stoll(stamp.substr(0, 10)), step->stamp.ns / 1'000'000'000);
    EXPECT_EQ(std::stoll(stamp.substr(11)) * 1000, step->stamp.ns % 1'000'000'000);
    EXPECT_NEAR(x, step->world_from_robot.x, 1e-6);
    EXPECT_NEAR(y, step->world_from_robot.y, 1e-6);
    EXPECT_NEAR(wrap_angle(2.0 * std::atan2(qz, qw) - step->world_from_robot.phi), 0.0, 3e-6);
  }
  std::string rest;
  EXPECT_FALSE(truth >> rest);
}

TEST(Simulate, writes_a_configuration_for_run_with_edges_in_turn) {
  test::TemporaryFolder folder;
  simulated(small_world(), folder.path());
  const std::string text = read_file(folder / "run.yaml");
  EXPECT_THAT(text, testing::HasSubstr(R"({id: "alpha", log: "alpha.rawlog", edge: "edge0"})"));
  EXPECT_THAT(text, testing::HasSubstr(R"({id: "beta", log: "beta.rawlog", edge: "north"})"));
  EXPECT_THAT(text, testing::HasSubstr(R"({id: "gamma", log: "gamma.rawlog", edge: "edge1"})"));
}

TEST(Simulate, stops_when_interrupted) {
  test::TemporaryFolder folder;
  WorldOptions options = small_world();
  options.robots[0].length_m = 50.0;
  request_interrupt();
  EXPECT_THROW(simulated(options, folder.path()), Interrupted);
  clear_interrupt();
  EXPECT_FALSE(std::filesystem::exists(folder / "alpha.rawlog"));
}

TEST(Simulate, says_that_it_cannot_write) {
  test::TemporaryFolder folder;
  try {
    simulated(small_world(), folder / "not there");
    ADD_FAILURE() << "no error";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCannotWrite);
  }
}

TEST(Observations, carry_the_extrinsics_and_the_geometry_of_the_laser) {
  WorldOptions options = small_world();
  options.laser.x_m = 0.2;
  options.laser.yaw_deg = 30.0;
  options.laser.field_of_view_deg = 240.0;
  options.laser.rays = 241;
  WorkerPool here(1);
  const World world(options, here);
  const auto scan = scan_observation(*Recording(world, 0).next(), options.laser);
  EXPECT_NEAR(scan->sensorPose.x(), 0.2, 1e-12);
  EXPECT_NEAR(scan->sensorPose.yaw(), M_PI / 6.0, 1e-12);
  EXPECT_NEAR(scan->getScanAngle(0), options.laser.first_angle_rad(), 1e-5);
  EXPECT_NEAR(scan->getScanAngle(240), options.laser.first_angle_rad() + 240 * options.laser.angle_step_rad(), 1e-5);
  EXPECT_EQ(scan->maxRange, 20.0f);
}

}  // namespace
}  // namespace mapweave::simulation
