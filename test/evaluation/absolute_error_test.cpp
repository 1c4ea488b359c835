#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/evaluation/absolute_error.h>

namespace mapweave::evaluation {
namespace {

using ::testing::HasSubstr;

// Ten poses along a bend, one a second, at a metre each.
Trajectory bend(double drift_per_metre, double yaw_offset_rad) {
  Trajectory trajectory;
  Pose2 pose(0.0, 0.0, yaw_offset_rad);
  for (int i = 0; i < 10; ++i) {
    trajectory.push_back({Stamp{i * 1000000000LL}, spatial(pose)});
    pose = compose(pose, Pose2(1.0 + drift_per_metre, 0.0, 0.2));
  }
  return trajectory;
}

TEST(AbsoluteError, of_a_trajectory_against_itself_is_zero) {
  for (const auto align : {AlignmentKind::none, AlignmentKind::se2, AlignmentKind::se3, AlignmentKind::sim3}) {
    const auto error = absolute_error(bend(0.0, 0.0), bend(0.0, 0.0), {align, 0.01});
    EXPECT_EQ(error.pairs, 10u);
    EXPECT_NEAR(error.translation_m.max, 0.0, 1e-9);
    EXPECT_NEAR(error.rotation_deg.max, 0.0, 1e-6);
  }
}

TEST(AbsoluteError, forgets_where_and_how_the_robot_started_when_aligned) {
  EXPECT_GT(absolute_error(bend(0.0, 1.0), bend(0.0, 0.0), {AlignmentKind::none, 0.01}).translation_m.rmse, 1.0);
  const auto aligned = absolute_error(bend(0.0, 1.0), bend(0.0, 0.0), {AlignmentKind::se2, 0.01});
  EXPECT_NEAR(aligned.translation_m.max, 0.0, 1e-9);
  EXPECT_NEAR(aligned.rotation_deg.max, 0.0, 1e-6);
}

TEST(AbsoluteError, scale_is_forgiven_by_sim3_alone) {
  EXPECT_GT(absolute_error(bend(0.5, 0.0), bend(0.0, 0.0), {AlignmentKind::se3, 0.01}).translation_m.rmse, 0.1);
  const auto scaled = absolute_error(bend(0.5, 0.0), bend(0.0, 0.0), {AlignmentKind::sim3, 0.01});
  EXPECT_NEAR(scaled.translation_m.max, 0.0, 1e-9);
  EXPECT_NEAR(scaled.reference_from_estimate.scale, 1.0 / 1.5, 1e-12);
}

TEST(AbsoluteError, says_when_no_stamps_match) {
  Trajectory later = bend(0.0, 0.0);
  for (auto& point : later) point.stamp.ns += 500000000;
  try {
    absolute_error(later, bend(0.0, 0.0));
    FAIL() << "compared poses half a second apart";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("stamps of the same clock"));
  }
}

TEST(RelativeError, is_the_drift_of_each_piece) {
  // A tenth too far in each metre; the path of the estimate itself is measured, so a piece of 2 m is two steps of 1.1
  // m.
  const auto one = relative_error(bend(0.1, 0.7), bend(0.0, 0.0), {AlignmentKind::none, 0.01});
  EXPECT_EQ(one.pairs, 9u);
  EXPECT_NEAR(one.translation_m.min, 0.1, 1e-9);
  EXPECT_NEAR(one.translation_m.max, 0.1, 1e-9);
  EXPECT_NEAR(one.rotation_deg.max, 0.0, 1e-6);
  const auto by_path =
      relative_error(bend(0.1, 0.7), bend(0.0, 0.0), {AlignmentKind::none, 0.01}, {2.0, DeltaUnit::metres, false, 0.1});
  EXPECT_EQ(by_path.pairs, 4u);
}

TEST(RelativeError, all_pairs_begin_at_every_pose) {
  EXPECT_EQ(
      relative_error(bend(0.0, 0.0), bend(0.0, 0.0), {AlignmentKind::none, 0.01}, {3.0, DeltaUnit::frames, true, 0.1})
          .pairs,
      7u);
  EXPECT_EQ(
      relative_error(bend(0.0, 0.0), bend(0.0, 0.0), {AlignmentKind::none, 0.01}, {3.0, DeltaUnit::frames, false, 0.1})
          .pairs,
      3u);
  EXPECT_EQ(
      relative_error(bend(0.0, 0.0), bend(0.0, 0.0), {AlignmentKind::none, 0.01}, {3.0, DeltaUnit::metres, true, 0.1})
          .pairs,
      7u);
}

TEST(RelativeError, refuses_pieces_longer_than_the_path) {
  EXPECT_THROW(relative_error(bend(0.0, 0.0), bend(0.0, 0.0), {AlignmentKind::none, 0.01},
                              {10.0, DeltaUnit::frames, false, 0.1}),
               Error);
  EXPECT_THROW(
      relative_error(bend(0.0, 0.0), bend(0.0, 0.0), {AlignmentKind::none, 0.01}, {50.0, DeltaUnit::metres, true, 0.1}),
      Error);
  EXPECT_THROW(
      relative_error(bend(0.0, 0.0), bend(0.0, 0.0), {AlignmentKind::none, 0.01}, {0.5, DeltaUnit::frames, true, 0.1}),
      ContractViolation);
}

TEST(TrajectoryErrors, of_robots_of_one_map_share_an_alignment) {
  // The second robot's map was laid 1 m beside where it belongs: an alignment of its own would hide that.
  Trajectory beside = bend(0.0, 0.0);
  for (auto& point : beside) point.pose.t.y() += 1.0;
  const AlignedTracks together =
      aligned_tracks({{bend(0.0, 0.0), bend(0.0, 0.0)}, {beside, bend(0.0, 0.0)}}, {AlignmentKind::se3, 0.01});
  ASSERT_EQ(together.tracks.size(), 2u);
  const TrajectoryError error = absolute_error(together);
  EXPECT_EQ(error.pairs, 20u);
  EXPECT_NEAR(error.translation_m.rmse, 0.5, 1e-9);
  EXPECT_EQ(relative_error(together).pairs, 18u);  // no piece leads from one robot to the other
  EXPECT_NEAR(relative_error(together).translation_m.max, 0.0, 1e-9);
}

}  // namespace
}  // namespace mapweave::evaluation
