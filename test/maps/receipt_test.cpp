#include "damage.h"
#include "messages.h"

#include <mapweave/maps/exchange.h>
#include <mapweave/maps/receipt.h>

#include <gmock/gmock.h>

namespace mapweave {
namespace {

using test::some_receipts;

TEST(Receipts, come_back_as_they_were) {
  const auto back = decode_receipts(encode(some_receipts()), "test");
  ASSERT_EQ(back.size(), 2U);
  EXPECT_EQ(back[0].origin.tier, TierId("north"));
  EXPECT_EQ(back[0].origin.map, MapId("alpha"));
  EXPECT_EQ(back[0].stored, 7U);
  EXPECT_EQ(back[0].awaited, 9U);
  EXPECT_TRUE(back[1].origin.tier.empty());
  EXPECT_EQ(encode(back), encode(some_receipts()));
  EXPECT_TRUE(decode_receipts(encode(std::vector<Receipt>{}), "test").empty()) << "nothing is stored";
}

TEST(Receipts, refuse_what_cannot_be) {
  EXPECT_THROW(encode(std::vector<Receipt>{{{TierId("north"), MapId()}, 1, 0}}), ContractViolation);
  EXPECT_THROW(encode(std::vector<Receipt>{{{TierId("north"), MapId("alpha")}, 3, 2}}), ContractViolation);
  EXPECT_THROW(decode_receipts(encode(Refusal{Error(ErrorCode::kBadInput, "no")}), "test"), Error);
  const auto decode = [](const std::string& bytes) { return decode_receipts(bytes, "test"); };
  EXPECT_GT(test::refused_of_damaged(encode(some_receipts()), decode), 100);
}

TEST(Refusal, says_why_with_where_and_remedy) {
  const Error why(ErrorCode::kUnsupported, "another vocabulary", "alpha/camera", "use the server's");
  const Refusal back = decode_refusal(encode(Refusal{why}), "test");
  EXPECT_EQ(back.why.code(), why.code());
  EXPECT_STREQ(back.why.what(), why.what());
  EXPECT_EQ(back.why.remedy(), why.remedy());
  const auto decode = [](const std::string& bytes) { return decode_refusal(bytes, "test"); };
  EXPECT_GT(test::refused_of_damaged(encode(Refusal{why}), decode), 50);
}

}  // namespace
}  // namespace mapweave
