#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/evaluation/relations.h>

namespace mapweave::evaluation {
namespace {

using ::testing::HasSubstr;

Stamp at(double seconds) { return Stamp{static_cast<std::int64_t>(std::llround(seconds * 1e9))}; }

// A robot that drives a square corner, a pose a second.
Trajectory corner() {
  return {{at(100.0), spatial(Pose2(0.0, 0.0, 0.0))},
          {at(101.0), spatial(Pose2(1.0, 0.0, 0.0))},
          {at(102.0), spatial(Pose2(2.0, 0.0, M_PI / 2))},
          {at(103.0), spatial(Pose2(2.0, 1.0, M_PI / 2))}};
}

std::string complaint_about(const std::string& text) {
  try {
    parse_relations(text, "r.relations");
  } catch (const Error& error) {
    return error.what();
  }
  return "no complaint";
}

TEST(RelationError, is_worked_out_by_hand) {
  // Both relations say 0.1 m less than the trajectory, the second in another direction and 2 degrees off.
  const std::vector<Relation> relations = {
      {at(100.0), at(101.0), Pose2(0.9, 0.0, 0.0)},
      {at(101.0), at(103.0), Pose2(1.0, 1.0 - 0.3, M_PI / 2 - 2.0 * M_PI / 180.0)}};
  const RelationError error = relation_error(corner(), relations);
  EXPECT_EQ(error.count, 2u);
  EXPECT_EQ(error.used, 2u);
  EXPECT_EQ(error.interpolated, 0u);
  EXPECT_NEAR(error.translation_mean_m, 0.2, 1e-12);
  EXPECT_NEAR(error.translation_std_m, 0.1, 1e-12);
  EXPECT_NEAR(error.translation_median_m, 0.2, 1e-12);
  EXPECT_NEAR(error.translation_max_m, 0.3, 1e-12);
  EXPECT_NEAR(error.translation_squared_mean, 0.05, 1e-12);
  EXPECT_NEAR(error.translation_squared_std, 0.04, 1e-12);
  EXPECT_NEAR(error.rotation_mean_deg, 1.0, 1e-12);
  EXPECT_NEAR(error.rotation_std_deg, 1.0, 1e-12);
  EXPECT_NEAR(error.rotation_squared_mean, 2.0, 1e-12);
}

TEST(RelationError, wraps_a_turn_across_the_seam) {
  const Trajectory turning = {{at(1.0), spatial(Pose2(0.0, 0.0, 0.0))},
                              {at(2.0), spatial(Pose2(0.0, 0.0, M_PI - 0.01))}};
  const RelationError error = relation_error(turning, {{at(1.0), at(2.0), Pose2(0.0, 0.0, -M_PI + 0.01)}});
  EXPECT_NEAR(error.rotation_mean_deg, 0.02 * 180.0 / M_PI, 1e-9);
}

TEST(RelationError, does_not_see_where_the_map_begins) {
  const std::vector<Relation> relations = {{at(100.0), at(102.0), Pose2(2.1, 0.2, 1.5)},
                                           {at(103.0), at(101.0), Pose2(-1.1, 1.0, -1.4)}};
  const RelationError here = relation_error(corner(), relations);
  Trajectory moved = corner();
  for (auto& point : moved) point.pose = compose(spatial(Pose2(70.0, -30.0, 2.0)), point.pose);
  const RelationError there = relation_error(moved, relations);
  EXPECT_NEAR(here.translation_mean_m, there.translation_mean_m, 1e-9);
  EXPECT_NEAR(here.rotation_mean_deg, there.rotation_mean_deg, 1e-9);
}

TEST(RelationError, carries_the_pose_to_the_sensor_that_the_relations_speak_of) {
  // A laser 0.5 m ahead moves when the robot turns on the spot.
  const Trajectory turning = {{at(1.0), spatial(Pose2(3.0, 3.0, 0.5))},
                              {at(2.0), spatial(Pose2(3.0, 3.0, 0.5 + M_PI / 2))}};
  const std::vector<Relation> of_the_laser = {{at(1.0), at(2.0), Pose2(-0.5, 0.5, M_PI / 2)}};
  RelationErrorOptions options;
  EXPECT_NEAR(relation_error(turning, of_the_laser, options).translation_mean_m, std::sqrt(0.5), 1e-9);
  options.robot_from_sensor = Pose2(0.5, 0.0, 0.0);
  EXPECT_NEAR(relation_error(turning, of_the_laser, options).translation_mean_m, 0.0, 1e-9);
}

TEST(RelationError, interpolates_where_the_trajectory_is_sparser_and_says_so) {
  const std::vector<Relation> relations = {{at(100.0), at(100.5), Pose2(0.5, 0.0, 0.0)},
                                           {at(100.0), at(101.0), Pose2(1.0, 0.0, 0.0)}};
  const RelationError error = relation_error(corner(), relations);
  EXPECT_EQ(error.used, 2u);
  EXPECT_EQ(error.interpolated, 1u);
  EXPECT_NEAR(error.translation_max_m, 0.0, 1e-12);
}

TEST(RelationError, leaves_out_what_the_trajectory_does_not_know) {
  RelationErrorOptions options;
  options.max_gap_s = 0.5;
  const std::vector<Relation> relations = {{at(100.0), at(100.5), Pose2(0.5, 0.0, 0.0)},      // in a gap
                                           {at(90.0), at(101.0), Pose2(1.0, 0.0, 0.0)},       // before the start
                                           {at(100.0009), at(101.0), Pose2(1.0, 0.0, 0.0)}};  // within the tolerance
  const RelationError error = relation_error(corner(), relations, options);
  EXPECT_EQ(error.count, 3u);
  EXPECT_EQ(error.used, 1u);
}

TEST(RelationError, refuses_relations_of_another_log) {
  try {
    relation_error(corner(), {{at(5000.0), at(5001.0), Pose2()}});
    FAIL() << "gave a number without any relation";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("(stamps 5000.000 to 5001.000)"));
    EXPECT_THAT(error.what(), HasSubstr("from 100.000 to 103.000"));
  }
  EXPECT_THROW(relation_error(corner(), {}), Error);
  EXPECT_THROW(relation_error({}, {{at(1.0), at(2.0), Pose2()}}), Error);
}

TEST(ParseRelations, reads_the_form_of_the_slam_benchmark) {
  const auto relations = parse_relations(
      "# timestamp1 timestamp2 x y z roll pitch yaw\n"
      "976052905.167303 976052911.885496 -0.056990 -0.128430 0.000000 0.000000 -0.000000 -1.682210\n",
      "r.relations");
  ASSERT_EQ(relations.size(), 1u);
  EXPECT_EQ(relations[0].stamp_i.ns, 976052905167303000);
  EXPECT_EQ(relations[0].stamp_j.ns, 976052911885496000);
  EXPECT_DOUBLE_EQ(relations[0].i_from_j.x, -0.056990);
  EXPECT_DOUBLE_EQ(relations[0].i_from_j.y, -0.128430);
  EXPECT_NEAR(relations[0].i_from_j.phi, -1.682210, 1e-12);
}

TEST(ParseRelations, names_the_line_of_what_it_cannot_use) {
  EXPECT_THAT(complaint_about("1 2 0 0 0 0 0 0\n1 2 0 0 0 0 0\n"),
              HasSubstr("r.relations:2: a line has 8 numbers (t_i t_j x y z roll pitch yaw), this one has 7"));
  EXPECT_THAT(complaint_about("1 2 0 0 0 0 0 nan\n"), HasSubstr("r.relations:1: 'nan' in column 8"));
  EXPECT_THAT(complaint_about("1 2 0 0 0 0 what 0\n"), HasSubstr("'what' in column 7"));
  EXPECT_THAT(complaint_about("1 1e300 0 0 0 0 0 0\n"), HasSubstr("no time in seconds"));
  EXPECT_THAT(complaint_about("# nothing\n"), HasSubstr("no relation in it"));
}

TEST(RelationError, of_a_team_counts_relations_between_its_robots) {
  const Trajectory whole = corner();
  const std::vector<Trajectory> team = {{whole[0], whole[1]}, {whole[2], whole[3]}};
  const std::vector<Relation> relations = {{at(100.0), at(101.0), Pose2(1.0, 0.0, 0.0)},
                                           {at(101.0), at(102.0), Pose2(1.0, 0.0, M_PI / 2)},
                                           {at(102.0), at(103.0), Pose2(1.0, 0.0, 0.0)}};
  const RelationError together = relation_error({TeamRelations{{team}, relations}});
  EXPECT_EQ(together.used, 3u);
  EXPECT_EQ(together.between_robots, 1u);
  EXPECT_NEAR(together.translation_max_m, 0.0, 1e-12);
  // In maps that stayed apart the poses of one say nothing of the other's.
  const RelationError apart = relation_error({TeamRelations{{{team[0]}, {team[1]}}, relations}});
  EXPECT_EQ(apart.used, 2u);
  EXPECT_EQ(apart.between_robots, 0u);
}

}  // namespace
}  // namespace mapweave::evaluation
