#include "damage.h"
#include "messages.h"

#include <mapweave/maps/merged_maps.h>

#include <gmock/gmock.h>

namespace mapweave {
namespace {

using test::hash_of;
using test::merged_maps;

TEST(MergedMaps, come_back_as_they_were) {
  const MergedMaps sent = merged_maps(), back = decode_merged_maps(encode(sent), "test");
  EXPECT_EQ(back.members, sent.members);
  ASSERT_EQ(back.merges.size(), 2U);
  EXPECT_EQ(back.merges[1].other, sent.merges[1].other);
  EXPECT_EQ(back.merges[0].proposer, "corners");
  EXPECT_EQ(back.merges[0].probability, 0.75);
  ASSERT_EQ(back.matches.size(), 1U);
  EXPECT_EQ(back.matches[0].from, sent.matches[0].from);
  EXPECT_TRUE(std::signbit(back.matches[0].from_from_to.y)) << "bit for bit";
  EXPECT_EQ(back.matches[0].information, sent.matches[0].information);
  EXPECT_FALSE(back.matches[0].is_observable);
  EXPECT_TRUE(back.matches[0].overrules_own);
  EXPECT_EQ(back.judgements[0].id, hash_of(7));
  EXPECT_EQ(back.constraints[0].id, sent.constraints[0].id);
  EXPECT_EQ(encode(back), encode(sent));
}

TEST(MergedMaps, that_cannot_be_are_refused) {
  const auto refuses = [](const std::function<void(MergedMaps&)>& spoil) {
    MergedMaps merged = merged_maps();
    spoil(merged);
    EXPECT_THROW(encode(merged), ContractViolation);
  };
  refuses([](MergedMaps& merged) { merged.members = {MapId("alpha")}; });
  refuses([](MergedMaps& merged) { std::swap(merged.members[0], merged.members[1]); });
  refuses([](MergedMaps& merged) { merged.merges[0].other = {MapId("delta")}; });
  refuses([](MergedMaps& merged) { merged.merges[0].other = merged.merges[0].one; });
  refuses([](MergedMaps& merged) { merged.merges[0].proposer = "two\nlines"; });
  refuses([](MergedMaps& merged) { merged.judgements.clear(); });
  refuses([](MergedMaps& merged) { merged.matches[0].information(0, 0) = -1.0; });
  refuses([](MergedMaps& merged) { merged.matches[0].from_from_to.x = std::nan(""); });
  refuses([](MergedMaps& merged) { merged.matches[0].probability = 1.5; });
  refuses([](MergedMaps& merged) { merged.constraints.push_back(merged.constraints.front()); });
  const auto decode = [](const std::string& bytes) { return decode_merged_maps(bytes, "test"); };
  EXPECT_GT(test::refused_of_damaged(encode(merged_maps()), decode), 300);
}

}  // namespace
}  // namespace mapweave
