#include "fused_maps.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <support/carried_away.h>

namespace mapweave::fusion {
namespace {

using test::fused;

// Three robots of a long flat. The second one's map is right in the west; then it was carried to another building,
// which it has in the east, where the first one was, too. The third one never left the west.
const test::CarriedAway& team() {
  static const test::CarriedAway once;
  return once;
}

void expect_ghosts_where_it_is_wrong(const FusionResult& result) {
  int ghosts = 0;
  for (const PairAudit& audit : result.audits) {
    if (!audit.is_ghost) continue;
    ++ghosts;
    EXPECT_EQ(audit.a.str() + audit.b.str(), "robot0robot1");
    EXPECT_GT(audit.contradicted_m, 10.0);
    ASSERT_FALSE(audit.conflicts.empty());
    for (const PairAudit::Conflict& conflict : audit.conflicts)
      EXPECT_GT(compose(team().world_from_first, Pose2(conflict.x_m, conflict.y_m, 0.0)).x,
                test::CarriedAway::kWrongFrom_m - 4.0);
  }
  EXPECT_EQ(ghosts, 1);
}

TEST(TeamAudit, takes_a_map_apart_that_is_right_in_one_half_and_wrong_in_the_other) {
  // The prior is right, and lifts the doubt that rooms of the flat look alike.
  const FusionResult result =
      fused({team().maps[0], team().maps[1]}, {{MapId("robot0"), MapId("robot1"), team().first_from_second, 0.5, 0.1}});
  EXPECT_EQ(result.components.size(), 2U);
  ASSERT_EQ(result.verdicts.size(), 1U);
  EXPECT_EQ(result.verdicts[0].decision, Decision::refused);
  EXPECT_EQ(result.verdicts[0].reason, Reason::contradiction);
  EXPECT_GT(result.verdicts[0].conflict, 0.0);
  ASSERT_FALSE(result.verdicts[0].hypotheses.empty()) << "how they lay is reported";
  EXPECT_GT(result.verdicts[0].hypotheses[0].matches, 0U) << "they had been merged";
  expect_ghosts_where_it_is_wrong(result);
}

TEST(TeamAudit, leaves_the_same_robots_together_before_one_was_carried_away) {
  const FusionResult result = fused({team().maps[0], team().before});
  EXPECT_EQ(result.components.size(), 1U);
  for (const PairAudit& audit : result.audits) EXPECT_FALSE(audit.is_ghost);
}

TEST(TeamAudit, finds_a_ghost_amid_much_that_is_right) {
  const test::CarriedAway late(30.0);
  const FusionResult result =
      fused({late.maps[0], late.maps[1]}, {{MapId("robot0"), MapId("robot1"), late.first_from_second, 0.5, 0.1}});
  EXPECT_EQ(result.components.size(), 2U);
  expect_ghosts_where_it_is_wrong(result);
}

}  // namespace
}  // namespace mapweave::fusion
