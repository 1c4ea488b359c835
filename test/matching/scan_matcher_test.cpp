#include "room.h"

#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/matching/scan_matcher.h>
#include <support/pose_matchers.h>

#include <random>

namespace mapweave::matching {
namespace {

using test::IsNear;

WallField room_field() {
  WallField field;
  field.add(room());
  field.settle();
  return field;
}

double score_at(const WallField& field, const std::vector<WallPoint>& points, const Pose2& pose) {
  double sum = 0;
  const double c = std::cos(pose.phi), s = std::sin(pose.phi);
  for (const auto& p : points)
    sum += field.likelihood().get(cell_of(pose.x + c * p.x - s * p.y, 20.0), cell_of(pose.y + s * p.x + c * p.y, 20.0));
  return sum / (255.0 * static_cast<double>(points.size()));
}

TEST(Correlate, finds_the_best_pose_of_its_window_as_brute_force_does) {
  const WallField field = room_field();
  const Pose2 truth{2.0, 1.7, 0.4};
  const auto points = thinned(seen_from(room(), truth), 0.1, 120);
  const Pose2 guess{2.17, 1.58, 0.47};
  const SearchWindow window{0.3, 0.1, 0.02};
  double best = 0;
  for (int turn = -5; turn <= 5; ++turn)
    for (int y = -6; y <= 6; ++y)
      for (int x = -8; x <= 7; ++x)
        best =
            std::max(best, score_at(field, points, {guess.x + 0.05 * x, guess.y + 0.05 * y, guess.phi + 0.02 * turn}));
  const auto found =
      correlate(field.likelihood(), points, guess, window, {1e3, 1e3});  // a prior this wide weighs nothing
  ASSERT_TRUE(found);
  // Whole cells move with the points: a shift of the pose is a shift of the cells.
  EXPECT_NEAR(found->score, best, 0.02);
  EXPECT_THAT(found->field_from_scan, IsNear(truth, 0.06, 0.03));
  EXPECT_FALSE(found->at_border);
}

TEST(Correlate, works_at_the_rim_of_what_is_known) {
  const WallField field = room_field();
  const auto points = thinned(seen_from(room(), {2.0, 1.7, 0.0}), 0.1, 100);
  EXPECT_TRUE(correlate(field.likelihood(), points, {8.5, 6.0, 0.0}, {0.3, 0.1, 0.02}, {}));
  const auto nowhere = correlate(field.likelihood(), points, {500.0, 500.0, 0.0}, {0.3, 0.1, 0.02}, {});
  ASSERT_TRUE(nowhere);
  EXPECT_EQ(nowhere->score, 0.0);
}

TEST(Correlate, says_when_the_answer_lies_at_the_border_of_the_window) {
  const Pose2 truth{2.0, 1.7, 0.4};
  const auto points = thinned(seen_from(room(), truth), 0.1, 120);
  const auto found = correlate(room_field().likelihood(), points, {2.0, 1.7, 0.1}, {0.2, 0.1, 0.02}, {1e3, 1e3});
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->at_border);
}

TEST(Correlate, has_no_answer_without_walls_or_points) {
  EXPECT_FALSE(correlate(WallField().likelihood(), room(), {}, {}, {}));
  EXPECT_FALSE(correlate(room_field().likelihood(), {}, {}, {}, {}));
  EXPECT_THROW(correlate(room_field().likelihood(), std::vector<WallPoint>(300), {}, {}, {}), ContractViolation);
}

TEST(Refine, comes_within_millimetres_from_starts_within_its_reach) {
  const WallField field = room_field();
  std::mt19937_64 random(9);
  const auto spread = [&](double half) {
    return half * (2.0 * static_cast<double>(random() >> 11) / 9007199254740992.0 - 1.0);
  };
  for (int trial = 0; trial < 50; ++trial) {
    const Pose2 truth{1.8 + spread(0.8), 1.8 + spread(0.3), spread(3.0)};
    const auto points = thinned(seen_from(room(), truth), 0.05, 180);
    const ScanMatch match =
        refine(field, points, compose(truth, {spread(0.08), spread(0.08), spread(0.02)}), {}, nullptr, 30);
    EXPECT_THAT(match.field_from_scan, IsNear(truth, 0.006, 0.002)) << "trial " << trial;
    EXPECT_GT(match.inliers, 0.95);
  }
}

TEST(Refine, leaves_to_the_prior_what_walls_do_not_constrain) {
  WallField corridor;
  std::vector<WallPoint> walls;
  for (int i = -400; i < 400; ++i) {
    walls.push_back({0.025F * static_cast<float>(i), 1.0F, 0, -1});
    walls.push_back({0.025F * static_cast<float>(i), -1.0F, 0, 1});
  }
  corridor.add(walls);
  corridor.settle();
  std::vector<WallPoint> points;
  for (int i = -40; i < 40; ++i) {
    points.push_back({0.1F * static_cast<float>(i), 1.0F, 0, -1});
    points.push_back({0.1F * static_cast<float>(i), -1.0F, 0, 1});
  }
  const PriorWeight prior{0.02, 0.05};
  const ScanMatch match = refine(corridor, points, {0.1, 0.05, 0.01}, {0.02, 0.0, 0.0}, &prior);
  EXPECT_NEAR(match.field_from_scan.x, 0.02, 0.01);
  EXPECT_NEAR(match.field_from_scan.y, 0.0, 0.003);
  EXPECT_LT(match.information(0, 0), 1e-3 * match.information(1, 1));
}

TEST(Refine, overrules_wheels_that_slipped) {
  const WallField field = room_field();
  const Pose2 truth{2.0, 1.7, 0.4};
  const auto points = thinned(seen_from(room(), truth), 0.05, 180);
  const Pose2 wheels{2.3, 1.7, 0.5};
  const PriorWeight prior{0.005, 0.002, 180.0};
  const ScanMatch match = refine(field, points, {2.03, 1.68, 0.41}, wheels, &prior, 30);
  EXPECT_THAT(match.field_from_scan, IsNear(truth, 0.01, 0.005));
}

TEST(Refine, gives_information_in_the_frame_of_the_scan) {
  // One wall along x of the field; the scan is turned by 90 degrees: what is known lies along its own x.
  WallField wall;
  std::vector<WallPoint> points;
  for (int i = -200; i < 200; ++i) points.push_back({0.025F * static_cast<float>(i), 0.0F, 0, -1});
  wall.add(points);
  wall.settle();
  const Pose2 pose{0.0, -1.0, M_PI / 2};
  const ScanMatch match = refine(wall, thinned(seen_from(points, pose), 0.05, 150), pose, {}, nullptr);
  EXPECT_GT(match.information(0, 0), 100.0 * match.information(1, 1));
}

TEST(Refine, is_not_pulled_by_the_other_face_of_a_thin_wall) {
  // What is known: this room's end walls, and the far face of the partition at y = 1.1. The scan sees its near face, at
  // y = 1.0.
  WallField field;
  std::vector<WallPoint> known, near_face;
  for (int i = -150; i < 150; ++i) {
    const float along = 0.02F * static_cast<float>(i);
    known.push_back({along, 1.1F, 0, 1});
    known.push_back({along, -2.0F, 0, 1});
    known.push_back({-3.0F, along / 3, 1, 0});
    near_face.push_back({along, 1.0F, 0, -1});
  }
  field.add(known);
  field.settle();
  std::vector<WallPoint> scan = near_face;
  for (const auto& p : known)
    if (p.y < 1.05F) scan.push_back(p);
  const ScanMatch match = refine(field, thinned(scan, 0.04, 250), {0.02, 0.03, 0.005}, {}, nullptr, 30);
  EXPECT_NEAR(match.field_from_scan.y, 0.0, 0.005);
}

TEST(Thinned, keeps_points_apart_and_bounds_their_number) {
  std::vector<WallPoint> line;
  for (int i = 0; i < 1000; ++i) line.push_back({0.001F * static_cast<float>(i), 0.0F, 0, 1});
  const auto few = thinned(line, 0.05, 250);
  EXPECT_NEAR(static_cast<double>(few.size()), 20.0, 1.0);
  EXPECT_EQ(thinned(line, 0.0011, 100).size(), 100U);
}

}  // namespace
}  // namespace mapweave::matching
