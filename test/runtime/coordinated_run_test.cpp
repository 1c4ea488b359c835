// Runs whose robots a coordinator gives to edges.

#include "simulated_team.h"

#include <mapweave/runtime/batch_runner.h>

#include <gmock/gmock.h>
#include <mapweave/core/files.h>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

using nlohmann::json;
using test_support::simulated_team;
namespace fs = std::filesystem;

json parsed(const fs::path& file) { return json::parse(read_file(file)); }

struct CoordinatedRun : testing::Test {
  CoordinatedRun() {
    for (RobotEntry& robot : configuration.robots) robot.edge.clear();
    configuration.edges = {{"north"}, {"south"}};
    configuration.coordinator.overlap_period_s = 3.0;
  }
  Report run(const std::string& out, int threads = 1) {
    WorkerPool pool(threads);
    return run_batch(configuration, make_plan(configuration, {}), {folder / out, false, false}, pool, *silent);
  }
  void expect_same(const std::string& one, const std::string& other, const std::vector<std::string>& files) {
    for (const std::string& file : files)
      EXPECT_TRUE(read_file(folder / one / file) == read_file(folder / other / file)) << other << " " << file;
  }
  const std::vector<std::string> kMaps{"robots/alpha/map.mwdb", "robots/beta/map.mwdb", "team/map.mwdb",
                                       "team/trajectories/beta.tum"};
  test::TemporaryFolder folder;
  RunConfiguration configuration = simulated_team().configuration();
  std::unique_ptr<Progress> silent = make_silent_progress();
};

TEST_F(CoordinatedRun, makes_the_same_maps_and_says_why_robots_went_where) {
  run("alone");
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  const Report report = run("coordinated");
  expect_same("alone", "coordinated", kMaps);
  ASSERT_TRUE(report.coordination);
  const auto& decisions = report.coordination->decisions;
  ASSERT_GT(decisions.size(), 2u);
  EXPECT_EQ(decisions.front().at_s, 0.0);
  EXPECT_EQ(decisions.front().moves.size(), 2u);
  EXPECT_THAT(decisions.front().because,
              testing::IsSupersetOf({"robot alpha comes", "robot beta comes", "edge north comes"}));
  EXPECT_THAT(decisions[1].because, testing::Contains("maps have grown"));
  EXPECT_GT(decisions.back().expected_s, 0.0);
  EXPECT_GT(report.coordination->summary_bytes, 100u);
  const json written = parsed(folder / "coordinated/summary.json")["coordinator"];
  EXPECT_EQ(written["method"], "default");
  EXPECT_EQ(written["decisions"].size(), decisions.size());
  EXPECT_EQ(written["decisions"][1]["because"], json(decisions[1].because));
  EXPECT_EQ(written["decisions"].back()["placement"].size(), 2u);
  EXPECT_EQ(written["came_seconds"], report.timeline->total_s);
  EXPECT_EQ(report.work.overlaps.size(), 1u) << "of the merged map, whatever the coordinator took it for";
}

TEST_F(CoordinatedRun, decides_the_same_with_any_number_of_threads) {
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  configuration.edges[1].until_s = 5.0;
  const Report one = run("one", 1), two = run("two", 2);
  EXPECT_EQ(parsed(folder / "one/manifest.json")["outputs"], parsed(folder / "two/manifest.json")["outputs"]);
  ASSERT_EQ(one.coordination->decisions.size(), two.coordination->decisions.size());
  for (std::size_t i = 0; i < one.coordination->decisions.size(); ++i) {
    EXPECT_EQ(one.coordination->decisions[i].edge_of, two.coordination->decisions[i].edge_of);
    EXPECT_EQ(one.coordination->decisions[i].expected_s, two.coordination->decisions[i].expected_s);
    EXPECT_EQ(one.coordination->decisions[i].because, two.coordination->decisions[i].because);
  }
}

TEST_F(CoordinatedRun, sees_the_maps_of_helpers_as_they_grow) {
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  for (const laser::Engine engine : {laser::Engine::icp, laser::Engine::rbpf}) {
    configuration.laser.engine = engine;
    const std::string name = engine == laser::Engine::icp ? "icp" : "rbpf";
    const Report report = run(name);
    const auto& decisions = report.coordination->decisions;
    EXPECT_EQ(decisions.front().unknown.size(), 2u) << name << ": neither a map nor a route yet";
    EXPECT_TRUE(decisions.back().unknown.empty()) << name;
    EXPECT_FALSE(decisions.back().overlaps.empty()) << name;
    EXPECT_THAT(in_words(report, name), testing::HasSubstr("blindly"));
  }
}

// One robot: every summary is the slowest.
TEST_F(CoordinatedRun, says_how_long_summaries_take_from_where_the_maps_are) {
  configuration.robots.resize(1);
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  configuration.network.edge_cloud.bytes_per_s = 1000.0;
  configuration.network.robot_edge.bytes_per_s = 500.0;
  configuration.network.robot_cloud.bytes_per_s = 250.0;
  TierId edge;
  std::string name;
  const auto expect_rate = [&](double bytes_per_s) {
    const Report report = run(name);
    const CoordinationReport& coordination = *report.coordination;
    edge = report.work.robots.at(0).edge;
    EXPECT_GT(coordination.summary_bytes, 100u) << name;
    const double expected_s = bytes_per_s > 0.0 ? static_cast<double>(coordination.summary_bytes) / bytes_per_s : 0.0;
    EXPECT_NEAR(coordination.summary_s, expected_s, 1e-9 * expected_s) << name;
  };
  name = "edge-to-cloud";
  expect_rate(1000.0);
  const std::string here = edge.str(), other = here == "north" ? "south" : "north";
  name = "at-its-edge";
  configuration.coordinator.at = here;
  expect_rate(0.0);
  name = "at-another-edge";
  configuration.coordinator.at = other;
  expect_rate(1000.0);
  name = "cloud-at-its-edge";
  configuration.coordinator.at.clear();
  configuration.cloud.at = here;
  expect_rate(0.0);

  configuration.mode = Mode::onboard;
  name = "robot-to-cloud-at-an-edge";
  expect_rate(500.0);
  name = "robot-to-cloud";
  configuration.cloud.at.clear();
  expect_rate(250.0);
}

TEST_F(CoordinatedRun, loses_nothing_of_an_edge_that_goes) {
  configuration.cloud.maps.thin = false;
  run("alone");
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  configuration.edges[1].until_s = 5.0;
  const Report report = run("gone");
  expect_same("alone", "gone", kMaps);
  EXPECT_FALSE(fs::exists(folder / "gone/edges/south"));
  std::uint64_t repeated = 0;
  for (const RobotWork& robot : report.work.robots) {
    EXPECT_EQ(robot.edge, TierId("north"));
    repeated += robot.repeated_bytes;
  }
  EXPECT_GT(repeated, 1000u) << "what was sensed before went to the other edge";
  configuration.edges[0].until_s = 7.0;
  run("both-gone");
  expect_same("alone", "both-gone", kMaps);
  EXPECT_FALSE(fs::exists(folder / "both-gone/edges"));
}

TEST_F(CoordinatedRun, expects_robots_to_map_where_the_mode_has_them_do) {
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  configuration.processors.robot = 0.01;
  const double offloaded_s = run("offload").coordination->decisions.back().expected_s;
  configuration.mode = Mode::onboard;
  const Report report = run("onboard");
  EXPECT_GT(report.coordination->decisions.back().expected_s, 2.0 * offloaded_s)
      << "robots a hundred times slower map themselves";
  expect_same("offload", "onboard", kMaps);
}

TEST_F(CoordinatedRun, expects_what_wires_and_processors_are_said_to_be) {
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  int runs = 0;
  const auto expected_s = [&](const char* model) {
    write_file(folder / "model.json", model);
    configuration.coordinator.model = (folder / "model.json").string();
    return run("run" + std::to_string(runs++)).coordination->decisions.back().expected_s;
  };
  const double at_once_s = expected_s("{}");
  configuration.network.edge_cloud.delay_s = 7.0;
  EXPECT_NEAR(expected_s("{}"), at_once_s + 7.0, 1e-9);
  configuration.network.edge_cloud.delay_s = 0.0;

  constexpr const char* kPairs = R"({"cloud_fusion": {"per_scan_pair_s": 1}})";
  const double edges_judge_s = expected_s(kPairs);
  configuration.processors.cloud = 0.01;
  EXPECT_NEAR(expected_s(kPairs), edges_judge_s, 0.01 * edges_judge_s) << "edges judge, and are as fast as before";
  configuration.processors.edge = 0.5;
  EXPECT_GT(expected_s(kPairs), 1.9 * edges_judge_s);
  configuration.cloud.edges_judge = false;
  EXPECT_GT(expected_s(kPairs), 100.0 * edges_judge_s) << "a cloud a hundred times slower, alone";

  configuration.cloud.edges_judge = true;
  configuration.mode = Mode::onboard;
  configuration.network.robot_edge.bytes_per_s = 1e5;
  const double small_s = expected_s(R"({"map_bytes_fixed": 0})");
  EXPECT_NEAR(expected_s(R"({"map_bytes_fixed": 1e6})"), small_s + 10.0, 0.1) << "maps go from robots to edges";
}

TEST_F(CoordinatedRun, learns_of_a_robot_when_it_comes) {
  configuration.coordinator.method = scheduling::PlanMethod::greedy;
  configuration.robots[1].from_s = 6.0;
  const Report report = run("late");
  const auto& decisions = report.coordination->decisions;
  EXPECT_EQ(decisions.front().edge_of.size(), 1u);
  EXPECT_EQ(decisions.back().edge_of.size(), 2u);
  EXPECT_NE(decisions.back().edge_of.begin()->second, decisions.back().edge_of.rbegin()->second);
}

TEST_F(CoordinatedRun, joins_at_an_edge_and_sends_to_a_robot) {
  configuration.cloud.at = "north";
  configuration.cloud.push_to = {"beta"};
  const Report report = run("pushed");
  const auto& first = report.team.components.front();
  const bool is_first = std::find(first.begin(), first.end(), MapId("beta")) != first.end();
  const std::string its_team = report.team.components.size() == 1 ? "team" : is_first ? "team-1" : "team-2";
  EXPECT_TRUE(read_file(folder / "pushed/robots/beta/team/map.pgm") ==
              read_file(folder / "pushed" / its_team / "map.pgm"));
  EXPECT_FALSE(fs::exists(folder / "pushed/robots/alpha/team"));
  ASSERT_EQ(report.timeline->pushes.size(), 1u);
  EXPECT_GT(report.work.pushes[0].bytes, 1000u);
  EXPECT_GE(report.timeline->pushes[0].arrived_s, report.timeline->total_s);
}

TEST_F(CoordinatedRun, joins_the_same_whether_edges_judge_for_the_cloud_or_not) {
  const Report shared = run("shared");
  configuration.cloud.edges_judge = false;
  const Report alone = run("alone");
  expect_same("shared", "alone", kMaps);
  double judging_s = 0.0;
  for (const EdgeWork& edge : shared.work.edges) judging_s += edge.judging_s;
  EXPECT_GT(judging_s, 0.0);
  EXPECT_LT(shared.work.fusing_s, alone.work.fusing_s);
  for (const EdgeWork& edge : alone.work.edges) EXPECT_EQ(edge.judging_s, 0.0);
}

TEST_F(CoordinatedRun, ends_when_a_log_is_cut) {
  const std::string bytes = read_file(simulated_team().log("beta"));
  write_file(folder / "beta.rawlog", std::string_view(bytes).substr(0, bytes.size() / 2));
  for (RobotEntry& entry : configuration.robots)
    if (entry.id == "beta") entry.log = folder / "beta.rawlog";
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  EXPECT_THROW(run("cut"), Error);
  EXPECT_FALSE(fs::exists(folder / "cut"));
}

}  // namespace
}  // namespace mapweave::runtime
