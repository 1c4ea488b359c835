#include "simulated_team.h"

#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/merge_runner.h>

#include <gmock/gmock.h>
#include <mapweave/core/files.h>
#include <mapweave/evaluation/absolute_error.h>
#include <mapweave/evaluation/trajectory_file.h>
#include <mapweave/mapdb/map_store.h>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

using test_support::simulated_team;
using testing::ElementsAre;
using testing::HasSubstr;
namespace fs = std::filesystem;

struct LogPartsTest : testing::Test {
  LogPartsTest() {
    configuration.robots[0].edge.clear();
    configuration.robots[0].edges = {"north", "south"};
  }
  Report run(const std::string& out, int threads = 1) {
    WorkerPool pool(threads);
    return run_batch(configuration, make_plan(configuration, {}), {folder / out, false, false}, pool,
                     *make_silent_progress());
  }
  std::string trouble() {
    try {
      make_plan(configuration, {});
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kBadInput);
      return error.what();
    }
    return "";
  }
  Map map_of(const std::string& run, const std::string& robot) {
    return mapdb::read_store(folder / run / "robots" / robot / "map.mwdb").maps.front();
  }
  test::TemporaryFolder folder;
  RunConfiguration configuration = simulated_team().configuration();
};

TEST_F(LogPartsTest, a_robot_whose_data_go_to_two_edges_is_mapped_by_both_and_merged_in_the_cloud) {
  const Report report = run("out");
  ASSERT_EQ(report.team.components.size(), 1u);
  EXPECT_THAT(report.team.components[0], ElementsAre(MapId("alpha.1"), MapId("alpha.2"), MapId("beta")));
  std::map<std::string, std::string> edge_of;
  for (const RobotReport& robot : report.robots) edge_of[robot.id.str()] = robot.edge.str();
  EXPECT_EQ(edge_of["alpha.1"], "north");
  EXPECT_EQ(edge_of["alpha.2"], "south");
  for (const RobotWork& work : report.work.robots) EXPECT_GT(work.sensed_bytes, 0u) << work.id.str();

  // Each part was mapped once, by one edge: together they have the scans of the whole log.
  const Map first = map_of("out", "alpha.1"), second = map_of("out", "alpha.2");
  EXPECT_LT(first.nodes.back().second.stamp, second.nodes.front().second.stamp);
  configuration.robots[0].edges.clear();
  run("whole");
  const Map whole = map_of("whole", "alpha");
  EXPECT_NEAR(static_cast<double>(first.nodes.size() + second.nodes.size()), static_cast<double>(whole.nodes.size()),
              2.0);

  // One robot, one trajectory, as right as from one edge.
  const auto estimate = evaluation::read_trajectory(folder / "out/team/trajectories/alpha.tum").trajectory;
  const auto reference = evaluation::read_trajectory(folder / "whole/team/trajectories/alpha.tum").trajectory;
  EXPECT_EQ(estimate.size(), first.nodes.size() + second.nodes.size());
  EXPECT_LT(evaluation::absolute_error(estimate, reference).translation_m.rmse, 0.02);
}

TEST_F(LogPartsTest, gives_the_same_bytes_for_any_number_of_threads_and_as_its_own_configuration_says) {
  run("one");
  run("three", 3);
  RunConfiguration again;
  const Origins origins = load(again, {{folder / "one/config.yaml"}, {}, {}});
  WorkerPool pool(1);
  run_batch(again, make_plan(again, origins), {folder / "again", false, false}, pool, *make_silent_progress());
  for (const char* other : {"three", "again"})
    EXPECT_EQ(read_file(folder / other / "team/map.mwdb"), read_file(folder / "one/team/map.mwdb")) << other;
}

TEST_F(LogPartsTest, stay_one_robot_when_their_team_is_merged_again) {
  configuration.cloud.maps.thin = false;
  run("monday");
  WorkerPool pool(1);
  RunConfiguration merging;
  merging.team.frame = "alpha";
  const Report report =
      run_merge(merging, {folder / "monday"}, {folder / "tuesday", false}, pool, *make_silent_progress());
  EXPECT_THAT(report.notes, testing::Not(testing::Contains(HasSubstr("is called"))));
  EXPECT_TRUE(fs::exists(folder / "tuesday/team/trajectories/alpha.tum"));
  EXPECT_FALSE(fs::exists(folder / "tuesday/team/trajectories/alpha.1.tum"));
  EXPECT_EQ(read_file(folder / "tuesday/team/trajectories/alpha.tum"),
            read_file(folder / "monday/team/trajectories/alpha.tum"));
}

TEST_F(LogPartsTest, links_frames_and_starts_are_those_of_the_robot) {
  LinkEntry link;
  link.from = "alpha";
  link.to = "south";
  link.bytes_per_s = 1000.0;
  configuration.network.links = {link};
  configuration.team.frame = "alpha";
  configuration.cloud.push_to = {"alpha"};
  configuration.robots[0].start.sigma_m = configuration.robots[1].start.sigma_m = 0.5;
  const Report report = run("out");
  EXPECT_EQ(report.team.frames.front().of, "alpha");
  EXPECT_TRUE(fs::exists(folder / "out/robots/alpha/team/map.png"));
  double north_s = 0.0, south_s = 0.0;
  for (const auto& line : report.timeline->robots) {
    if (line.id.str() == "alpha.1") north_s = line.arrived_s - line.packed_s;
    if (line.id.str() == "alpha.2") south_s = line.arrived_s - line.packed_s;
  }
  EXPECT_GT(south_s, 10.0 * north_s) << "a kilobyte a second";
}

TEST_F(LogPartsTest, are_refused_where_they_cannot_be) {
  configuration.robots[0].edge = "north";
  EXPECT_THAT(trouble(), HasSubstr("both `edge` and `edges`"));
  configuration.robots[0].edge.clear();
  configuration.mode = Mode::onboard;
  EXPECT_THAT(trouble(), HasSubstr("the robot maps itself"));
  configuration.mode = Mode::offload;
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  EXPECT_THAT(trouble(), HasSubstr("a coordinator gives each robot one edge"));
  configuration.coordinator.method = std::nullopt;
  configuration.robots[1].id = "alpha.2";
  EXPECT_THAT(trouble(), HasSubstr("called as a part of another robot"));
  configuration.robots[1].id = "beta";
  configuration.robots[0].edges[1] = "cloud";
  EXPECT_THAT(trouble(), HasSubstr("the tier above all edges"));
}

TEST_F(LogPartsTest, a_part_without_a_scan_is_trouble_that_names_it) {
  configuration.robots[0].edges.assign(3000, "north");
  try {
    run("out");
    FAIL() << "was mapped";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("alpha."));
  }
}

}  // namespace
}  // namespace mapweave::runtime
