#include <mapweave/runtime/report.h>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <cmath>

namespace mapweave::runtime {
namespace {

using testing::HasSubstr;

Verdict verdict(Decision decision, Reason reason = Reason::none) {
  Verdict result;
  result.a = MapId("alpha");
  result.b = MapId("beta");
  result.decision = decision;
  result.reason = reason;
  result.alignment.emplace().a_from_b.pose = spatial(Pose2(1.0, 2.0, M_PI / 2));
  result.witnesses = {hash_of_bytes("a witness")};
  return result;
}

Report report_of(Decision decision, std::size_t components) {
  Report report;
  RobotReport alpha;
  alpha.id = RobotId("alpha");
  alpha.scans = 10;
  alpha.log_seconds = 20.0;
  alpha.wall_seconds = 2.0;
  alpha.mapped = true;
  report.robots = {alpha};
  report.team.tier = TierId("cloud");
  report.team.verdicts = {verdict(decision, decision == Decision::accepted ? Reason::none : Reason::ambiguous)};
  report.team.components.resize(components, {MapId("alpha")});
  return report;
}

TEST(Report, reports_b_seen_from_a_which_is_the_inverse_of_the_alignment) {
  const auto merges = merges_json(report_of(Decision::accepted, 1));
  ASSERT_EQ(merges.size(), 1u);
  const auto& pose = merges[0]["b_from_a"];  // inverse of (1, 2, 90 deg)
  EXPECT_NEAR(pose["x"].get<double>(), -2.0, 1e-12);
  EXPECT_NEAR(pose["y"].get<double>(), 1.0, 1e-12);
  EXPECT_NEAR(pose["yaw"].get<double>(), -M_PI / 2, 1e-12);
  EXPECT_EQ(merges[0]["covariance"].size(), 3u);
  EXPECT_EQ(merges[0]["accepted"], true);
  EXPECT_EQ(merges[0]["witnesses"][0], to_hex(hash_of_bytes("a witness")));
}

TEST(Report, reports_an_alignment_in_space_with_its_scale) {
  Report report = report_of(Decision::accepted, 1);
  const Sim3 a_from_b{
      {Eigen::Vector3d(1.0, 2.0, 3.0), Eigen::Quaterniond(Eigen::AngleAxisd(0.5, Eigen::Vector3d::UnitX()))}, 2.0};
  report.team.verdicts[0].alignment->a_from_b = a_from_b;
  const auto json = merges_json(report)[0]["b_from_a"];
  const auto t = json["t"].get<std::vector<double>>(), q = json["q"].get<std::vector<double>>();
  const Eigen::Vector3d point_in_b(0.3, -0.2, 0.7);
  const Eigen::Vector3d point_in_a = a_from_b.scale * (a_from_b.pose.q * point_in_b) + a_from_b.pose.t;
  const Eigen::Vector3d back = json["scale"].get<double>() * (Eigen::Quaterniond(q[3], q[0], q[1], q[2]) * point_in_a) +
                               Eigen::Vector3d(t[0], t[1], t[2]);
  EXPECT_LT((back - point_in_b).norm(), 1e-12);
}

TEST(Report, has_the_keys_of_the_contract) {
  const auto merges = merges_json(report_of(Decision::refused, 2));
  for (const char* key :
       {"tier",      "a",           "b",        "kind",       "accepted",   "decision",          "reason",
        "proposer",  "probability", "b_from_a", "covariance", "overlap",    "conflict",          "second_best",
        "witnesses", "seconds",     "words",    "detail",     "in_one_map", "connected_through", "team_b_from_a",
        "merge"})
    EXPECT_TRUE(merges[0].contains(key)) << key;
  const auto summary = summary_json(report_of(Decision::refused, 2));
  for (const char* key : {"robots", "edges", "team", "wall_seconds", "peak_rss_bytes", "stages"})
    EXPECT_TRUE(summary.contains(key)) << key;
  for (const char* key : {"id", "scans", "log_seconds", "wall_seconds", "cpu_seconds", "real_time_factor"})
    EXPECT_TRUE(summary["robots"][0].contains(key)) << key;
  EXPECT_EQ(summary["robots"][0]["real_time_factor"], 10.0);
  EXPECT_EQ(summary["team"]["components"], 2);
  EXPECT_EQ(summary["team"]["merged_pairs"], 0);
  EXPECT_EQ(summary["team"]["refused_pairs"], 1);
}

TEST(Report, ends_with_the_exit_code_of_what_happened) {
  Report report = report_of(Decision::accepted, 1);
  EXPECT_EQ(report.exit_code(), ExitCode::done);
  report.team.components.resize(2);
  EXPECT_EQ(report.exit_code(), ExitCode::stayed_apart);
  report.robots[0].trouble = Error(ErrorCode::kCorrupt, "cut short", "alpha.rawlog");
  EXPECT_EQ(report.exit_code(), ExitCode::bad_input);
  report.robots[0].trouble = Error(ErrorCode::kHelperFailed, "killed");
  EXPECT_EQ(report.exit_code(), ExitCode::failed);
  report.interrupted = true;
  EXPECT_EQ(report.exit_code(), ExitCode::interrupted);
}

TEST(Report, says_why_maps_stayed_apart) {
  const std::string words = in_words(report_of(Decision::refused, 2), "maps/office");
  EXPECT_THAT(words, HasSubstr("robot alpha: 10 scans of 20 s in 2.0 s (10 x real time)"));
  EXPECT_THAT(words, HasSubstr("alpha + beta: kept apart: they fit together in more than one way"));
  EXPECT_THAT(words, HasSubstr("2 separate teams"));
  EXPECT_THAT(words, HasSubstr("maps/office"));
}

TEST(Report, says_which_merge_put_maps_into_one) {
  Verdict direct = verdict(Decision::accepted);
  direct.probability = 0.21;
  direct.in_one_map = InOneMap{{}, {MapId("gamma")}};
  direct.merge = TeamMerge{{MapId("alpha"), MapId("gamma")}, {MapId("beta")}, 0.996, "ring keys"};
  EXPECT_THAT(in_words(direct), testing::StartsWith("alpha + beta: merged directly, and through gamma (the merge of "
                                                    "alpha + gamma with beta has probability 1.00; "
                                                    "these two maps by themselves: probability 0.21, overlap 0 %"));
  direct.in_one_map->through.clear();
  direct.merge = TeamMerge{{MapId("alpha")}, {MapId("beta")}, 0.21, "ring keys"};
  EXPECT_EQ(in_words(direct), "alpha + beta: merged (probability 0.21, overlap 0 %, conflict 0.0 %, 1 place agrees)");

  Verdict through = verdict(Decision::deferred, Reason::little_evidence);
  through.in_one_map = InOneMap{{}, {MapId("gamma")}};
  EXPECT_THAT(in_words(through), testing::StartsWith("alpha + beta: in one map, through gamma; not matched to each "
                                                     "other by themselves: what fits may fit by chance"));
}

TEST(Report, counts_what_each_proposer_found) {
  Report report = report_of(Decision::accepted, 1);
  Verdict& first = report.team.verdicts.front();
  first.proposer = "corners";
  first.merge = TeamMerge{{MapId("alpha")}, {MapId("beta"), MapId("gamma")}, 0.99, "corners"};
  Verdict other = first;
  other.b = MapId("gamma");  // of the same merge
  Verdict by_cameras = verdict(Decision::accepted);
  by_cameras.proposer = "words";
  Verdict apart = verdict(Decision::refused);
  apart.proposer = "whole maps";
  report.team.verdicts.insert(report.team.verdicts.end(), {other, by_cameras, apart});
  const auto proposers = summary_json(report)["team"]["proposers"];
  EXPECT_EQ(proposers.size(), 2U);
  EXPECT_EQ(proposers["corners"], 1);
  EXPECT_EQ(proposers["words"], 1);
}

TEST(Report, says_that_no_common_place_was_found_rather_than_numbers_of_nothing) {
  Report report = report_of(Decision::refused, 2);
  report.team.verdicts[0].reason = Reason::little_overlap;
  report.team.verdicts[0].probability = 0.0;
  const std::string words = in_words(report, "maps/office");
  EXPECT_THAT(words, HasSubstr("kept apart: they show too little common ground: no place that both show was found"));
  EXPECT_THAT(words, testing::Not(HasSubstr("overlap 0 %")));
}

}  // namespace
}  // namespace mapweave::runtime
