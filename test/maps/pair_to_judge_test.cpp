#include "damage.h"
#include "messages.h"

#include <mapweave/maps/pair_to_judge.h>

#include <gmock/gmock.h>
#include <limits>

namespace mapweave {
namespace {

using test::some_pairs;

TEST(PairToJudge, comes_back_as_it_was) {
  const auto sent = some_pairs(), back = decode_pairs_to_judge(encode(sent), "test");
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[0].a, MapId("alpha"));
  EXPECT_TRUE(back[0].have_cameras);
  ASSERT_EQ(back[0].submaps.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    const SubmapsToJudge &one = back[0].submaps[i], &other = sent[0].submaps[i];
    EXPECT_EQ(one.a, other.a);
    EXPECT_EQ(one.b, other.b);
    EXPECT_EQ(one.a_from_b.phi, other.a_from_b.phi);
    EXPECT_EQ(one.radius_m, other.radius_m);
    EXPECT_EQ(one.yaw_rad, other.yaw_rad);
    EXPECT_EQ(one.known_part, other.known_part);
  }
  EXPECT_TRUE(std::signbit(back[0].submaps[1].a_from_b.x)) << "bit for bit";
  EXPECT_TRUE(back[1].submaps.empty());
  EXPECT_EQ(encode(back), encode(sent));
}

TEST(PairToJudge, refuses_what_cannot_be) {
  auto pairs = some_pairs();
  pairs[0].submaps[0].a_from_b.x = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(encode(pairs), ContractViolation);
  pairs = some_pairs();
  pairs[0].submaps[1].radius_m = -1.0;
  EXPECT_THROW(encode(pairs), ContractViolation);
  pairs = some_pairs();
  pairs[1].b = MapId();
  EXPECT_THROW(encode(pairs), ContractViolation);
  const auto decode = [](const std::string& bytes) { return decode_pairs_to_judge(bytes, "test"); };
  EXPECT_GT(test::refused_of_damaged(encode(some_pairs()), decode), 300);
}

}  // namespace
}  // namespace mapweave
