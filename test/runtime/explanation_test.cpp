#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/maps/reasons.h>
#include <mapweave/runtime/explanation.h>
#include <mapweave/runtime/merge_runner.h>
#include <nlohmann/json.hpp>
#include <support/simulated_maps.h>
#include <support/temporary_folder.h>

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
  EXPECT_THAT(page.text, testing::StartsWith("robot0 + robot1: merged (none; probability "));
  EXPECT_THAT(page.text, testing::AllOf(HasSubstr("1. robot1 began at x "), HasSubstr("m of wall coincide"), HasSubstr("m of wall were seen through"),
                                        HasSubstr("places agree"), HasSubstr("overlap ")));
  EXPECT_EQ(page.png.substr(1, 3), "PNG");
  EXPECT_GT(page.png.size(), 5000U);
}

TEST(Explanation, of_strangers_says_why_and_what_helps) {
  const Explanation page = explained(merged().folder / "out", "robot0", "stranger");
  const auto verdict = std::find_if(merged().report.team.verdicts.begin(), merged().report.team.verdicts.end(),
                                    [](const Verdict& v) { return v.a.str() == "robot0" && v.b.str() == "stranger"; });
  ASSERT_NE(verdict, merged().report.team.verdicts.end());
  ASSERT_NE(verdict->decision, Decision::accepted);
  EXPECT_THAT(page.text, testing::AllOf(HasSubstr(std::string(mapweave::in_words(verdict->reason))), HasSubstr("what helps: "), HasSubstr("prior: the prior is ")));
  EXPECT_EQ(page.png.substr(1, 3), "PNG");
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
              testing::AllOf(HasSubstr("unknown map 'robto0'"), HasSubstr("robot0, robot1, stranger"), HasSubstr("did you mean 'robot0'?")));
  EXPECT_THAT(trouble(out, "robot0", "robot0", ErrorCode::kUsage), HasSubstr("two maps"));
  EXPECT_THAT(trouble(merged().folder.path(), "robot0", "robot1", ErrorCode::kMissing), HasSubstr("merges.json"));
  const test::TemporaryFolder damaged;
  for (const char* text : {"", "[", "{}", "[3]", R"([{"a": "x", "b": "y"}])", R"([{"a": 1, "b": 2}])",
                           R"([{"a": "../x", "b": "y", "reason": "none", "accepted": true, "decision": "accepted"}])",
                           R"([{"a": "x", "b": "y", "reason": "none", "accepted": true, "decision": "accepted", "hypotheses": [{"b_from_a": {"yaw": "left"}}]}])"}) {
    write_file(damaged / "merges.json", text);
    try {
      explained(damaged.path(), std::string(text).find("../x") == std::string::npos ? "x" : "../x", "y");
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_TRUE(error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUsage) << text << ": " << error.what();
    }
  }
}

}  // namespace
}  // namespace mapweave::runtime
