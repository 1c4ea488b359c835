#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/matching/judge.h>
#include <support/pose_matchers.h>
#include <support/simulated_maps.h>

#include <algorithm>

namespace mapweave::matching {
namespace {

using test::IsNear;

SubmapView view(const Map& map, std::size_t number) {
  const Submap& submap = (map.submaps.begin() + static_cast<std::ptrdiff_t>(number))->second;
  return {submap.id, submap.content, std::make_shared<const SubmapModel>(submap, map.nodes)};
}

Pose2 anchor(const Map& map, std::size_t number) {
  return planar(
      map.nodes.find((map.submaps.begin() + static_cast<std::ptrdiff_t>(number))->second.anchor())->map_from_node);
}

struct Two {
  Map a, b;
  Pose2 a_from_b;
  explicit Two(const simulation::SimulatedTeam& team)
      : a(test::truth_map(team.robots[0], team.laser)),
        b(test::truth_map(team.robots[1], team.laser)),
        a_from_b(
            between(team.robots[0].steps.front().world_from_robot, team.robots[1].steps.front().world_from_robot)) {}
  Pose2 truth(std::size_t i, std::size_t j) const { return between(anchor(a, i), compose(a_from_b, anchor(b, j))); }
};

simulation::TeamOptions everyone_everywhere() {
  simulation::TeamOptions options;
  options.shared = 1.0;
  return options;
}

TEST(Judge, aligns_two_views_of_one_place_within_centimetres) {
  const Two two(simulation::make_apartment({}, everyone_everywhere()));
  std::vector<double> errors;
  for (std::size_t j = 0; j < two.b.submaps.size(); ++j)
    for (std::size_t i = 0; i < two.a.submaps.size(); ++i) {
      const Pose2 truth = two.truth(i, j);
      if (std::hypot(truth.x, truth.y) > 3.0) continue;
      const Judgement judgement = judge(view(two.a, i), view(two.b, j), {compose(truth, {0.4, -0.3, 0.06}), 1.0, 0.2});
      if (judgement.doubt != Reason::none || judgement.probability < 0.6) continue;
      // Walls seen from their other side lie a wall's thickness off: that is what the wider bound is for.
      EXPECT_THAT(planar(judgement.hypotheses.front().a_from_b.pose), IsNear(truth, 0.2, 0.02));
      const Pose2 apart = between(truth, planar(judgement.hypotheses.front().a_from_b.pose));
      errors.push_back(std::hypot(apart.x, apart.y));
      EXPECT_LT(judgement.evidence.conflict, 0.06);
    }
  ASSERT_GE(errors.size(), 3U);
  std::sort(errors.begin(), errors.end());
  EXPECT_LT(errors[errors.size() / 2], 0.04);
}

// Single rooms of different buildings may look alike, so a pair alone never joins maps (fusion asks for witnesses); but
// few may.
TEST(Judge, rarely_takes_a_strangers_room_for_its_own) {
  const Two two(simulation::make_two_strangers());
  std::size_t asked = 0, believed = 0;
  for (std::size_t j = 0; j < two.b.submaps.size(); ++j)
    for (std::size_t i = 0; i < two.a.submaps.size(); i += 2) {
      const Judgement judgement = judge(view(two.a, i), view(two.b, j), {{}, 8.0, M_PI});
      ++asked;
      believed += judgement.doubt == Reason::none && judgement.probability > 0.6;
    }
  EXPECT_LE(believed * 5, asked) << believed << " of " << asked;
}

TEST(Judge, sees_a_wall_that_the_other_saw_through) {
  const Two two(simulation::make_apartment({}, everyone_everywhere()));
  const SubmapModel a(two.a.submaps.front().second, two.a.nodes);
  const Evidence right = weigh(a, a, {}), wrong = weigh(a, a, {0.9, 0.7, 0.5});
  EXPECT_GT(right.inliers, 0.98);
  EXPECT_EQ(right.conflict, 0.0);
  EXPECT_EQ(right.longest_contradiction_m[0], 0.0);
  EXPECT_GT(wrong.conflict, 0.03);
  EXPECT_GT(wrong.longest_contradiction_m[0], 0.5);
  EXPECT_LT(wrong.inliers, 0.6);
}

TEST(Judge, calls_a_bare_corridor_unobservable_or_ambiguous) {
  simulation::CorridorOptions corridor;
  corridor.doors = 0;
  corridor.clutter = 0;
  corridor.length_m = 60.0;
  simulation::TeamOptions options = everyone_everywhere();
  options.laser.max_range_m = 8.0;
  const Two two(simulation::make_corridor(corridor, options));
  const std::size_t middle_a = two.a.submaps.size() / 4, middle_b = two.b.submaps.size() / 4;
  const Judgement judgement = judge(view(two.a, middle_a), view(two.b, middle_b), {{}, 6.0, M_PI});
  EXPECT_TRUE(judgement.doubt != Reason::none || judgement.probability < 0.5)
      << "observability " << judgement.evidence.observability(1);
}

TEST(Judge, is_pure_and_names_its_answer_before_it_is_made) {
  const Two two(simulation::make_apartment({}, everyone_everywhere()));
  const auto a = view(two.a, 0), b = view(two.b, 0);
  const WideWindow window{two.truth(0, 0), 2.0, 0.3};
  const Judgement one = judge(a, b, window), two_times = judge(a, b, window);
  EXPECT_EQ(one.id, judgement_id(a.content, b.content, window, {}));
  EXPECT_EQ(one.probability, two_times.probability);
  ASSERT_EQ(one.hypotheses.size(), two_times.hypotheses.size());
  for (std::size_t i = 0; i < one.hypotheses.size(); ++i)
    EXPECT_EQ(one.hypotheses[i].a_from_b.pose.t, two_times.hypotheses[i].a_from_b.pose.t);
  JudgeOptions strict;
  strict.min_inliers = 0.9;
  EXPECT_NE(one.id, judgement_id(a.content, b.content, window, strict));
  EXPECT_THROW(judge(b, a, window), ContractViolation);
}

TEST(SecondVerifier, agrees_with_the_truth_and_disagrees_with_a_shift) {
  const Two two(simulation::make_apartment({}, everyone_everywhere()));
  const SubmapModel a(two.a.submaps.front().second, two.a.nodes);
  const auto right = verify(a, a, {}), shifted = verify(a, a, {0.3, 0.0, 0.0});
  ASSERT_TRUE(right && shifted);
  EXPECT_GT(right->inliers, 0.95);
  EXPECT_LT(right->disagreement_m, 0.01);
  EXPECT_GT(shifted->disagreement_m, 0.15);
}

}  // namespace
}  // namespace mapweave::matching
