#include "simulated_team.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/explanation.h>
#include <mapweave/runtime/merge_runner.h>
#include <support/pose_matchers.h>
#include <support/simulated_maps.h>
#include <support/temporary_folder.h>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

// Three robots of one apartment, made once; "robot1" meets both others.
struct Apartment {
  simulation::SimulatedTeam team;
  std::vector<Map> maps;
  Apartment() {
    simulation::TeamOptions options;
    options.robots = 3;
    options.shared = 0.6;
    team = simulation::make_apartment({}, options);
    for (const auto& robot : team.robots) maps.push_back(test::mapped(robot, team.laser));
  }
  Pose2 truth(std::size_t a, std::size_t b) const {
    return between(team.robots[a].steps.front().world_from_robot, team.robots[b].steps.front().world_from_robot);
  }
};
const Apartment& apartment() {
  static const Apartment once;
  return once;
}

struct MergeRequestsTest : testing::Test {
  MergeRequestsTest() {
    for (const Map& map : apartment().maps) put(map);
  }
  fs::path put(const Map& map) {
    mapdb::StoredMaps stored;
    stored.maps = {map};
    mapdb::write_store(folder / (map.id.str() + ".mwdb"), stored);
    return folder / (map.id.str() + ".mwdb");
  }
  std::vector<fs::path> robots(std::initializer_list<int> numbers) const {
    std::vector<fs::path> paths;
    for (const int i : numbers) paths.push_back(folder / ("robot" + std::to_string(i) + ".mwdb"));
    return paths;
  }
  Report merge(const std::vector<fs::path>& maps, const std::string& out, const MergeRequests& requests = {}) {
    return run_merge(configuration, maps, {folder / out, false, requests}, pool, *progress);
  }
  // What was said of a team is dropped.
  Report merge_anew(const std::vector<fs::path>& maps, const std::string& out) {
    return run_merge(configuration, maps, {folder / out, false, {}, true}, pool, *progress);
  }
  // A file's bytes, but for which version of which map it is.
  static std::string content_of(const fs::path& file) {
    if (file.filename() == "map.mwdb") return to_hex(mapdb::summarize_store(file).identity);
    const std::string bytes = read_file(file);
    return file.filename() == "map.yaml" ? bytes.substr(0, bytes.find("map_id:")) : bytes;
  }
  // Every map of a result, and what is drawn of it.
  void expect_same_maps(const std::string& one, const std::string& other) {
    std::size_t compared = 0;
    for (const auto& entry : fs::recursive_directory_iterator(folder / one)) {
      const fs::path file = fs::relative(entry.path(), folder / one);
      if (!entry.is_regular_file() || file.begin() == --file.end()) continue;  // papers with times lie at the top
      ASSERT_TRUE(fs::exists(folder / other / file)) << file;
      EXPECT_TRUE(content_of(folder / one / file) == content_of(folder / other / file)) << file;
      ++compared;
    }
    EXPECT_GT(compared, 10U);
    for (const auto& entry : fs::recursive_directory_iterator(folder / other))
      EXPECT_TRUE(fs::exists(folder / one / fs::relative(entry.path(), folder / other))) << entry.path();
  }
  std::string trouble(const std::vector<fs::path>& maps, const MergeRequests& requests) {
    try {
      merge(maps, "trouble", requests);
    } catch (const Error& error) {
      EXPECT_FALSE(fs::exists(folder / "trouble"));
      EXPECT_EQ(error.code(), ErrorCode::kUsage);
      return error.what();
    }
    return "nothing";
  }
  test::TemporaryFolder folder;
  RunConfiguration configuration;
  WorkerPool pool{1};
  std::unique_ptr<Progress> progress = make_silent_progress();
};

TEST_F(MergeRequestsTest, a_team_without_a_robot_is_the_team_that_never_had_it) {
  ASSERT_EQ(merge(robots({0, 1, 2}), "all").team.components.size(), 1U);
  merge(robots({0, 1}), "never");
  merge({folder / "all/team/map.mwdb"}, "undone", {{"robot2"}, {}, {}});
  expect_same_maps("never", "undone");
  merge({folder / "all"}, "undone-from-results", {{"robot2"}, {}, {}});
  expect_same_maps("never", "undone-from-results");
  merge(robots({0, 1, 2}), "left-out", {{"robot2"}, {}, {}});
  expect_same_maps("never", "left-out");
}

TEST_F(MergeRequestsTest, a_team_store_moved_elsewhere_is_merged_again_to_the_same_bytes) {
  merge(robots({0, 1, 2}), "all");
  fs::copy(folder / "all/team/map.mwdb", folder / "moved.mwdb");
  merge({folder / "moved.mwdb"}, "again");
  expect_same_maps("all", "again");
}

TEST_F(MergeRequestsTest, a_refused_pair_is_as_it_was_alone) {
  MergeRequests requests;
  requests.refused = {{"robot1", "robot0"}};
  const Report report = merge(robots({0, 1}), "refused", requests);
  ASSERT_EQ(report.team.components.size(), 2U);
  EXPECT_EQ(report.team.verdicts[0].reason, Reason::excluded);
  EXPECT_THAT(in_words(report.team.verdicts[0]), HasSubstr("kept apart: the user excluded this pair"));
  merge(robots({0}), "alone0");
  merge(robots({1}), "alone1");
  for (const char* file : {"map.png", "map.pgm", "map.pcd", "trajectory.tum"}) {
    const std::string first = report.team.components[0][0].str() == "robot0" ? "alone0" : "alone1",
                      second = first == "alone0" ? "alone1" : "alone0";
    EXPECT_EQ(read_file(folder / "refused/team-1" / file), read_file(folder / first / "team" / file)) << file;
    EXPECT_EQ(read_file(folder / "refused/team-2" / file), read_file(folder / second / "team" / file)) << file;
  }
  EXPECT_FALSE(fs::exists(folder / "refused/team")) << "there is no team where maps stayed apart";
  // What was merged is taken apart the same way.
  merge(robots({0, 1}), "merged");
  merge({folder / "merged/team/map.mwdb"}, "taken-apart", requests);
  expect_same_maps("refused", "taken-apart");
}

TEST_F(MergeRequestsTest, a_pair_that_is_refused_may_meet_in_a_third_ones_map) {
  MergeRequests requests;
  requests.refused = {{"robot0", "robot2"}};
  const Report report = merge(robots({0, 1, 2}), "out", requests);
  EXPECT_EQ(report.team.components.size(), 1U);
  for (const Verdict& verdict : report.team.verdicts)
    EXPECT_EQ(verdict.reason == Reason::excluded, verdict.a.str() == "robot0" && verdict.b.str() == "robot2");
  const Verdict& refused = report.team.verdicts[1];
  ASSERT_TRUE(refused.in_one_map);
  EXPECT_THAT(refused.in_one_map->through, testing::ElementsAre(MapId("robot1")));
  ASSERT_TRUE(refused.merge);
  EXPECT_GT(refused.merge->probability, 0.9);
  EXPECT_THAT(in_words(refused),
              testing::StartsWith("robot0 + robot2: in one map, through robot1 (the merge of robot0"));
  EXPECT_THAT(in_words(refused),
              testing::EndsWith("; not matched to each other by themselves: the user excluded this pair"));
  const auto pair = merges_json(report)[1];
  EXPECT_EQ(pair["accepted"], false);
  EXPECT_EQ(pair["in_one_map"], true);
  EXPECT_EQ(pair["connected_through"][0], "robot1");
  const Explanation page = explain(folder / "out", "robot0", "robot2", {}, pool);
  EXPECT_THAT(page.text,
              testing::AllOf(HasSubstr("in one map, through robot1"), HasSubstr("in the team's map robot2 began at"),
                             HasSubstr("nothing has to be done"), testing::Not(HasSubstr("what helps"))));
  EXPECT_GT(page.png.size(), 5000U);
}

TEST_F(MergeRequestsTest, names_that_are_not_there_are_refused_with_those_that_are) {
  EXPECT_THAT(trouble(robots({0, 1}), {{"robto1"}, {}, {}}),
              testing::AllOf(HasSubstr("--without: unknown robot 'robto1'"), HasSubstr("robot0, robot1"),
                             HasSubstr("did you mean 'robot1'")));
  EXPECT_THAT(trouble(robots({0, 1}), {{}, {{"robot0", "gamma"}}, {}}),
              HasSubstr("--refuse: unknown robot 'gamma'; the maps have: robot0, robot1"));
  EXPECT_THAT(trouble(robots({0, 1}), {{}, {{"robot0", "robot0"}}, {}}), HasSubstr("are one map"));
  EXPECT_THAT(trouble(robots({0, 1}), {{}, {}, {{"gamma", "robot0", {}}}}),
              HasSubstr("--anchor: unknown robot 'gamma'"));
  EXPECT_THAT(trouble(robots({0, 1}), {{}, {}, {{"robot1", "robot0", {}}, {"robot0", "robot1", {}}}}),
              HasSubstr("two priors"));
  EXPECT_THAT(trouble(robots({0, 1}), {{"robot0", "robot1"}, {}, {}}), HasSubstr("no map is left"));
}

TEST_F(MergeRequestsTest, a_team_map_without_its_robots_own_maps_says_what_to_give) {
  merge(robots({0, 1}), "all");
  mapdb::StoredMaps stored = mapdb::read_store(folder / "all/team/map.mwdb");
  stored.members.clear();
  mapdb::write_store(folder / "old.mwdb", stored);
  try {
    merge({folder / "old.mwdb"}, "out", {{"robot1"}, {}, {}});
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                testing::AllOf(HasSubstr("does not hold its robots' own maps"), HasSubstr("robots/*/map.mwdb")));
  }
}

TEST_F(MergeRequestsTest, anchors_are_read_as_metres_and_radians) {
  const Anchor anchor = parse_anchor("alpha,beta,3.5,-1,1.57,0.2");
  EXPECT_EQ(anchor.a, "alpha");
  EXPECT_EQ(anchor.b, "beta");
  EXPECT_THAT(anchor.a_from_b, test::IsNear(Pose2(3.5, -1.0, 1.57), 1e-12, 1e-12));
  EXPECT_EQ(anchor.sigma_m, 0.2);
  EXPECT_EQ(parse_anchor("a,b,0,0,0").sigma_m, 0.5);
  for (const char* text :
       {"", "a,b", "a,b,1,2", "a,b,1,2,3,4,5,6", "a,b,one,2,3", "a,b,1,2,", "a,b,1,2,90", "a,b,1,2,nan", "a,b,1,2,3,0",
        "a,b,1,2,3,-1", ",b,1,2,3", "a,,1,2,3", "a,b,1e9,2,3", "a,b,1,2x,3"}) {
    try {
      parse_anchor(text);
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kUsage) << text;
      EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("--anchor"), HasSubstr("metres and radians"))) << text;
    }
  }
}

// --- what was said of a team holds when it is merged again ---

TEST_F(MergeRequestsTest, a_pair_that_was_refused_stays_so_in_a_team_without_a_robot) {
  const MergeRequests refused{{}, {{"robot1", "robot0"}}, {}};
  merge(robots({0, 1, 2}), "all", refused);
  merge(robots({0, 1}), "never", refused);
  const Report report = merge({folder / "all"}, "undone", {{"robot2"}, {}, {}});
  expect_same_maps("never", "undone");
  EXPECT_EQ(report.team.verdicts.at(0).reason, Reason::excluded);
  EXPECT_THAT(in_words(report, "undone"),
              HasSubstr("note: as before: robot0 and robot1 are never matched to each other (--refuse)"));
  const Report again = merge({folder / "undone"}, "twice");
  expect_same_maps("undone", "twice");
  EXPECT_EQ(again.team.verdicts.at(0).reason, Reason::excluded);
  EXPECT_EQ(merge_anew({folder / "all/team/map.mwdb"}, "forgotten").team.components.size(), 1U);
}

TEST_F(MergeRequestsTest, what_was_said_of_a_robot_is_left_out_with_it) {
  merge(robots({0, 1, 2}), "all", {{}, {{"robot0", "robot2"}}, {{"robot2", "robot1", {1.0, 2.0, 0.5}}}});
  merge(robots({0, 1}), "never");
  const Report report = merge({folder / "all"}, "undone", {{"robot2"}, {}, {}});
  expect_same_maps("never", "undone");
  EXPECT_THAT(in_words(report, "undone"), testing::Not(HasSubstr("as before")));
}

TEST_F(MergeRequestsTest, a_new_refusal_adds_to_those_before) {
  merge(robots({0, 1, 2}), "all", {{}, {{"robot0", "robot1"}}, {}});
  const Report report = merge({folder / "all"}, "more", {{}, {{"robot1", "robot2"}}, {}});
  const auto is_excluded = [](const Verdict& verdict) { return verdict.reason == Reason::excluded; };
  EXPECT_EQ(std::count_if(report.team.verdicts.begin(), report.team.verdicts.end(), is_excluded), 2);
  merge(robots({0, 1, 2}), "at-once", {{}, {{"robot2", "robot1"}, {"robot0", "robot1"}}, {}});
  expect_same_maps("at-once", "more");
}

TEST_F(MergeRequestsTest, a_prior_holds_in_a_team_without_a_robot_until_it_is_said_anew) {
  const Pose2 wrong = compose(apartment().truth(0, 1), Pose2(8.0, 6.0, 0.0));
  const MergeRequests anchors{{}, {}, {{"robot0", "robot2", apartment().truth(0, 2)}, {"robot0", "robot1", wrong}}};
  merge(robots({0, 1, 2}), "all", anchors);
  merge(robots({0, 1}), "never", {{}, {}, {anchors.anchors[1]}});
  const Report undone = merge({folder / "all/team/map.mwdb"}, "undone", {{"robot2"}, {}, {}});
  expect_same_maps("never", "undone");
  EXPECT_TRUE(undone.team.verdicts.at(0).prior->is_contradicted);
  EXPECT_THAT(in_words(undone, "undone"), HasSubstr("note: as before: a prior says where robot1 lies in robot0"));
  const Report anew =
      merge({folder / "all"}, "anew", {{"robot2"}, {}, {{"robot1", "robot0", inverse(apartment().truth(0, 1))}}});
  EXPECT_FALSE(anew.team.verdicts.at(0).prior->is_contradicted);
  EXPECT_FALSE(merge_anew({folder / "all"}, "forgotten").team.verdicts.at(0).prior);
}

TEST_F(MergeRequestsTest, options_that_decide_hold_when_a_team_is_merged_again_unless_they_are_given) {
  configuration.fusion.merge_probability = 0.97;
  configuration.fusion.judge.min_inliers = 0.51;
  configuration.fusion.cache_mb = 100;  // decides nothing
  merge(robots({0, 1, 2}), "all");
  merge(robots({0, 1}), "never");
  configuration = {};
  const Report report = merge({folder / "all"}, "undone", {{"robot2"}, {}, {}});
  expect_same_maps("never", "undone");
  EXPECT_THAT(report.notes, testing::Contains("as before: fusion.merge_probability=0.97"));
  EXPECT_THAT(report.notes, testing::Contains("as before: fusion.judge.min_inliers=0.51"));
  RunConfiguration written;
  load(written, {{folder / "undone/config.yaml"}, {}, {}});
  EXPECT_EQ(written.fusion.merge_probability, 0.97);
  RunConfiguration given;
  MergeSettings settings{folder / "given", false, {{"robot2"}, {}, {}}};
  settings.origins = load(given, {{}, {}, {"fusion.merge_probability=0.9"}});
  run_merge(given, {folder / "all"}, settings, pool, *progress);
  load(written, {{folder / "given/config.yaml"}, {}, {}});
  EXPECT_EQ(written.fusion.merge_probability, 0.9);
  EXPECT_EQ(written.fusion.judge.min_inliers, 0.51);
  EXPECT_EQ(merge_anew({folder / "all"}, "forgotten").notes, std::vector<std::string>());
}

TEST_F(MergeRequestsTest, two_teams_made_with_different_options_are_merged_with_neither) {
  configuration.fusion.merge_probability = 0.97;
  merge(robots({0, 1}), "one");
  configuration = {};
  merge(robots({2}), "other");
  const Report report = merge({folder / "one", folder / "other"}, "both");
  EXPECT_THAT(report.notes,
              testing::Contains("the teams were made with different options of fusion: none of them counts here"));
  RunConfiguration written;
  load(written, {{folder / "both/config.yaml"}, {}, {}});
  EXPECT_EQ(written.fusion.merge_probability, fusion::FusionOptions().merge_probability);
}

TEST_F(MergeRequestsTest, a_veto_holds_until_it_is_dropped_or_one_of_its_maps_is_left_out) {
  const Report all = merge(robots({0, 1}), "all");
  ASSERT_EQ(all.team.verdicts.size(), 1U);
  ASSERT_FALSE(all.team.verdicts[0].witnesses.empty());
  const std::string id = to_hex(all.team.verdicts[0].witnesses[0]);
  MergeRequests requests;
  for (const Hash& witness : all.team.verdicts[0].witnesses) requests.vetoed.insert(parse_veto(to_hex(witness)));
  const Report apart = merge({folder / "all"}, "apart", requests);
  ASSERT_EQ(apart.team.components.size(), 2U);
  EXPECT_EQ(apart.team.verdicts.at(0).reason, Reason::vetoed);
  const Report again = merge({folder / "apart"}, "again");
  EXPECT_THAT(in_words(again, "again"),
              testing::ContainsRegex("note: as before: judgement [0-9a-f]+ of robot0 and robot1 is not believed"));
  expect_same_maps("apart", "again");
  EXPECT_EQ(merge_anew({folder / "apart"}, "forgotten").team.components.size(), 1U);
  merge(robots({0}), "alone");
  const Report without = merge({folder / "apart"}, "without", {{"robot1"}, {}, {}});
  EXPECT_THAT(in_words(without, "without"), testing::Not(HasSubstr("as before")));
  expect_same_maps("alone", "without");

  // A run that begins with them.
  RunConfiguration one = test_support::simulated_team().configuration();
  one.robots.resize(1);
  one.robots[0].edge.clear();
  one.edges.clear();
  one.maps = {(folder / "apart").string()};
  const Report next = run_batch(one, make_plan(one, {}), {folder / "next", false, false}, pool, *progress);
  EXPECT_THAT(next.notes, testing::Contains(HasSubstr("as before: judgement ")));
  const auto is_vetoed = [](const Verdict& verdict) { return verdict.reason == Reason::vetoed; };
  EXPECT_EQ(std::count_if(next.team.verdicts.begin(), next.team.verdicts.end(), is_vetoed), 1);

  requests.vetoed = {hash_of_bytes("no judgement")};
  EXPECT_THAT(in_words(merge(robots({0, 1}), "unknown", requests), "unknown"), HasSubstr("changes nothing"));
  for (const std::string& bad : {std::string("alpha,beta"), id.substr(1), "g" + id.substr(1), id + "0"})
    EXPECT_THROW(parse_veto(bad), Error) << bad;
}

TEST_F(MergeRequestsTest, damaged_requests_of_a_store_are_named) {
  merge(robots({0, 1}), "all", {{}, {{"robot0", "robot1"}}, {}});
  mapdb::StoredMaps stored = mapdb::read_store(folder / "all/team-1/map.mwdb");
  ASSERT_EQ(stored.metadata.count("requests"), 1U);
  stored.metadata["requests"] = "{\"refused\": [[1]]}";
  mapdb::write_store(folder / "all/team-1/map.mwdb", stored);
  try {
    merge({folder / "all"}, "out");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    EXPECT_THAT(error.what(), HasSubstr("what was said when it was merged cannot be read"));
  }
}

// --- priors ---

MergeRequests anchored(const Pose2& a_from_b, double sigma_m = 0.5) {
  MergeRequests requests;
  requests.anchors = {{"robot0", "robot1", a_from_b, sigma_m}};
  return requests;
}

TEST_F(MergeRequestsTest, a_right_prior_agrees) {
  const Report report =
      merge(robots({0, 1}), "out", anchored(compose(apartment().truth(0, 1), Pose2(0.3, -0.2, 0.05))));
  EXPECT_EQ(report.team.components.size(), 1U);
  ASSERT_TRUE(report.team.verdicts[0].prior);
  const PriorCheck& prior = *report.team.verdicts[0].prior;
  EXPECT_FALSE(prior.is_contradicted);
  EXPECT_NEAR(prior.off_m.value(), 0.36, 0.1);
  EXPECT_THAT(in_words(prior), HasSubstr("the maps agree with the prior within 0."));
}

TEST_F(MergeRequestsTest, a_prior_that_is_wrong_by_ten_metres_is_found_out) {
  const Report report = merge(robots({0, 1}), "out", anchored(compose(apartment().truth(0, 1), Pose2(8.0, 6.0, 0.0))));
  ASSERT_EQ(report.team.components.size(), 1U);
  EXPECT_THAT(planar(report.team.verdicts[0].alignment->a_from_b.pose),
              test::IsNear(apartment().truth(0, 1), 0.25, 0.04));
  const PriorCheck& prior = report.team.verdicts[0].prior.value();
  EXPECT_TRUE(prior.is_contradicted);
  EXPECT_NEAR(prior.off_m.value(), 10.0, 0.3);
  EXPECT_THAT(in_words(report, "out"), HasSubstr("robot0 + robot1: the prior is contradicted: the maps lie 1"));
  EXPECT_TRUE(merges_json(report)[0]["prior"]["contradicted"]);
}

TEST_F(MergeRequestsTest, a_prior_that_is_wrong_by_half_a_turn_is_found_out) {
  const Report report = merge(robots({0, 1}), "out", anchored(compose(apartment().truth(0, 1), Pose2(0.0, 0.0, M_PI))));
  ASSERT_EQ(report.team.components.size(), 1U);
  EXPECT_THAT(planar(report.team.verdicts[0].alignment->a_from_b.pose),
              test::IsNear(apartment().truth(0, 1), 0.25, 0.04));
  EXPECT_TRUE(report.team.verdicts[0].prior->is_contradicted);
  EXPECT_NEAR(report.team.verdicts[0].prior->off_rad.value(), M_PI, 0.05);
}

TEST_F(MergeRequestsTest, a_prior_does_not_join_strangers) {
  const auto strangers = simulation::make_two_strangers();
  std::vector<fs::path> paths;
  for (const auto& robot : strangers.robots) paths.push_back(put(test::mapped(robot, strangers.laser)));
  for (const double x : {0.0, 3.0}) {
    const Report report = merge(paths, "out" + std::to_string(static_cast<int>(x)), anchored(Pose2(x, 0.0, 0.0)));
    EXPECT_EQ(report.team.components.size(), 2U) << x;
    ASSERT_TRUE(report.team.verdicts[0].prior);
    EXPECT_TRUE(report.team.verdicts[0].prior->is_contradicted) << in_words(*report.team.verdicts[0].prior);
  }
}

TEST_F(MergeRequestsTest, known_starts_are_priors_of_each_pair) {
  const std::vector<Map>& maps = apartment().maps;
  const auto start = [](const Pose2& pose, double sigma_m) {
    return StartPose{pose.x, pose.y, pose.phi, sigma_m, 0.1};
  };
  const Pose2 first(10.0, 20.0, 1.0);
  const auto priors = priors_of_starts({{&maps[0], start(first, 0.3)},
                                        {&maps[1], start(compose(first, apartment().truth(0, 1)), 0.4)},
                                        {&maps[2], start(Pose2(), 0.0)}});
  ASSERT_EQ(priors.size(), 1U);
  EXPECT_THAT(priors[0].a_from_b, test::IsNear(apartment().truth(0, 1), 1e-6, 1e-6));
  EXPECT_GE(priors[0].sigma_m, 0.5);
  fusion::FusionInput input;
  input.maps = {maps[0], maps[1]};
  input.priors = priors;
  fusion::Memo memo;
  const auto result = fusion::fuse(input, {}, memo, pool, *progress);
  EXPECT_EQ(result.components.size(), 1U);
  EXPECT_FALSE(result.verdicts[0].prior->is_contradicted);
}

}  // namespace
}  // namespace mapweave::runtime
