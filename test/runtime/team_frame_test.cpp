#include "simulated_team.h"

#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/merge_runner.h>

#include <gmock/gmock.h>
#include <mapweave/core/files.h>
#include <mapweave/mapdb/map_store.h>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

using nlohmann::json;
using test_support::simulated_team;
using testing::HasSubstr;
namespace fs = std::filesystem;

// A folder with a run's results, made once.
const fs::path& results() {
  static const test::TemporaryFolder folder;
  static const fs::path out = [] {
    WorkerPool pool(1);
    const RunConfiguration configuration = simulated_team().configuration();
    run_batch(configuration, make_plan(configuration, {}), {folder / "run", false, false}, pool,
              *make_silent_progress());
    return folder / "run";
  }();
  return out;
}
fs::path own(const std::string& robot) { return results() / "robots" / robot / "map.mwdb"; }

struct TeamFrameTest : testing::Test {
  Report merge(const std::vector<fs::path>& maps, const std::string& out, const std::string& frame = "") {
    configuration.team.frame = frame;
    return run_merge(configuration, maps, {folder / out, false}, pool, *progress);
  }
  Map team(const std::string& out) const { return mapdb::read_store(folder / out / "team/map.mwdb").maps.front(); }
  std::map<std::string, std::string> said_of(const std::string& out, const char* team = "team") const {
    return mapdb::summarize_store(folder / out / team / "map.mwdb").metadata;
  }
  test::TemporaryFolder folder;
  RunConfiguration configuration;
  WorkerPool pool{1};
  std::unique_ptr<Progress> progress = make_silent_progress();
};

Map map_in(const fs::path& store) { return mapdb::read_store(store).maps.front(); }

Pose2 first_of(const Map& map, const Map& team) {
  return planar(team.nodes.find(map.nodes.front().first)->map_from_node);
}

void expect_same(const Pose2& one, const Pose2& other, double tolerance = 1e-9) {
  EXPECT_NEAR(one.x, other.x, tolerance);
  EXPECT_NEAR(one.y, other.y, tolerance);
  EXPECT_NEAR(wrap_angle(one.phi - other.phi), 0.0, tolerance);
}

// Largest distance of places of two maps once their first nodes lie on each other.
double difference_in_shape_m(const Map& a, const Map& b) {
  const Pose3 a_from_b = compose(a.nodes.front().second.map_from_node, inverse(b.nodes.front().second.map_from_node));
  double most_m = 0.0;
  for (const auto& [id, node] : b.nodes)
    most_m = std::max(most_m, (compose(a_from_b, node.map_from_node).t - a.nodes.find(id)->map_from_node.t).norm());
  return most_m;
}

TEST_F(TeamFrameTest, a_robot_merged_into_yesterdays_map_leaves_it_in_place_whatever_its_name) {
  const Map beta = map_in(own("beta"));
  const Report report = merge({own("beta"), own("alpha")}, "beta_first");
  const Map merged = team("beta_first");
  expect_same(first_of(beta, merged), planar(beta.nodes.front().second.map_from_node));
  ASSERT_EQ(report.team.frames.size(), 1u);
  EXPECT_EQ(report.team.frames[0].of, "beta");
  EXPECT_THAT(in_words(report, "out"), HasSubstr("team: the frame is that of beta"));
  // The frame is another one, the map and what was decided are the same.
  const Report other = merge({own("alpha"), own("beta")}, "alpha_first");
  const Map alpha = map_in(own("alpha"));
  expect_same(first_of(alpha, team("alpha_first")), planar(alpha.nodes.front().second.map_from_node));
  EXPECT_LT(difference_in_shape_m(merged, team("alpha_first")), 1e-9);
  ASSERT_EQ(other.team.verdicts.size(), 1u);
  EXPECT_EQ(other.team.verdicts[0].witnesses, report.team.verdicts[0].witnesses);
  EXPECT_EQ(other.team.verdicts[0].probability, report.team.verdicts[0].probability);
  EXPECT_GT(std::abs(first_of(beta, team("alpha_first")).x - first_of(beta, merged).x), 1.0);
}

TEST_F(TeamFrameTest, is_the_named_maps_whatever_comes_first) {
  merge({own("alpha"), own("beta")}, "first");
  merge({own("beta"), own("alpha")}, "named", "alpha");
  for (const char* file : {"team/map.png", "team/map.pgm", "team/trajectories/beta.tum"})
    EXPECT_EQ(read_file(folder / "first" / file), read_file(folder / "named" / file)) << file;
  try {
    merge({own("alpha"), own("beta")}, "wrong", "alhpa");
    FAIL() << "was taken";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("did you mean 'alpha'?"), HasSubstr("--frame")));
    EXPECT_EQ(error.code(), ErrorCode::kUsage);
  }
  for (const char* text : {"1,2", "1,2,3,4", "1,2,north", "1,,2", "1,2,nan", "1,2,90"})
    EXPECT_THROW(merge({own("alpha"), own("beta")}, "wrong", text), Error) << text;
}

TEST_F(TeamFrameTest, is_moved_by_the_numbers_given) {
  merge({own("alpha"), own("beta")}, "first");
  const Report report = merge({own("alpha"), own("beta")}, "moved", "10,-3.5,1.25");
  const Map before = team("first"), after = team("moved");
  for (const auto& [id, node] : before.nodes)
    expect_same(planar(after.nodes.find(id)->map_from_node),
                compose(Pose2(10.0, -3.5, 1.25), planar(node.map_from_node)));
  EXPECT_THAT(in_words(report, "out"), HasSubstr("moved: its origin lies at (10.000 m, -3.500 m), yaw 1.2500 rad"));
  const json frame = json::parse(read_file(folder / "moved/summary.json"))["team"]["frames"][0];
  EXPECT_NEAR(frame["team_from_given"]["yaw"], 1.25, 1e-12);
  EXPECT_NEAR(frame["team_from_maps"]["alpha"]["x"], 10.0, 1e-9);
}

TEST_F(TeamFrameTest, has_axes_along_the_walls) {
  merge({own("alpha"), own("beta")}, "turned", "0,0,0.3");
  const Report report = merge({own("alpha"), own("beta")}, "walls", "walls");
  EXPECT_THAT(in_words(report, "out"), HasSubstr("axes along the walls"));
  // Merged into the turned one's, walls bring it back: the same up to quarter turns.
  const Pose2 straight = first_of(map_in(own("beta")), team("walls"));
  merge({folder / "turned"}, "again", "walls");
  const Pose2 again = first_of(map_in(own("beta")), team("again"));
  EXPECT_NEAR(std::remainder(again.phi - straight.phi, M_PI / 2), 0.0, 1e-3);
}

TEST_F(TeamFrameTest, of_a_team_stays_and_its_map_is_continued_when_another_robot_comes) {
  merge({own("beta")}, "yesterday", "4,5,1");
  const auto yesterday = said_of("yesterday");
  EXPECT_EQ(yesterday.at("map_version"), "1");
  const Report report = merge({folder / "yesterday", own("alpha")}, "today");
  const Map beta = map_in(own("beta"));
  expect_same(first_of(beta, team("today")), first_of(beta, team("yesterday")));
  EXPECT_EQ(report.team.frames[0].of, "yesterday");
  const auto today = said_of("today");
  EXPECT_EQ(today.at("map_id"), yesterday.at("map_id"));
  EXPECT_EQ(today.at("map_version"), "2");
  EXPECT_EQ(today.at("frame_kept_by"), yesterday.at("frame_kept_by"));
  // And so on, from a team of two; who is left out takes no frame with him.
  merge({folder / "today"}, "tomorrow");
  EXPECT_EQ(said_of("tomorrow").at("map_version"), "3");
  expect_same(first_of(beta, team("tomorrow")), first_of(beta, team("yesterday")));
  configuration.team.frame = "";
  run_merge(configuration, {folder / "today"}, {folder / "alone", false, {{"beta"}, {}, {}}}, pool, *progress);
  const Map alpha = map_in(own("alpha"));
  expect_same(first_of(alpha, team("alone")), first_of(alpha, team("today")));
  // A map that is moved is another map.
  merge({folder / "today"}, "moved", "1,0,0");
  EXPECT_NE(said_of("moved").at("map_id"), yesterday.at("map_id"));
  merge({own("alpha"), folder / "today"}, "named", "today");
  // One recording twice stays apart.
  EXPECT_EQ(said_of("named", "team-1").at("map_id"), yesterday.at("map_id"));
}

TEST_F(TeamFrameTest, map_yaml_manifest_and_store_hold_id_version_and_hash) {
  merge({own("alpha"), own("beta")}, "out");
  const auto store = mapdb::summarize_store(folder / "out/team/map.mwdb");
  const json manifest = json::parse(read_file(folder / "out/manifest.json"));
  EXPECT_EQ(manifest["maps"]["team/map.mwdb"]["map_id"], store.metadata.at("map_id"));
  EXPECT_EQ(manifest["maps"]["team/map.mwdb"]["content_hash"], to_hex(store.identity));
  EXPECT_EQ(manifest["maps"]["robots/alpha/map.mwdb"]["map_version"], "1");
  EXPECT_EQ(manifest["maps"]["team/map.mwdb"]["map_id"], manifest["maps"]["robots/alpha/map.mwdb"]["map_id"])
      << "alpha's map is continued";
  EXPECT_EQ(manifest["maps"]["team/map.mwdb"]["map_version"], "2");
  const std::string yaml = read_file(folder / "out/team/map.yaml");
  EXPECT_THAT(yaml, testing::AllOf(HasSubstr("map_id: \"" + store.metadata.at("map_id") + "\"\n"),
                                   HasSubstr("map_version: \"2\"\n"),
                                   HasSubstr("content_hash: \"" + to_hex(store.identity) + "\"\n")));
}

TEST_F(TeamFrameTest, of_a_run_is_the_first_listed_robots_or_as_the_configuration_says) {
  configuration = simulated_team().configuration();
  std::reverse(configuration.robots.begin(), configuration.robots.end());
  const Map beta = map_in(own("beta"));
  run_batch(configuration, make_plan(configuration, {}), {folder / "listed", false, false}, pool, *progress);
  expect_same(first_of(beta, team("listed")), planar(beta.nodes.front().second.map_from_node));
  // As its own configuration says, too.
  RunConfiguration again;
  const Origins origins = load(again, {{folder / "listed/config.yaml"}, {}, {}});
  run_batch(again, make_plan(again, origins), {folder / "again", false, false}, pool, *progress);
  EXPECT_EQ(read_file(folder / "again/team/map.mwdb"), read_file(folder / "listed/team/map.mwdb"));
  configuration.team.frame = "alpha";
  run_batch(configuration, make_plan(configuration, {}), {folder / "named", false, false}, pool, *progress);
  EXPECT_EQ(read_file(folder / "named/team/map.pgm"), read_file(results() / "team/map.pgm"));
  configuration.team.frame = "apha";
  EXPECT_THROW(make_plan(configuration, {}), Error);
}

TEST_F(TeamFrameTest, of_maps_that_stay_apart_is_each_ones_own) {
  configuration.fusion.merge_probability = 1.0;
  const Report report = merge({own("beta"), own("alpha")}, "apart", "0,0,0.5");
  ASSERT_EQ(report.team.frames.size(), 2u);
  for (const TeamFrame& frame : report.team.frames)
    EXPECT_EQ(frame.team_from_given.phi, frame.of == "beta" ? 0.5 : 0.0) << "numbers are for the first map alone";
}

}  // namespace
}  // namespace mapweave::runtime
