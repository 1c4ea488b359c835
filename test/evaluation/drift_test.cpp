#include <gtest/gtest.h>
#include <mapweave/evaluation/drift.h>

namespace mapweave::evaluation {
namespace {

// A robot that drives straight on, a metre a pose, and measures each metre as `measured_m`, turning by `turn_rad`.
std::vector<PosePair> straight(std::size_t poses, double measured_m, double turn_rad = 0.0) {
  std::vector<PosePair> track;
  Pose2 estimate;
  for (std::size_t i = 0; i < poses; ++i) {
    track.push_back({Stamp{static_cast<std::int64_t>(i) * 100000000},
                     {{static_cast<double>(i), 0.0, 0.0}, {1, 0, 0, 0}},
                     spatial(estimate)});
    estimate = compose(estimate, Pose2(measured_m, 0.0, turn_rad));
  }
  return track;
}

TEST(Drift, is_the_share_of_pieces_of_100_to_800_metres_that_kitti_counts) {
  const Drift drift = evaluation::drift({straight(250, 1.01)});
  // Pieces begin at every tenth pose and end at the first one that is more than 100 or 200 m on.
  EXPECT_EQ(drift.by_length[0].pieces, 15u);
  EXPECT_EQ(drift.by_length[1].pieces, 5u);
  EXPECT_EQ(drift.by_length[2].pieces, 0u);
  EXPECT_EQ(drift.all.pieces, 20u);
  EXPECT_NEAR(drift.by_length[0].translation_percent, 1.01, 1e-9);  // 101 poses, 1 cm each
  EXPECT_NEAR(drift.by_length[1].translation_percent, 1.005, 1e-9);
  EXPECT_NEAR(drift.all.translation_percent, (15 * 1.01 + 5 * 1.005) / 20, 1e-9);
  EXPECT_NEAR(drift.all.rotation_deg_per_m, 0.0, 1e-9);
}

TEST(Drift, of_turns_is_in_degrees_to_the_metre) {
  EXPECT_NEAR(drift({straight(150, 1.0, 1e-4)}).by_length[0].rotation_deg_per_m, 101 * 1e-4 / 100 * 180 / M_PI, 1e-9);
}

TEST(Drift, of_a_short_trajectory_is_none) { EXPECT_EQ(drift({straight(90, 1.0), straight(90, 1.0)}).all.pieces, 0u); }

}  // namespace
}  // namespace mapweave::evaluation
