#include <gtest/gtest.h>
#include <laser/constraint_search.h>
#include <laser/laser_team.h>
#include <support/simulated_maps.h>

#include <algorithm>

namespace mapweave::fusion {
namespace {

struct Drive {
  std::vector<simulation::SimulatedStep> steps;
  simulation::SimulatedLaserOptions laser;
};

Drive drive(std::int64_t seed) {
  simulation::TeamOptions options;
  options.robots = 1;
  options.length_m = 70.0;
  options.seed = seed;
  const auto team = simulation::make_apartment({}, options);
  return {team.robots[0].steps, team.laser};
}

Drive mirrored(Drive drive) {
  for (auto& step : drive.steps) {
    std::reverse(step.ranges.begin(), step.ranges.end());
    step.world_from_robot = {step.world_from_robot.x, -step.world_from_robot.y, -step.world_from_robot.phi};
  }
  return drive;
}

Map part_of(const Drive& drive, const char* name, std::size_t begin, std::size_t end) {
  simulation::SimulatedRobot robot;
  robot.id = RobotId(name);
  for (std::size_t i = begin; i < end; ++i) robot.steps.push_back(drive.steps[i]);
  return test::truth_map(robot, drive.laser);
}

struct Search {
  std::size_t matches = 0;  // beside the one that was given
  Pose2 last_from_first;    // of the first map's last submap and the second map's first one
};

// Two maps that one doubtful match connects to 2 m, the first map's first or last submap to the second's first: what is
// so vague confirms nothing.
Search searched(const Map& one, const Map& other, const Pose2& one_from_other, SearchExtent extent,
                bool is_matched_at_end = false) {
  WorkerPool pool(1);
  Memo memo;
  const FusionOptions options;
  const std::set<Hash> vetoed;
  const FusionInput input;
  matching::ModelCache cache(std::size_t{64} << 20U);
  const std::vector<PreparedMap> maps{prepare(one, cache, options.stride_m, pool),
                                      prepare(other, cache, options.stride_m, pool)};
  const SubmapGraph graph(maps, options.solve);
  SubmapJudge judge(maps, graph, options, vetoed, {cache, memo, pool, input});
  SubmapMatch given;
  const std::size_t last = maps[0].submaps.size() - 1;
  given.from = is_matched_at_end ? last : 0;
  given.to = last + 1;
  given.from_from_to =
      between(maps[0].map_from_submap[given.from], compose(one_from_other, maps[1].map_from_submap.front()));
  given.information = Eigen::Vector3d(0.25, 0.25, 400.0).asDiagonal();
  given.probability = 0.5;
  const auto between_maps = [&](std::size_t i, std::size_t j) { return graph.map_of(i) != graph.map_of(j); };
  const auto found = ConstraintSearch(maps, graph, judge).run({0, 1}, {given}, between_maps, 12, extent);
  return {found.matches.size() - 1, between(found.solved.pose_of(last), found.solved.pose_of(given.to))};
}

const Pose2 kOff{1.5, -1.5, 0.1};

TEST(ConstraintSearch, of_a_team_finds_what_little_two_maps_share_where_one_ends_and_the_other_begins) {
  const Drive whole = drive(7);
  for (const std::size_t gap : {20, 60}) {  // steps of 0.04 m that neither recorded
    const std::size_t end = whole.steps.size() * 40 / 100, begin = end + gap;
    const Map one = part_of(whole, "one", 0, end), other = part_of(whole, "other", begin, whole.steps.size());
    const Pose2 one_from_other = between(whole.steps.front().world_from_robot, whole.steps[begin].world_from_robot);
    EXPECT_EQ(searched(one, other, compose(one_from_other, kOff), SearchExtent::quick).matches, 0U)
        << gap;  // while nothing says that they are one team
    const Search found = searched(one, other, compose(one_from_other, kOff), SearchExtent::final),
                 truth = searched(one, other, one_from_other, SearchExtent::final);
    EXPECT_GE(found.matches, 2U) << gap;
    const Pose2 apart = between(truth.last_from_first, found.last_from_first);
    EXPECT_LT(std::hypot(apart.x, apart.y), 0.05) << gap;
    EXPECT_LT(std::abs(apart.phi), 0.01) << gap;
  }
}

// Two hypotheses that rest on one ambiguous judgement are rivals, not the same.
TEST(MergeHypothesis, is_known_by_where_its_matches_have_it) {
  SubmapMatch match;
  match.judgement = Hasher().add("ambiguous").finish();
  SubmapMatch rival = match;
  rival.from_from_to.x = 5.0;
  const std::vector<SubmapMatch> none, one{match}, other{rival}, both{match, rival};
  EXPECT_EQ(hash_of({&none, &one}), hash_of({&none, &one}));
  EXPECT_NE(hash_of({&none, &one}), hash_of({&none, &other}));
  EXPECT_NE(hash_of({&none, &one}), hash_of({&one, &none}));
  EXPECT_NE(hash_of({&none, &one}), hash_of({&none, &both}));
}

TEST(ConstraintSearch, finds_where_places_look_alike_though_the_graph_has_them_too_far_apart) {
  const Drive whole = drive(7);
  const std::size_t begin = whole.steps.size() * 3 / 10, end = whole.steps.size() * 7 / 10;
  const Map one = part_of(whole, "one", 0, end), other = part_of(whole, "other", begin, whole.steps.size());
  const Pose2 one_from_other = between(whole.steps.front().world_from_robot, whole.steps[begin].world_from_robot);
  const Pose2 too_far{8.0, -6.0, 0.12};  // with a standard deviation of 2 m, windows reach 6 m
  EXPECT_EQ(searched(one, other, compose(one_from_other, too_far), SearchExtent::final).matches, 0U);
  const Search found = searched(one, other, compose(one_from_other, too_far), SearchExtent::alike),
               truth = searched(one, other, one_from_other, SearchExtent::final);
  EXPECT_GE(found.matches, 2U);
  const Pose2 apart = between(truth.last_from_first, found.last_from_first);
  EXPECT_LT(std::hypot(apart.x, apart.y), 0.05);
  EXPECT_LT(std::abs(apart.phi), 0.01);
  const Pose2 impossible{30.0, -20.0, 0.5};
  EXPECT_EQ(searched(one, other, compose(one_from_other, impossible), SearchExtent::alike).matches, 0U);
}

TEST(ConstraintSearch, finds_nothing_between_maps_that_were_matched_wrongly) {
  const Drive whole = drive(7);
  const std::size_t half = whole.steps.size() / 2;
  const Map one = part_of(whole, "one", 0, half);
  for (const Drive& alien : {mirrored(whole), drive(11), mirrored(drive(12))})
    for (const std::size_t begin : {half, half + 100}) {
      const Map other = part_of(alien, "other", begin, alien.steps.size());
      const Pose2 laid = between(whole.steps.front().world_from_robot, whole.steps[half - 1].world_from_robot);
      for (const bool is_matched_at_end : {false, true})
        for (const SearchExtent extent : {SearchExtent::final, SearchExtent::alike})
          EXPECT_EQ(searched(one, other, laid, extent, is_matched_at_end).matches, 0U)
              << begin << " of " << alien.steps.size();
    }
}

}  // namespace
}  // namespace mapweave::fusion
