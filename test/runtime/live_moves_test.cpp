// Robots that a coordinator's plan gives to other edges while they drive, and after it.
#include "live_team.h"

#include <mapweave/runtime/live_coordinator.h>
#include <mapweave/runtime/live_status.h>

#include <gmock/gmock.h>

namespace mapweave::runtime {
namespace {

using namespace test_support;
using testing::ElementsAre;

// What `run` leaves where gamma is on another edge than in three_robots(); once.
const fs::path& as_run_after_the_move() {
  static const test::TemporaryFolder folder;
  static const fs::path out = folder / "run";
  if (!fs::exists(out)) {
    RunConfiguration configuration = three_robots_configuration();
    for (RobotEntry& robot : configuration.robots)
      if (robot.id == "gamma") robot.edge = "south";
    WorkerPool pool(1);
    run_batch(configuration, make_plan(configuration, {}), {out, false, false}, pool, *make_silent_progress());
  }
  return out;
}

struct LiveMoves : LiveTeam {
  LiveMoves() {
    configuration.coordinator.method = scheduling::PlanMethod::standard;
    plan = make_plan(configuration, {});
    choose_sensors(plan, configuration, pool);
    options.speed = 20.0;
  }
  void publish(const std::map<std::string, std::string>& edges_of, bool is_final = false, bool is_done = false) {
    ++published.number;
    published.since = 1;
    published.is_final = is_final;
    published.is_done = is_done;
    for (const auto& [robot, edge] : edges_of) published.edge_of[RobotId(robot)] = TierId(edge);
    follow();
  }
  void follow() {
    for (const auto& robot : robots) robot->follow(published);
    if (cloud) cloud->follow(published);
    const std::lock_guard lock(mutex);
    for (const auto& [name, edge] : edges)
      if (edge) edge->follow(published);
  }
  bool has_ended(const std::string& edge, const std::string& robot) {
    for (const auto& one : edges.at(edge)->counts().robots)
      if (one.id.str() == robot) return one.has_ended && one.is_member;
    return false;
  }
  void expect_as(const fs::path& run) {
    json live = outputs_of(settings.out), other = outputs_of(run);
    live.erase("config.yaml");  // it has the coordinator
    other.erase("config.yaml");
    EXPECT_EQ(live, other);
    EXPECT_GT(live.size(), 20u);
    EXPECT_EQ(merges_of(settings.out), merges_of(run));
  }
  LiveRobot& gamma() { return *robots.back(); }
  LivePlan published;
  const std::map<std::string, std::string> kBad{{"alpha", "north"}, {"beta", "south"}, {"gamma", "north"}},
      kGood{{"alpha", "north"}, {"beta", "south"}, {"gamma", "south"}};
};

TEST_F(LiveMoves, loses_nothing_where_a_robot_moves_while_it_drives) {
  for (const std::uint64_t seed : {0, 7}) {
    if (seed != 0) badness = {0.05, 0.05, 0.01, seed};
    published = {};
    settings.out = folder / ("live-" + std::to_string(seed));
    start_cloud("cloud" + std::to_string(seed));
    start_edge("north", "north" + std::to_string(seed));
    start_edge("south", "south" + std::to_string(seed));
    start_robots();
    publish(kBad);
    await([&] { return gamma().counts().confirmed > 10 && !edges.at("north")->map_reports().empty(); });
    EXPECT_FALSE(gamma().counts().is_read);
    publish(kGood);
    EXPECT_EQ(gamma().counts().edge, TierId("south"));
    await([&] { return has_ended("north", "alpha") && has_ended("south", "beta") && has_ended("south", "gamma"); });
    EXPECT_FALSE(edges.at("north")->counts().is_fused) << "the plan is not final";
    EXPECT_FALSE(gamma().is_done()) << "it may have to go elsewhere";
    publish(kGood, true);
    result();
    expect_as(as_run_after_the_move());
    publish(kGood, true, true);
    await([&] { return gamma().is_done(); });
    EXPECT_EQ(gamma().counts().moves, 1u);
    EXPECT_EQ(gamma().counts().lost_scans, 0u);
    await([&] { return edges.at("north")->counts().is_done; });
    EXPECT_EQ(json::parse(read_file(settings.out / "summary.json"))["robots"][2]["edge"], "south");
    robots.clear();
    edges.clear();
    end_cloud();
  }
}

TEST_F(LiveMoves, goes_on_where_it_was_when_a_robot_comes_back) {
  start_cloud();
  start_edge("north", "north");
  start_edge("south");
  start_robots();
  publish(kBad);
  await([&] { return gamma().counts().confirmed > 15; });
  publish(kGood);
  await([&] { return gamma().counts().confirmed > 0 && gamma().counts().is_edge_on_wire; });
  publish(kBad);
  await([&] { return has_ended("north", "alpha") && has_ended("north", "gamma") && has_ended("south", "beta"); });
  for (const auto& robot : edges.at("north")->counts().robots) EXPECT_EQ(robot.taken, robot.mapped);
  EXPECT_EQ(edges.at("north")->counts().again + edges.at("south")->counts().again, 0u);
  publish(kBad, true);
  result();
  expect_as(as_run());
  EXPECT_EQ(gamma().counts().moves, 2u);
}

TEST_F(LiveMoves, gives_the_robots_of_a_lost_edge_to_another_even_after_it_had_merged_them) {
  options.speed = 0.0;
  start_cloud("cloud");
  start_edge("north", "north");
  start_edge("south", "south");
  std::unique_ptr<LiveEdge> kept;
  for (const PlannedRobot& robot : plan.robots) start_robot(robot);
  const std::map<std::string, std::string> other{{"alpha", "north"}, {"beta", "north"}, {"gamma", "south"}};
  publish(other);
  await([&] { return has_ended("north", "alpha") && has_ended("north", "beta") && has_ended("south", "gamma"); });
  end_cloud();  // so that it cannot be done first
  publish(other, true);
  await([&] { return edges.at("north")->counts().is_fused && edges.at("south")->counts().is_fused; });
  end_edge("south");
  start_cloud("cloud");
  std::this_thread::sleep_for(300ms);
  EXPECT_FALSE(cloud->counts().is_sealing);
  publish({{"alpha", "north"}, {"beta", "north"}, {"gamma", "north"}}, true);
  const Report report = result();
  for (const RobotReport& robot : report.robots) {
    EXPECT_TRUE(robot.mapped);
    EXPECT_EQ(robot.edge, TierId("north"));
    EXPECT_FALSE(robot.trouble);
  }
  RunConfiguration configuration_of_run = three_robots_configuration();
  for (RobotEntry& robot : configuration_of_run.robots) robot.edge = "north";
  const fs::path run = folder / "run";
  run_batch(configuration_of_run, make_plan(configuration_of_run, {}), {run, false, false}, pool, *silent);
  expect_as(run);
}

TEST_F(LiveMoves, keeps_a_recording_that_was_ended_on_request) {
  start_cloud();
  start_edge("north");
  start_edge("south");
  start_robots();
  publish(kBad);
  await([&] { return gamma().counts().confirmed > 15; });
  gamma().end();
  await([&] { return gamma().counts().is_read; });
  const std::uint64_t scans = gamma().counts().scans;
  EXPECT_GT(scans, 5u);
  publish(kGood);
  await([&] { return has_ended("south", "gamma"); });
  EXPECT_EQ(gamma().counts().scans, scans);
  for (const auto& robot : edges.at("south")->counts().robots) {
    if (robot.id == RobotId("gamma")) {
      EXPECT_EQ(robot.scans, scans);
    }
  }
}

TEST_F(LiveMoves, passes_over_plans_that_are_old_or_of_a_deployment_before) {
  start_edge("north");
  start_edge("south");
  start_robots();
  LivePlan old{9, 3, true, true, {{RobotId("gamma"), TierId("south")}}};
  gamma().follow(old);
  edges.at("north")->follow(old);
  EXPECT_EQ(gamma().counts().edge, TierId("north"));
  EXPECT_FALSE(gamma().counts().is_released);
  EXPECT_FALSE(edges.at("north")->counts().is_done);
  publish(kGood);
  EXPECT_EQ(gamma().counts().edge, TierId("south"));
  LivePlan same{1, 1, false, false, {{RobotId("gamma"), TierId("north")}}};
  gamma().follow(same);
  EXPECT_EQ(gamma().counts().edge, TierId("south"));
  await([&] { return edges.at("south")->counts().robots.size() == 2; });
  const auto members = [&](const char* edge) {
    std::vector<std::string> names;
    for (const auto& robot : edges.at(edge)->counts().robots)
      if (robot.is_member) names.push_back(robot.id.str());
    return names;
  };
  EXPECT_THAT(members("south"), ElementsAre("beta", "gamma"));
  EXPECT_THAT(members("north"), ElementsAre("alpha"));
}

// As programs do it over a broker: by their own words alone.
TEST_F(LiveMoves, is_coordinated_by_the_words_of_its_programs) {
  configuration.coordinator.overlap_period_s = 0.5;
  configuration.live.lost_after_s = 1.0;
  options.speed = 10.0;
  LiveCoordinator coordinator(configuration, plan, std::nullopt);
  start_cloud();
  start_edge("north", "north");
  start_edge("south", "south");
  start_robots();
  std::int64_t said_at_ns = 0;
  const auto said = [&](const char* program, const std::string& name, nlohmann::ordered_json tier) {
    nlohmann::ordered_json status = program_status(program, name, {std::move(tier)}, {});
    status["said_at_ns"] = ++said_at_ns;
    return status.dump();
  };
  const auto began = std::chrono::steady_clock::now();
  bool has_lost_south = false;
  await([&] {
    const double now_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    coordinator.receive_cloud(said("cloud", "cloud", tier_status(cloud->counts(), {})), now_s);
    for (const auto& [name, edge] : edges) {
      if (!edge) continue;
      coordinator.receive_edge(TierId(name), said("edge", name, tier_status(TierId(name), edge->counts(), {})), now_s);
      coordinator.receive_maps(TierId(name), pack_map_reports(edge->map_reports(), 250'000));
    }
    for (std::size_t i = 0; i < robots.size(); ++i) {
      const LiveRobotCounts counts = robots[i]->counts();
      const RobotId id = plan.robots[i].id;
      coordinator.receive_robot(id, said("robot", id.str(), tier_status(id, counts.edge, counts, {})), now_s);
    }
    if (coordinator.step(now_s)) {
      published = coordinator.plan();
      follow();
    }
    if (!has_lost_south && taken("south") > 15) {
      end_edge("south");
      has_lost_south = true;
    }
    return coordinator.plan().is_done;
  });
  EXPECT_TRUE(has_lost_south);
  const Report report = result();
  for (const RobotReport& robot : report.robots) EXPECT_TRUE(robot.mapped && robot.edge == TierId("north"));
  EXPECT_GE(coordinator.counts(0.0).moves, 1u);
  for (const auto& robot : robots) EXPECT_TRUE(robot->is_done());
  EXPECT_THAT(coordinator.report()["edges"][0]["robots"], ElementsAre("alpha", "beta", "gamma"));
}

}  // namespace
}  // namespace mapweave::runtime
