#include "decision/verdict.h"

#include <gtest/gtest.h>
#include <laser/wall_agreement.h>

namespace mapweave::fusion {
namespace {

Verdict pair_of(const char* kind = "vision") { return unseen(MapId("a"), MapId("b"), TierId("cloud"), kind); }

Verdict accepted(const char* kind, double probability) {
  Verdict verdict = pair_of(kind);
  verdict.decision = Decision::accepted;
  verdict.reason = Reason::none;
  verdict.probability = probability;
  return verdict;
}

Hash hash_of(int number) { return Hasher().add(static_cast<std::int64_t>(number)).finish(); }

void expect(const Verdict& verdict, Decision decision, Reason reason) {
  EXPECT_EQ(to_text(verdict.decision), to_text(decision));
  EXPECT_EQ(to_text(verdict.reason), to_text(reason));
}

TEST(Verdict, of_two_maps_that_share_nothing_is_refused_for_little_overlap) {
  expect(pair_of(), Decision::refused, Reason::little_overlap);
}

TEST(Verdict, of_a_judgement_in_doubt_keeps_the_doubt_and_stays_open_where_more_can_be_seen) {
  Judgement judgement;
  judgement.probability = 0.4;
  const auto doubted = [&](Reason doubt) {
    judgement.doubt = doubt;
    Verdict verdict = pair_of();
    doubt_as(verdict, judgement, 0.25);
    EXPECT_EQ(verdict.probability, 0.4);
    EXPECT_EQ(verdict.overlap, 0.25);
    return verdict;
  };
  expect(doubted(Reason::ambiguous), Decision::deferred, Reason::ambiguous);
  expect(doubted(Reason::unobservable), Decision::deferred, Reason::unobservable);
  expect(doubted(Reason::contradiction), Decision::refused, Reason::contradiction);
  expect(doubted(Reason::none), Decision::refused, Reason::too_few_witnesses);
}

// By cameras.
Verdict decided(const VisualSupport& support) {
  Verdict verdict = pair_of();
  decide_by_cameras(verdict, support, FusionOptions{});
  return verdict;
}

TEST(Verdict, of_cameras_needs_two_witnesses_or_one_that_is_sure) {
  expect(decided({2, 0, 0.0, {}}), Decision::accepted, Reason::none);
  expect(decided({1, 0, 0.0, {}}), Decision::deferred, Reason::too_few_witnesses);
  expect(decided({1, 0, 0.0, 0.99}), Decision::deferred, Reason::too_few_witnesses);
  expect(decided({1, 0, 0.0, 0.9995}), Decision::accepted, Reason::none);
}

TEST(Verdict, of_cameras_is_ambiguous_beside_a_heavy_rival_or_a_few_far_ones) {
  expect(decided({10, 0, FusionOptions{}.max_rival + 0.01, {}}), Decision::deferred, Reason::ambiguous);
  expect(decided({24, 2, 0.0, {}}), Decision::deferred, Reason::ambiguous);
  expect(decided({25, 2, 0.0, {}}), Decision::accepted, Reason::none);
  expect(decided({2, 1, 0.0, {}}), Decision::accepted, Reason::none);
}

TEST(Verdict, that_rests_on_what_repeats_is_ambiguous_and_names_each_judgement_once) {
  Verdict verdict = accepted("vision", 0.99);
  doubt_as_repeated(verdict, {hash_of(1), hash_of(2), hash_of(1)});
  doubt_as_repeated(verdict, {hash_of(2)});
  expect(verdict, Decision::deferred, Reason::ambiguous);
  EXPECT_EQ(verdict.contradicted.size(), 2U);
}

TEST(Verdict, of_lasers_is_open_while_more_walls_speak_for_a_merge_than_against_it) {
  const FusionOptions options;
  const auto doubted = [&](LaserDoubt doubt, double unique_m, double contradicted_m) {
    doubt.unique_m = unique_m;
    WallAgreement walls;
    walls.contradicted_m = contradicted_m;
    Verdict verdict = pair_of("laser");
    doubt_by_lasers(verdict, doubt, walls, options);
    return verdict;
  };
  expect(doubted({2.0, 0.88, 0.0, false}, 10.0, 0.0), Decision::deferred, Reason::little_evidence);
  expect(doubted({2.0, 0.88, 0.5, false}, 10.0, 0.0), Decision::deferred, Reason::ambiguous);
  expect(doubted({2.0, 0.88, 0.0, true}, 10.0, 0.0), Decision::deferred, Reason::ambiguous);
  expect(doubted({-2.0, 0.1, 0.0, false}, 10.0, 2.0), Decision::deferred, Reason::little_evidence);
  expect(doubted({-2.0, 0.1, 0.0, false}, 10.0, 3.0), Decision::refused, Reason::contradiction);
  expect(doubted({-2.0, 0.1, 0.0, false, true}, 10.0, 2.0), Decision::refused, Reason::other_widths);
}

TEST(Verdict, of_grids_that_a_third_one_contradicts_stays_open) {
  const auto refused = [](Reason doubt, bool is_vetoed) {
    Verdict verdict = pair_of("grid");
    refuse_grids(verdict, doubt, is_vetoed);
    return verdict;
  };
  expect(refused(Reason::none, false), Decision::deferred, Reason::inconsistent);
  expect(refused(Reason::none, true), Decision::refused, Reason::vetoed);
  expect(refused(Reason::ambiguous, false), Decision::deferred, Reason::ambiguous);
  expect(refused(Reason::contradiction, false), Decision::refused, Reason::contradiction);
}

// Fails where a check is asked that decides nothing.
SenseChecks checks_of_nothing() {
  SenseChecks checks;
  checks.do_lie_alike = [] {
    ADD_FAILURE() << "only one sense merged them";
    return true;
  };
  checks.wall_conflict = [] {
    ADD_FAILURE() << "cameras alone did not merge them";
    return 0.0;
  };
  checks.do_cameras_contradict = [] {
    ADD_FAILURE() << "lasers alone did not merge them";
    return false;
  };
  return checks;
}

TEST(Verdict, of_two_senses_that_mean_different_places_is_ambiguous) {
  SenseChecks checks = checks_of_nothing();
  checks.do_lie_alike = [] { return true; };
  const Verdict both = combined(accepted("laser", 0.9), accepted("vision", 0.8), checks, {});
  expect(both, Decision::accepted, Reason::none);
  EXPECT_NEAR(both.probability, 0.98, 1e-12);
  EXPECT_EQ(both.kind, "laser and vision");
  checks.do_lie_alike = [] { return false; };
  expect(combined(accepted("laser", 0.9), accepted("vision", 0.8), checks, {}), Decision::deferred, Reason::ambiguous);
}

TEST(Verdict, of_two_senses_has_the_hypotheses_of_both_those_that_decided_first) {
  Verdict laser = accepted("laser", 0.9), seen = accepted("vision", 0.8);
  laser.hypotheses.resize(kMostPairHypotheses);
  seen.hypotheses.resize(2);
  for (PairHypothesis& hypothesis : seen.hypotheses) hypothesis.sense = Sense::cameras;
  SenseChecks checks = checks_of_nothing();
  checks.do_lie_alike = [] { return true; };
  const Verdict both = combined(laser, seen, checks, {});
  ASSERT_EQ(both.hypotheses.size(), kMostPairHypotheses);
  EXPECT_EQ(both.hypotheses.front().sense, Sense::lasers);
  EXPECT_EQ(both.hypotheses.back().sense, Sense::cameras);
  laser.decision = Decision::refused;
  checks.wall_conflict = [] { return 0.0; };
  const Verdict by_cameras = combined(laser, seen, checks, {});
  ASSERT_EQ(by_cameras.hypotheses.size(), kMostPairHypotheses);
  EXPECT_EQ(by_cameras.hypotheses.front().sense, Sense::cameras);
  EXPECT_EQ(by_cameras.hypotheses.back().sense, Sense::lasers);
}

TEST(Verdict, of_cameras_is_refused_where_lasers_saw_through_walls) {
  const FusionOptions options;
  SenseChecks checks = checks_of_nothing();
  checks.wall_conflict = [&] { return options.max_wall_conflict - 0.01; };
  expect(combined(pair_of("laser"), accepted("vision", 0.9), checks, options), Decision::accepted, Reason::none);
  checks.wall_conflict = [&] { return options.max_wall_conflict + 0.01; };
  expect(combined(pair_of("laser"), accepted("vision", 0.9), checks, options), Decision::refused,
         Reason::contradiction);
}

TEST(Verdict, of_lasers_is_refused_where_cameras_do_not_know_the_place) {
  SenseChecks checks = checks_of_nothing();
  checks.do_cameras_contradict = [] { return false; };
  expect(combined(accepted("laser", 0.9), pair_of(), checks, {}), Decision::accepted, Reason::none);
  checks.do_cameras_contradict = [] { return true; };
  expect(combined(accepted("laser", 0.9), pair_of(), checks, {}), Decision::refused, Reason::contradiction);
}

TEST(Verdict, of_two_senses_that_both_refuse_is_the_lasers) {
  Verdict laser = pair_of("laser");
  refuse_by_audit(laser);
  expect(combined(laser, pair_of(), checks_of_nothing(), {}), Decision::refused, Reason::contradiction);
}

}  // namespace
}  // namespace mapweave::fusion
