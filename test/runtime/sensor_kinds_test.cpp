// Which sensors a log is mapped with, and a sensor that came in by the table alone: depth pictures as scans.
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/progress.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/rawlog/rawlog_writer.h>
#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/sensor_choice.h>
#include <mapweave/simulation/simulate.h>
#include <support/temporary_folder.h>

#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservation3DRangeScan.h>

#include <set>

namespace mapweave::runtime {
namespace {

// Two robots' logs of one room: with a laser and a depth camera, and what a depth sensor without colours leaves of
// them.
class TwoRobots {
 public:
  TwoRobots() {
    simulation::WorldOptions world;
    simulation::CameraOptions camera;
    camera.width = 80;
    camera.height = 60;
    camera.fx = camera.fy = 65.5;
    camera.frames_per_second = 4.0;
    for (const char* id : kIds) {
      simulation::RobotOptions robot;
      robot.id = id;
      robot.length_m = 25.0;
      robot.last_room = 1;
      robot.cameras.push_back(camera);
      world.robots.push_back(robot);
    }
    WorkerPool pool(1);
    simulation::simulate(world, folder_.path(), pool, *make_silent_progress());
    std::filesystem::create_directories(folder_ / "depth");
    for (const char* id : kIds) write_depth_log(std::string(id) + ".rawlog");
  }
  // `folder`: "" or "depth".
  RunConfiguration configuration(const std::string& folder, const std::string& sensor) const {
    RunConfiguration result;
    for (const char* id : kIds)
      result.robots.push_back({id, (folder_ / folder / (std::string(id) + ".rawlog")).string(), ""});
    result.sensor = sensor;
    return result;
  }

 private:
  static constexpr const char* kIds[] = {"alpha", "beta"};

  void write_depth_log(const std::string& name) const {
    rawlog::RawlogWriter writer(folder_ / "depth" / name);
    const auto log = rawlog::open_log(folder_ / name);
    while (const auto record = log->next()) {
      if (dynamic_cast<const mrpt::obs::CObservation2DRangeScan*>(record->observation.get()) != nullptr) continue;
      if (auto* picture = dynamic_cast<mrpt::obs::CObservation3DRangeScan*>(record->observation.get()))
        picture->hasIntensityImage = false;
      writer.add(*record->observation);
    }
    writer.close();
  }

  test::TemporaryFolder folder_;
};

const TwoRobots& two_robots() {
  static const TwoRobots robots;
  return robots;
}

PlannedRobot chosen(const RunConfiguration& configuration) {
  RunPlan plan = make_plan(configuration, {});
  WorkerPool pool(1);
  choose_sensors(plan, configuration, pool);
  return plan.robots.front();
}

Report run(const RunConfiguration& configuration, const std::filesystem::path& out) {
  WorkerPool pool(2);
  return run_batch(configuration, make_plan(configuration, {}), {out, false, false}, pool, *make_silent_progress());
}

TEST(SensorKinds, have_names_of_their_own) {
  const std::set<std::string_view> names(kSensorChoices.begin(), kSensorChoices.end());
  EXPECT_EQ(names.size(), kSensorChoices.size());
  for (const SensorKind& kind : kSensorKinds) {
    EXPECT_EQ(sensor_kind(kind.name), &kind);
    EXPECT_EQ(kind.task == SensorTask::frames, kind.camera != visual::CameraKind::automatic) << kind.name;
  }
  EXPECT_EQ(sensor_kind("auto"), nullptr);
}

TEST(SensorKinds, are_known_by_the_beginning_of_a_log) {
  const PlannedRobot by_laser = chosen(two_robots().configuration("", "auto"));
  EXPECT_EQ(by_laser.sensors.scans, &kLaser);
  EXPECT_TRUE(by_laser.sensors.cameras.empty());
  const PlannedRobot by_all = chosen(two_robots().configuration("", "all"));
  EXPECT_EQ(by_all.sensors.scans, &kLaser);
  ASSERT_EQ(by_all.sensors.cameras.size(), 1U);
  EXPECT_EQ(by_all.sensors.cameras[0].kind, sensor_kind("rgbd"));
  const PlannedRobot by_pictures = chosen(two_robots().configuration("", "mono"));
  EXPECT_EQ(by_pictures.sensors.scans, nullptr);
  ASSERT_EQ(by_pictures.sensors.cameras.size(), 1U);
  EXPECT_EQ(by_pictures.sensors.cameras[0].kind, sensor_kind("mono"));
  EXPECT_EQ(chosen(two_robots().configuration("depth", "auto")).sensors.scans, sensor_kind("depth"));
  EXPECT_EQ(chosen(two_robots().configuration("", "depth")).sensors.scans, sensor_kind("depth"));
}

TEST(SensorKinds, that_a_log_does_not_have_are_trouble_that_names_what_it_has) {
  const auto said = [](const RunConfiguration& configuration) {
    const auto trouble = chosen(configuration).trouble;
    return trouble ? std::string(trouble->what()) : "no trouble";
  };
  EXPECT_NE(
      said(two_robots().configuration("", "stereo")).find("no stereo pair; it has a laser, depth camera 'camera'"),
      std::string::npos)
      << said(two_robots().configuration("", "stereo"));
  EXPECT_NE(said(two_robots().configuration("depth", "rgbd")).find("no depth camera; it has a depth sensor"),
            std::string::npos)
      << said(two_robots().configuration("depth", "rgbd"));
}

// Whether the two are merged is another matter: a narrow view shows few walls at a time.
TEST(DepthSensor, is_mapped_from_logs_to_results) {
  test::TemporaryFolder folder;
  const Report report = run(two_robots().configuration("depth", "auto"), folder / "out");
  ASSERT_EQ(report.robots.size(), 2U);
  for (const RobotReport& robot : report.robots) {
    EXPECT_TRUE(robot.mapped) << robot.id.str();
    EXPECT_GT(robot.scans, 50U) << robot.id.str();
    EXPECT_TRUE(robot.cameras.empty()) << robot.id.str();
  }
  ASSERT_EQ(report.team.verdicts.size(), 1U);
  const mapdb::StoredMaps stored = mapdb::read_store(folder / "out/robots/alpha/map.mwdb");
  ASSERT_EQ(stored.maps.size(), 1U);
  EXPECT_FALSE(stored.maps[0].submaps.empty());
  for (const SessionId& session : stored.maps[0].sessions()) EXPECT_EQ(session.client.sensor, SensorId("depth"));
}

}  // namespace
}  // namespace mapweave::runtime
