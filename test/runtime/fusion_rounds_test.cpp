// Runs in which edges and cloud fuse while robots drive.
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

// Without what was measured.
json rounds_without_times(const fs::path& folder) {
  json rounds = parsed(folder / "rounds.json")["rounds"];
  for (json& round : rounds)
    for (json& tier : round["tiers"])
      for (const char* time : {"fusing_cpu_seconds", "ready_seconds", "left_out"}) tier.erase(time);
  return rounds;
}

struct RunInRounds : testing::Test {
  RunInRounds() { configuration.output.report = false; }
  Report run(const std::string& out, int threads = 1) {
    WorkerPool pool(threads);
    return run_batch(configuration, make_plan(configuration, {}), {folder / out, false, false}, pool, *silent);
  }
  // Of all that is no preview.
  json outputs(const std::string& out) const {
    json outputs = parsed(folder / out / "manifest.json")["outputs"];
    outputs.erase("config.yaml");
    for (auto it = outputs.begin(); it != outputs.end();)
      it = it.key().rfind("rounds/", 0) == 0 ? outputs.erase(it) : std::next(it);
    return outputs;
  }
  std::size_t pictures(const std::string& out) const {
    if (!fs::exists(folder / out / "rounds")) return 0;
    const fs::directory_iterator files(folder / out / "rounds");
    return static_cast<std::size_t>(std::distance(begin(files), end(files)));
  }
  test::TemporaryFolder folder;
  RunConfiguration configuration = simulated_team().configuration();
  std::unique_ptr<Progress> silent = make_silent_progress();
};

TEST_F(RunInRounds, leaves_the_same_final_map_as_without) {
  run("without");
  EXPECT_FALSE(fs::exists(folder / "without/rounds.json"));
  configuration.cloud.rounds.period_s = 3.0;
  const Report report = run("period");
  EXPECT_EQ(outputs("without"), outputs("period"));
  ASSERT_GT(report.work.rounds.size(), 3u);
  configuration.cloud.rounds.period_s = 7.3;
  run("other-period");
  EXPECT_EQ(outputs("without"), outputs("other-period"));
  configuration.cloud.rounds.period_s = 0.0;
  configuration.cloud.rounds.new_area_m2 = 15.0;
  const Report by_area = run("area");
  EXPECT_EQ(outputs("without"), outputs("area"));
  EXPECT_GT(by_area.work.rounds.size(), 1u);
}

TEST_F(RunInRounds, reports_when_the_first_joint_map_was_there) {
  configuration.cloud.rounds.period_s = 4.0;
  configuration.cloud.rounds.pictures = 2;
  const Report report = run("rounds");
  ASSERT_TRUE(report.timeline && report.timeline->rounds);
  const RoundsTimeline& rounds = *report.timeline->rounds;
  ASSERT_TRUE(rounds.first_joint);
  EXPECT_THAT(rounds.first_joint->maps, testing::ElementsAre(MapId("alpha"), MapId("beta")));
  EXPECT_GT(rounds.first_joint->ready_s, rounds.first_joint->at_s);
  EXPECT_LT(rounds.first_joint->at_s, report.rounds->recorded_s) << "long before the end";
  EXPECT_THAT(in_words(report, "rounds"), testing::HasSubstr("first joint map: alpha + beta, at cloud"));
  const json written = parsed(folder / "rounds/rounds.json");
  EXPECT_EQ(written["first_joint"]["at_seconds"], rounds.first_joint->at_s);
  EXPECT_EQ(written["rounds"].size(), report.work.rounds.size());
  EXPECT_EQ(pictures("rounds"), 2u);
  const json timeline = parsed(folder / "rounds/summary.json")["timeline"]["rounds"];
  ASSERT_EQ(timeline["tiers"].size(), 3u);
  for (const json& tier : timeline["tiers"]) EXPECT_LT(tier["oldest_seconds"], 10.0);
  EXPECT_GT(timeline["tiers"][0]["bytes"], 1000);
  double recorded_s = 0.0;
  const Work again = read_work(folder / "rounds/summary.json", &recorded_s);
  EXPECT_EQ(again.rounds.size(), report.work.rounds.size());
  EXPECT_EQ(recorded_s, report.rounds->recorded_s);
}

TEST_F(RunInRounds, shows_the_same_previews_for_any_number_of_threads) {
  configuration.cloud.rounds.period_s = 5.0;
  run("one", 1);
  run("two", 2);
  EXPECT_EQ(rounds_without_times(folder / "one"), rounds_without_times(folder / "two"));
  EXPECT_EQ(parsed(folder / "one/manifest.json")["outputs"], parsed(folder / "two/manifest.json")["outputs"]);
}

TEST_F(RunInRounds, goes_with_robots_wherever_they_map) {
  configuration.cloud.rounds.period_s = 5.0;
  for (const Mode mode : {Mode::onboard, Mode::cloud_only}) {
    configuration.mode = mode;
    const std::string name = mode == Mode::onboard ? "onboard" : "cloud-only";
    configuration.cloud.rounds.period_s = 0.0;
    run(name + "-without");
    configuration.cloud.rounds.period_s = 5.0;
    const Report report = run(name);
    EXPECT_EQ(outputs(name + "-without"), outputs(name));
    ASSERT_TRUE(report.timeline->rounds->first_joint) << name;
    std::uint64_t bytes = 0;
    for (const RoundWork& round : report.work.rounds)
      for (const RoundWork::Sent& sent : round.robots) {
        bytes += sent.bytes;
        EXPECT_EQ(sent.to.empty(), mode == Mode::cloud_only);
      }
    EXPECT_GT(bytes, 10000u);
  }
}

TEST_F(RunInRounds, goes_with_robots_that_a_coordinator_moves) {
  for (RobotEntry& robot : configuration.robots) robot.edge.clear();
  configuration.edges = {{"north"}, {"south"}};
  configuration.edges[1].until_s = 9.0;
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  configuration.coordinator.overlap_period_s = 3.0;
  configuration.robots[1].from_s = 2.5;
  const Report before = run("without");
  configuration.cloud.rounds.period_s = 2.0;
  const Report report = run("with");
  EXPECT_EQ(outputs("without"), outputs("with"));
  ASSERT_EQ(report.coordination->decisions.size(), before.coordination->decisions.size());
  for (std::size_t i = 0; i < before.coordination->decisions.size(); ++i) {
    EXPECT_EQ(report.coordination->decisions[i].at_s, before.coordination->decisions[i].at_s);
    EXPECT_EQ(report.coordination->decisions[i].because, before.coordination->decisions[i].because);
    EXPECT_EQ(report.coordination->decisions[i].edge_of, before.coordination->decisions[i].edge_of);
  }
  std::set<std::string> where;
  for (const RoundWork& round : report.work.rounds)
    for (const RoundWork::Sent& sent : round.robots) where.insert(sent.to.str());
  EXPECT_THAT(where, testing::ElementsAre("north", "south"));
  EXPECT_EQ(report.work.rounds.back().fused.back().joint.size(), 1u);
  EXPECT_EQ(parsed(folder / "with/summary.json")["coordinator"]["rounds"]["rounds"], report.work.rounds.size());
}

// Edges whose processors take longer for a round than the time until the next one.
TEST_F(RunInRounds, come_faster_than_edges_fuse_and_lose_nothing) {
  run("without");
  configuration.cloud.rounds.period_s = 1.0;
  const Report quick = run("quick");
  configuration.processors.edge = 1e-4;
  const Report slow = run("slow");
  EXPECT_EQ(outputs("without"), outputs("slow"));
  EXPECT_EQ(rounds_without_times(folder / "quick"), rounds_without_times(folder / "slow"));
  EXPECT_EQ(slow.exit_code(), quick.exit_code());
  const auto is_of_rounds = testing::HasSubstr("faster than north fuses");
  EXPECT_THAT(quick.notes, testing::Not(testing::Contains(is_of_rounds)));
  EXPECT_THAT(slow.notes, testing::Contains(is_of_rounds));
  std::size_t left_out = 0;
  for (const auto& tier : slow.timeline->rounds->tiers) left_out += tier.left_out;
  EXPECT_GT(left_out, 2u);
}

TEST_F(RunInRounds, says_what_it_does_not_do) {
  configuration.cloud.rounds.period_s = 0.05;
  EXPECT_THROW(make_plan(configuration, {}), Error);
  configuration.cloud.rounds.period_s = 5000.0;
  const Report report = run("seldom");
  EXPECT_TRUE(report.work.rounds.size() <= 1);
}

TEST(RoundsTimeline, leaves_out_rounds_that_come_while_a_tier_is_busy) {
  TimelineOptions options;
  options.recorded_s = 40.0;
  options.network.edge_cloud.bytes_per_s = 1000.0;
  Work work;
  for (int i = 1; i <= 4; ++i) {
    RoundWork round;
    round.at_s = 10.0 * i;
    RoundWork::Fused edge;
    edge.tier = TierId("north");
    edge.fusing_s = i == 2 ? 12.0 : 1.0;
    edge.bytes = 2000;
    if (i > 1) edge.joint = {{MapId("alpha"), MapId("beta")}};
    RoundWork::Fused cloud;
    cloud.tier = TierId("cloud");
    cloud.fusing_s = 0.5;
    round.fused = {edge, cloud};
    work.rounds.push_back(round);
  }
  const RoundsTimeline rounds = rounds_timeline(options, work);
  ASSERT_EQ(rounds.rounds.size(), 4u);
  EXPECT_NEAR(rounds.rounds[0][0].ready_s, 11.0, 1e-9);
  EXPECT_NEAR(rounds.rounds[0][1].ready_s, 11.0 + 2.0 + 0.5, 1e-6);
  EXPECT_NEAR(rounds.rounds[1][0].ready_s, 32.0, 1e-9);
  EXPECT_TRUE(rounds.rounds[2][0].is_left_out) << "it is busy until 32 s";
  EXPECT_NEAR(rounds.rounds[3][1].ready_s, 41.0 + 4.0 + 0.5, 1e-6) << "with what waited";
  ASSERT_TRUE(rounds.first_joint);
  EXPECT_NEAR(rounds.first_joint->ready_s, 32.0, 1e-9);
  ASSERT_EQ(rounds.tiers.size(), 2u);
  EXPECT_EQ(rounds.tiers[0].left_out, 1u);
  EXPECT_NEAR(rounds.tiers[0].most_age_s, 22.0, 1e-9) << "shown at 32 s, what was there at 10 s";
  EXPECT_THAT(notes_of(rounds), testing::ElementsAre(testing::HasSubstr("faster than north fuses")));
}

}  // namespace
}  // namespace mapweave::runtime
