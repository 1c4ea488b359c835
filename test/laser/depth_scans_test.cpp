#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/laser/depth_scans.h>
#include <mapweave/laser/graph_mapper.h>
#include <mapweave/laser/scan_input.h>
#include <mapweave/simulation/observations.h>

#include <deque>

namespace mapweave::laser {
namespace {

class Records : public rawlog::ObservationStream {
 public:
  void add(mrpt::obs::CObservation::Ptr observation) {
    const Stamp stamp = rawlog::to_stamp(observation->timestamp);
    records_.push_back({stamp, std::move(observation)});
  }
  std::optional<rawlog::Record> next() override {
    if (records_.empty()) return std::nullopt;
    rawlog::Record first = records_.front();
    records_.pop_front();
    return first;
  }
  std::uint64_t bytes_read() const override { return 0; }
  std::uint64_t bytes_total() const override { return 0; }

 private:
  std::deque<rawlog::Record> records_;
};

// A wall 2 m ahead, above a floor that is seen 30 rows below the middle.
mrpt::obs::CObservation3DRangeScan::Ptr wall_ahead() {
  auto picture = mrpt::obs::CObservation3DRangeScan::Create();
  picture->timestamp = rawlog::to_mrpt_time({std::int64_t{100} * 1'000'000'000});
  picture->sensorLabel = "depth";
  picture->sensorPose = mrpt::poses::CPose3D(0.1, 0.0, 0.5, 0.0, 0.0, 0.0);
  picture->hasRangeImage = picture->range_is_depth = true;
  picture->rangeUnits = 0.001F;
  picture->maxRange = 5.0F;
  picture->cameraParams.setIntrinsicParamsFromValues(100.0, 100.0, 79.5, 59.5);
  picture->rangeImage_setSize(120, 160);
  picture->rangeImage.fill(2000);
  for (int row = 90; row < 120; ++row)
    for (int column = 0; column < 160; ++column) picture->rangeImage(row, column) = 800;
  return picture;
}

std::optional<PackedScan> first_scan(const mrpt::obs::CObservation::Ptr& picture) {
  auto log = std::make_unique<Records>();
  log->add(picture);
  const auto record = depth_scans(std::move(log))->next();
  ScanPacker packer;
  const auto input = record ? packer(*record) : std::nullopt;
  return input ? std::optional(std::get<ScanInput>(*input).scan) : std::nullopt;
}

std::string said(std::unique_ptr<rawlog::ObservationStream> log) {
  try {
    while (log->next())
      ;
  } catch (const Error& error) {
    return error.what();
  }
  return {};
}

TEST(DepthScans, are_straight_where_a_wall_is) {
  const auto scan = first_scan(wall_ahead());
  ASSERT_TRUE(scan);
  const auto points = points_in_robot(*scan);
  ASSERT_EQ(points.size(), 155U) << "77 degrees";
  for (const ScanPoint& point : points) EXPECT_NEAR(point.x, 2.1, 0.002);
  EXPECT_NEAR(points.front().y, -1.59, 0.01) << "from the right to the left";
  EXPECT_NEAR(points.back().y, 1.59, 0.01);
}

TEST(DepthScans, know_nothing_where_nothing_was_measured) {
  const auto picture = wall_ahead();
  for (int row = 0; row < 120; ++row)
    for (int column = 0; column < 80; ++column) picture->rangeImage(row, column) = 0;
  for (int column = 80; column < 160; column += 2) picture->rangeImage(59, column) = 4000;  // single wrong pixels
  const auto scan = first_scan(picture);
  ASSERT_TRUE(scan);
  const auto points = points_in_robot(*scan);
  EXPECT_EQ(points.size(), 78U);
  for (const ScanPoint& point : points) {
    EXPECT_LE(point.y, 1e-6);
    EXPECT_NEAR(point.x, 2.1, 0.002);
  }
}

TEST(DepthScans, say_what_is_missing) {
  auto without_calibration = std::make_unique<Records>();
  const auto picture = wall_ahead();
  picture->cameraParams.setIntrinsicParamsFromValues(0.0, 0.0, 0.0, 0.0);
  without_calibration->add(picture);
  EXPECT_NE(said(depth_scans(std::move(without_calibration))).find("calibration"), std::string::npos);
  EXPECT_NE(said(depth_scans(std::make_unique<Records>())).find("no depth picture"), std::string::npos);
}

// Root mean square distances of the map and of the odometry from the truth, first poses laid on each other.
struct Errors {
  double map_m = 0.0, odometry_m = 0.0;
};
Errors errors_of(const simulation::WorldOptions& options) {
  WorkerPool pool(1);
  const simulation::World world(options, pool);
  const simulation::CameraRecording camera(world, 0, 0);
  simulation::CameraRecording::Workspace workspace;
  const auto truth_at = [&](Stamp stamp) {
    return planar(world.world_from_robot(0, seconds_between(world.first_stamp(0), stamp)));
  };
  const auto squared = [](const Pose2& pose, const Pose2& truth) {
    return (pose.x - truth.x) * (pose.x - truth.x) + (pose.y - truth.y) * (pose.y - truth.y);
  };
  Errors errors;
  auto log = std::make_unique<Records>();
  simulation::Recording recording(world, 0);
  std::size_t frame = 0, steps = 0;
  std::optional<Pose2> odometry_from_world;
  while (const auto step = recording.next()) {
    for (; frame < camera.frame_count() && camera.stamp(frame) < step->stamp; ++frame)
      log->add(simulation::camera_observation(camera.frame(frame, workspace), camera.options()));
    log->add(simulation::odometry_observation(*step));
    if (!odometry_from_world) odometry_from_world = compose(step->odometry_from_robot, inverse(step->world_from_robot));
    errors.odometry_m += squared(step->odometry_from_robot, compose(*odometry_from_world, step->world_from_robot));
    ++steps;
  }
  GraphMapper mapper({RobotId("alpha"), SensorId("depth")}, {});
  ScanPacker packer;
  const auto scans = depth_scans(std::move(log));
  while (const auto record = scans->next())
    if (const auto input = packer(*record)) mapper.add(*input);
  mapper.finish();
  const Map map = mapper.snapshot();
  std::optional<Pose2> map_from_world;
  for (const auto& [id, node] : map.nodes) {
    const Pose2 pose = planar(node.map_from_node), truth = truth_at(node.stamp);
    if (!map_from_world) map_from_world = compose(pose, inverse(truth));
    errors.map_m += squared(pose, compose(*map_from_world, truth));
  }
  errors.map_m = std::sqrt(errors.map_m / static_cast<double>(map.nodes.size()));
  errors.odometry_m = std::sqrt(errors.odometry_m / static_cast<double>(steps));
  return errors;
}

TEST(DepthScans, map_rooms_better_than_wheels) {
  simulation::WorldOptions options;
  options.buildings.resize(1);
  simulation::RobotOptions robot;
  robot.id = "alpha";
  robot.length_m = 40.0;
  simulation::CameraOptions camera;
  camera.width = 80;
  camera.height = 60;
  camera.fx = camera.fy = 65.5;
  camera.frames_per_second = 5.0;
  robot.cameras.push_back(camera);
  options.robots.push_back(robot);
  for (const std::int64_t seed : {1, 3}) {
    options.seed = seed;
    const Errors errors = errors_of(options);
    EXPECT_LT(errors.map_m, 0.25) << "seed " << seed;
    EXPECT_LT(errors.map_m, 0.6 * errors.odometry_m) << "seed " << seed;
  }
}

}  // namespace
}  // namespace mapweave::laser
