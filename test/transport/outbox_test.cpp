#include <mapweave/core/error.h>
#include <mapweave/transport/outbox.h>

#include <gmock/gmock.h>

namespace mapweave::transport {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::vector<std::string> due(Outbox& outbox) {
  std::vector<std::string> bytes;
  for (const Envelope& one : outbox.take_due()) bytes.push_back(one.bytes);
  return bytes;
}

TEST(MemoryOutbox, keeps_what_nobody_has_confirmed_and_sends_it_once) {
  MemoryOutbox outbox(10);
  outbox.append({"update", "alpha1", "alpha", 1});
  EXPECT_TRUE(outbox.has_room());
  outbox.append({"update", "beta1", "beta", 1});
  EXPECT_FALSE(outbox.has_room());
  EXPECT_EQ(outbox.bytes(), 11U);
  EXPECT_THAT(due(outbox), ElementsAre("alpha1", "beta1"));
  EXPECT_THAT(due(outbox), IsEmpty()) << "they are in flight";
  outbox.append({"update", "alpha2", "alpha", 2});
  EXPECT_THAT(due(outbox), ElementsAre("alpha2"));
  outbox.forget("alpha", 1);
  EXPECT_EQ(outbox.bytes(), 11U);
  outbox.forget("gamma", 9);
  outbox.forget("alpha", 1);
  EXPECT_EQ(outbox.bytes(), 11U) << "again, or of another, is nothing";
}

TEST(MemoryOutbox, repeats_what_is_awaited_and_all_after_a_break) {
  MemoryOutbox outbox(1000);
  for (std::uint64_t i = 1; i <= 4; ++i) outbox.append({"update", std::to_string(i), "alpha", i});
  outbox.take_due();
  outbox.repeat("alpha", 3);
  outbox.repeat("beta", 2);
  EXPECT_THAT(due(outbox), ElementsAre("3"));
  outbox.forget("alpha", 2);
  outbox.repeat_all();
  EXPECT_THAT(due(outbox), ElementsAre("3", "4"));
  EXPECT_THROW(outbox.append({"view", "unnumbered"}), ContractViolation);
}

}  // namespace
}  // namespace mapweave::transport
