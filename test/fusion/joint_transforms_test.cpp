#include "team/joint_transforms.h"

#include <gtest/gtest.h>
#include <support/pose_matchers.h>

namespace mapweave::fusion {
namespace {

using test::IsNear;

Join join(std::size_t a, std::size_t b, const Pose2& a_from_b, double strength = 40.0) {
  Join result{a, b, strength, {}};
  for (const auto& [x, y] : {std::pair{0.0, 0.0}, {10.0, 2.0}, {3.0, 8.0}}) {
    const Pose2 p = compose(a_from_b, {x, y, 0});
    result.terms.push_back({p.x, p.y, x, y, a_from_b.phi, 16.0 / 3});
  }
  return result;
}

TEST(JointTransforms, put_three_maps_where_all_joins_agree) {
  const Pose2 b{5, 1, 0.6}, c{-3, 7, -2.0};
  const auto solution = solve_joint_transforms(3, {join(0, 1, b), join(0, 2, c), join(1, 2, between(b, c))},
                                               {{}, {5.3, 0.8, 0.5}, {-2.7, 7.2, -1.9}});
  EXPECT_TRUE(solution.converged);
  EXPECT_THAT(solution.team_from_map[1], IsNear(b, 1e-3, 1e-4));
  EXPECT_THAT(solution.team_from_map[2], IsNear(c, 1e-3, 1e-4));
  for (const double s : solution.switches) EXPECT_GT(s, 0.99);
}

TEST(JointTransforms, turn_off_the_weak_join_that_contradicts_the_strong_ones) {
  const Pose2 b{5, 1, 0.6}, c{-3, 7, -2.0}, wrong{4, -9, 1.0};
  const auto solution = solve_joint_transforms(3, {join(0, 1, b), join(0, 2, c), join(1, 2, wrong, 8.0)}, {{}, b, c});
  EXPECT_GT(solution.switches[0], 0.9);
  EXPECT_GT(solution.switches[1], 0.9);
  EXPECT_LT(solution.switches[2], 0.5);
  EXPECT_THAT(solution.team_from_map[1], IsNear(b, 0.1, 0.02));
}

TEST(JointTransforms, leave_the_first_map_at_the_origin_whatever_the_start) {
  const Pose2 b{5, 1, 0.6}, start{100, -40, 2.0};
  const auto solution = solve_joint_transforms(2, {join(0, 1, b)}, {start, compose(start, b)});
  EXPECT_THAT(solution.team_from_map[0], IsNear(Pose2{}, 1e-9, 1e-9));
  EXPECT_THAT(solution.team_from_map[1], IsNear(b, 1e-3, 1e-4));
}

TEST(JointTransforms, place_a_single_map) {
  EXPECT_EQ(solve_joint_transforms(1, {}, {{3, 4, 0.5}}).team_from_map.size(), 1U);
}

}  // namespace
}  // namespace mapweave::fusion
