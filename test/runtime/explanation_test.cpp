#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/fusion/grid_map.h>
#include <mapweave/fusion/wall_weights.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/maps/reasons.h>
#include <mapweave/runtime/explanation.h>
#include <mapweave/runtime/merge_runner.h>
#include <support/drawn_grids.h>
#include <support/simulated_maps.h>
#include <support/starry_maps.h>
#include <support/temporary_folder.h>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

// A merge of two robots of one apartment and one of another, made once.
struct Merged {
  test::TemporaryFolder folder;
  Report report;
  Merged() {
    simulation::TeamOptions options;
    options.shared = 0.6;
    auto team = simulation::make_apartment({}, options);
    auto stranger = simulation::make_two_strangers().robots[1];
    stranger.id = RobotId("stranger");
    team.robots.push_back(stranger);
    std::vector<fs::path> paths;
    for (const auto& robot : team.robots) {
      mapdb::StoredMaps stored;
      stored.maps = {test::mapped(robot, team.laser)};
      paths.push_back(folder / (robot.id.str() + ".mwdb"));
      mapdb::write_store(paths.back(), stored);
    }
    WorkerPool pool(1);
    MergeRequests requests;
    requests.anchors = {{"robot0", "stranger", Pose2(1.0, 0.0, 0.0)}};
    report = run_merge({}, paths, {folder / "out", false, requests}, pool, *make_silent_progress());
  }
};
const Merged& merged() {
  static const Merged once;
  return once;
}

Explanation explained(const fs::path& folder, const std::string& a, const std::string& b) {
  WorkerPool pool(1);
  return explain(folder, a, b, {}, pool);
}

std::string trouble(const fs::path& folder, const std::string& a, const std::string& b, ErrorCode code) {
  try {
    explained(folder, a, b);
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code);
    return error.what();
  }
  return "nothing";
}

TEST(Explanation, of_a_merged_pair_says_what_spoke_for_it) {
  const Explanation page = explained(merged().folder / "out", "robot1", "robot0");
  EXPECT_EQ(page.a, "robot0");
  EXPECT_THAT(page.text, testing::StartsWith("robot0 + robot1: merged (probability "));
  EXPECT_THAT(page.text, testing::AllOf(HasSubstr("the sum:    "), HasSubstr("m that fit nowhere around - 4 x "),
                                        HasSubstr("m seen through - 2 x "), HasSubstr("m expected by chance = "),
                                        HasSubstr("are a probability of ")));
  EXPECT_THAT(page.text, testing::Not(HasSubstr("none")));
  EXPECT_THAT(page.text, testing::AllOf(HasSubstr("1. robot1 began at x "), HasSubstr("m of wall coincide"),
                                        HasSubstr("m of wall were seen through"), HasSubstr("places agree"),
                                        HasSubstr("overlap ")));
  EXPECT_EQ(page.png.substr(1, 3), "PNG");
  EXPECT_GT(page.png.size(), 5000U);
}

TEST(Explanation, of_strangers_says_why_and_what_helps) {
  const Explanation page = explained(merged().folder / "out", "robot0", "stranger");
  const auto verdict = std::find_if(merged().report.team.verdicts.begin(), merged().report.team.verdicts.end(),
                                    [](const Verdict& v) { return v.a.str() == "robot0" && v.b.str() == "stranger"; });
  ASSERT_NE(verdict, merged().report.team.verdicts.end());
  ASSERT_NE(verdict->decision, Decision::accepted);
  EXPECT_THAT(page.text, testing::AllOf(HasSubstr(std::string(mapweave::in_words(verdict->reason))),
                                        HasSubstr("what helps: "), HasSubstr("prior: the prior is ")));
  EXPECT_EQ(page.png.substr(1, 3), "PNG");
}

TEST(Explanation, says_by_how_much_rooms_differ_in_width) {
  const test::TemporaryFolder folder;
  fs::copy(merged().folder / "out", folder / "out", fs::copy_options::recursive);
  auto merges = nlohmann::json::parse(read_file(folder / "out/merges.json"));
  for (auto& verdict : merges)
    if (verdict["a"] == "robot0" && verdict["b"] == "robot1") verdict["hypotheses"][0]["wider_m"] = -0.04;
  write_file(folder / "out/merges.json", merges.dump());
  EXPECT_THAT(explained(folder / "out", "robot0", "robot1").text,
              testing::AllOf(HasSubstr("m are unclear; rooms of robot0 are at least 4 cm wider"),
                             HasSubstr("m that fit nowhere around (not all, as rooms differ in width) - 4 x ")));
}

TEST(Explanation, has_a_sum_that_gives_the_log_odds) {
  std::size_t weighed = 0;
  for (const auto& verdict : merges_json(merged().report))
    for (const auto& hypothesis : verdict["hypotheses"]) {
      const double chance_m = hypothesis["by_chance_m"];
      if (chance_m == 0.0 || hypothesis["coinciding_m"] == 0.0) continue;
      const double share = fusion::counted_share(hypothesis["wider_m"].get<double>());
      const double sum = share * hypothesis["distinctive_m"].get<double>() -
                         fusion::kContradictionWeight * hypothesis["contradicted_m"].get<double>() -
                         fusion::kUnclearWeight * hypothesis["counted_unclear_m"].get<double>() - chance_m;
      const double with_prior = std::clamp(sum, -20.0, 20.0) + hypothesis["prior_log_odds"].get<double>();
      EXPECT_NEAR(std::clamp(with_prior, -20.0, 20.0), std::clamp(hypothesis["log_odds"].get<double>(), -20.0, 20.0),
                  1e-9)
          << hypothesis;
      ++weighed;
    }
  EXPECT_GT(weighed, 0U);
}

// Two halves of an office, as grids of another maker, and a page of text.
TEST(Explanation, of_grids_shows_how_they_lie_and_what_is_no_map) {
  const test::TemporaryFolder folder;
  simulation::ApartmentOptions office;
  office.width_m = 30.0;
  office.height_m = 18.0;
  const auto plan = simulation::make_apartment_plan(office, 1);
  test::DrawnGridOptions west, east;
  west.seen = {-1.0, -1.0, 20.0, 30.0};
  east.seen = {9.0, -1.0, 40.0, 30.0};
  east.scale = 1.05;
  east.grid_from_plan = {-7.0, 40.0, 1.9};
  std::vector<fs::path> paths;
  for (const auto& [name, grid] :
       std::vector<std::pair<std::string, OccupancyGrid>>{{"west", test::drawn_grid(plan, west)},
                                                          {"east", test::drawn_grid(plan, east)},
                                                          {"page", test::page_of_text(1)}}) {
    mapdb::StoredMaps stored;
    stored.maps = {fusion::map_of_grid(MapId(name), grid)};
    paths.push_back(folder / (name + ".mwdb"));
    mapdb::write_store(paths.back(), stored);
  }
  WorkerPool pool(1);
  run_merge({}, paths, {folder / "out", false, {}}, pool, *make_silent_progress());
  const Explanation joined = explained(folder / "out", "west", "east");
  EXPECT_THAT(joined.text, testing::StartsWith("east + west: merged (probability "));
  EXPECT_THAT(joined.text,
              testing::AllOf(HasSubstr("1. west has its origin at x "), HasSubstr("scaled by 1.0"),
                             HasSubstr("m of wall coincide, which count "), HasSubstr("lie in free space of the other"),
                             testing::Not(HasSubstr("no hypothesis"))));
  EXPECT_GT(joined.png.size(), 5000U);
  const Explanation text = explained(folder / "out", "page", "east");
  EXPECT_THAT(text.text, testing::AllOf(HasSubstr("note: page looks like no map: "), HasSubstr("as on a page of text"),
                                        HasSubstr("what helps: take a raster of walls and free space"),
                                        testing::Not(HasSubstr("drive "))));
}

TEST(Explanation, of_cameras_names_the_pictures_that_agree_and_draws_landmarks) {
  const test::TemporaryFolder folder;
  const test::StarryBuilding building({1});
  std::vector<fs::path> paths;
  for (const auto& [name, path] :
       std::vector<std::pair<std::string, std::vector<Pose2>>>{{"alpha", test::look_around(-1.0, -0.5, 0.0, 2.4, 14)},
                                                               {"beta", test::look_around(0.5, 0.7, 1.4, 4.0, 14)}}) {
    mapdb::StoredMaps stored;
    stored.maps = {building.keyframe_map(name, path)};
    paths.push_back(folder / (name + ".mwdb"));
    mapdb::write_store(paths.back(), stored);
  }
  WorkerPool pool(1);
  run_merge({}, paths, {folder / "out", false, {}}, pool, *make_silent_progress());
  const Explanation page = explained(folder / "out", "alpha", "beta");
  EXPECT_THAT(page.text, testing::StartsWith("alpha + beta: merged (probability "));
  EXPECT_THAT(page.text,
              testing::AllOf(HasSubstr("1. beta began at x "), HasSubstr("pairs of pictures show the same place so"),
                             HasSubstr("no pair of pictures puts them elsewhere"), testing::Not(HasSubstr("of wall"))));
  EXPECT_GT(page.png.size(), 5000U);
}

TEST(Explanation, has_the_numbers_of_merges_json) {
  const auto merges = merges_json(merged().report);
  for (const auto& verdict : merges) {
    EXPECT_LE(verdict["hypotheses"].size(), kMostPairHypotheses);
    if (!verdict["accepted"]) continue;
    ASSERT_FALSE(verdict["hypotheses"].empty());
    const auto& best = verdict["hypotheses"][0];
    EXPECT_GT(best["coinciding_m"], 5.0);
    EXPECT_NEAR(best["b_from_a"]["x"].get<double>(), verdict["b_from_a"]["x"].get<double>(), 0.3);
    EXPECT_NEAR(best["b_from_a"]["y"].get<double>(), verdict["b_from_a"]["y"].get<double>(), 0.3);
  }
}

TEST(Explanation, refuses_what_is_not_there_or_damaged) {
  const fs::path out = merged().folder / "out";
  EXPECT_THAT(trouble(out, "robto0", "robot1", ErrorCode::kUsage),
              testing::AllOf(HasSubstr("unknown map 'robto0'"), HasSubstr("robot0, robot1, stranger"),
                             HasSubstr("did you mean 'robot0'?")));
  EXPECT_THAT(trouble(out, "robot0", "robot0", ErrorCode::kUsage), HasSubstr("two maps"));
  EXPECT_THAT(trouble(merged().folder.path(), "robot0", "robot1", ErrorCode::kMissing), HasSubstr("merges.json"));
  const test::TemporaryFolder damaged;
  for (const char* text : {"", "[", "{}", "[3]", R"([{"a": "x", "b": "y"}])", R"([{"a": 1, "b": 2}])",
                           R"([{"a": "../x", "b": "y", "reason": "none", "accepted": true, "decision": "accepted"}])",
                           R"([{"a": "x", "b": "y", "reason": "none", "accepted": true, "decision": "accepted",
         "hypotheses": [{"b_from_a": {"yaw": "left"}}]}])"}) {
    write_file(damaged / "merges.json", text);
    try {
      explained(damaged.path(), std::string(text).find("../x") == std::string::npos ? "x" : "../x", "y");
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_TRUE(error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUsage)
          << text << ": " << error.what();
    }
  }
}

}  // namespace
}  // namespace mapweave::runtime
