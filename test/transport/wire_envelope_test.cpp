#include <mapweave/core/error.h>
#include <mapweave/core/mixed_bits.h>
#include <mapweave/transport/reassembly.h>

#include <gmock/gmock.h>

#include <algorithm>

namespace mapweave::transport {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

std::string noise(std::size_t size, std::uint64_t seed = 1) {
  std::string bytes(size, '\0');
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>(mixed(seed + i));
  return bytes;
}

WireMessage message_of(std::string bytes, std::uint64_t number = 1, std::size_t part_bytes = 4096) {
  return {{"update", std::move(bytes), "alpha", 7}, WireKind::message, 2, 99, number, part_bytes};
}

std::vector<std::string> parts_of(const WireMessage& message) {
  std::vector<std::string> parts;
  for (std::uint32_t i = 0; i < message.header().parts; ++i) {
    parts.push_back(message.part(i));
    EXPECT_EQ(parts.back().size(), message.part_size(i));
  }
  return parts;
}

std::optional<WireRefusal> refusal_of(std::string_view bytes) {
  const auto decoded = decode_part(bytes);
  const auto* refusal = std::get_if<WireRefusal>(&decoded);
  return refusal == nullptr ? std::nullopt : std::make_optional(*refusal);
}

TEST(WireEnvelope, says_in_every_part_what_was_sent) {
  const WireMessage message = message_of(noise(10'000));
  ASSERT_EQ(message.header().parts, 3U);
  std::string bytes;
  for (const std::string& encoded : parts_of(message)) {
    EXPECT_LE(encoded.size(), 4096U);
    const auto decoded = decode_part(encoded);
    const auto* part = std::get_if<WirePart>(&decoded);
    ASSERT_NE(part, nullptr);
    EXPECT_EQ(part->subject, "update");
    EXPECT_EQ(part->sender, "alpha");
    EXPECT_EQ(part->sequence, 7U);
    EXPECT_EQ(part->header.session, 99U);
    EXPECT_EQ(part->header.priority, 2U);
    EXPECT_FALSE(part->last_counts);
    bytes += part->bytes;
  }
  EXPECT_EQ(bytes, noise(10'000));
  EXPECT_EQ(message_of("").header().parts, 1U);
  EXPECT_FALSE(refusal_of(message_of("").part(0)));
}

TEST(WireEnvelope, refuses_what_is_cut_short_or_cannot_be) {
  const std::string whole = message_of("some bytes").part(0);
  for (std::size_t size = 0; size < whole.size(); ++size) EXPECT_TRUE(refusal_of(whole.substr(0, size))) << size;
  EXPECT_EQ(refusal_of(whole + "x"), WireRefusal::impossible_part);
  const auto changed = [&](std::size_t at, char to) {
    std::string bytes = whole;
    bytes[at] = to;
    return refusal_of(bytes);
  };
  EXPECT_EQ(changed(0, 'N'), WireRefusal::not_an_envelope);
  EXPECT_EQ(changed(4, 2), WireRefusal::unknown_version);
  EXPECT_EQ(changed(5, 3), WireRefusal::impossible_part) << "kind";
  EXPECT_EQ(changed(16, 0), WireRefusal::impossible_part) << "no number";
  EXPECT_EQ(changed(32, 1), WireRefusal::impossible_part) << "a part too many";
  EXPECT_EQ(changed(36, 0), WireRefusal::impossible_part) << "no parts";
  EXPECT_EQ(changed(45, 4), WireRefusal::too_long) << "a subject of 1 kB";
  EXPECT_EQ(changed(46, 100), WireRefusal::not_an_envelope) << "a sender beyond its end";
  EXPECT_EQ(refusal_of(whole + std::string(kMostPartBytes, 'x')), WireRefusal::too_long);
  EXPECT_THROW(WireMessage({std::string(513, 's'), ""}, WireKind::message, 0, 1, 1, 4096), ContractViolation);
}

class Receiver : public testing::Test {
 protected:
  Reassembly::Result add(const std::string& part, const std::string& tag = "t", const std::string& from = "robot") {
    return reassembly_.add(from, part, tag, now_s_);
  }
  // Each reassembly begins with the same limits.
  void limit(const ReassemblyLimits& limits) { reassembly_ = Reassembly(limits); }

  Reassembly reassembly_{ReassemblyLimits{}};
  double now_s_ = 1.0;
};

TEST_F(Receiver, makes_a_message_of_parts_in_any_order_and_twice) {
  const auto parts = parts_of(message_of(noise(10'000)));
  EXPECT_FALSE(add(parts[2], "c").message);
  EXPECT_FALSE(add(parts[0], "a").message);
  EXPECT_FALSE(add(parts[2], "c2").message);
  EXPECT_GT(reassembly_.waiting_bytes(), 6000U);
  EXPECT_THAT(reassembly_.tags(), ElementsAre("a", "c2"));
  const auto result = add(parts[1], "b");
  ASSERT_TRUE(result.message);
  EXPECT_EQ(result.message->envelope.bytes, noise(10'000));
  EXPECT_EQ(result.message->envelope.sequence, 7U);
  EXPECT_THAT(result.message->tags, ElementsAre("a", "b", "c2"));
  EXPECT_EQ(reassembly_.waiting_bytes(), 0U);
}

TEST_F(Receiver, refuses_wrong_bytes_and_counts_why) {
  const auto parts = parts_of(message_of(noise(10'000)));
  std::string damaged = parts[1];
  damaged.back() = static_cast<char>(damaged.back() ^ 1);
  add(parts[0], "a");
  add(damaged, "b");
  const auto result = add(parts[2], "c");
  EXPECT_EQ(result.refusal, WireRefusal::wrong_hash);
  EXPECT_THAT(result.given_up, testing::UnorderedElementsAre("a", "b", "c"));
  EXPECT_EQ(reassembly_.refused(WireRefusal::wrong_hash), 1U);
  EXPECT_EQ(reassembly_.waiting_bytes(), 0U);
  for (const std::string& part : parts) EXPECT_FALSE(add(part).refusal) << "the right ones are taken then";

  add(parts[0], "a");
  std::string other = parts[1];
  other[40] = static_cast<char>(other[40] + 1);
  EXPECT_EQ(add(other, "x").refusal, WireRefusal::contradiction) << "of another length";
  EXPECT_TRUE(add(message_of("another of the same number").part(0), "y").message) << "does not end the first";
  EXPECT_EQ(add("text", "y").refusal, WireRefusal::not_an_envelope);
  EXPECT_THAT(add("text", "y").given_up, ElementsAre("y"));
  EXPECT_EQ(reassembly_.refused(WireRefusal::not_an_envelope), 2U);
  EXPECT_STREQ(to_text(WireRefusal::not_an_envelope), "it is no envelope, or cut short");
}

TEST_F(Receiver, believes_no_byte_that_was_changed_on_its_path) {
  const std::string whole = message_of("some bytes that matter").part(0);
  for (std::size_t at = 0; at < whole.size(); ++at)
    for (const int bit : {0, 3, 7}) {
      std::string changed = whole;
      changed[at] = static_cast<char>(changed[at] ^ (1 << bit));
      EXPECT_FALSE(add(changed).message) << at;
      reassembly_ = Reassembly(ReassemblyLimits{});
    }
}

TEST_F(Receiver, gives_up_half_a_message_after_a_time) {
  const auto parts = parts_of(message_of(noise(10'000)));
  add(parts[0], "a");
  EXPECT_THAT(reassembly_.expire(60.0), IsEmpty());
  EXPECT_THAT(reassembly_.expire(62.0), ElementsAre("a"));
  EXPECT_EQ(reassembly_.refused(WireRefusal::incomplete), 1U);
  EXPECT_EQ(reassembly_.waiting_bytes(), 0U);
}

TEST_F(Receiver, keeps_its_memory_within_bounds) {
  ReassemblyLimits limits;
  limits.message_bytes = 50'000;
  limits.waiting_bytes = 100'000;
  limits.bytes_per_s = limits.parts_per_s = 0.0;
  limits.waiting_messages = 8;
  limit(limits);
  for (std::uint64_t number = 1; number <= 500; ++number) {
    const WireMessage message = message_of(noise(45'000, number), number);
    for (std::uint32_t i = 0; i + 1 < message.header().parts; ++i) add(message.part(i));
    EXPECT_LE(reassembly_.waiting_bytes(), 100'000U);
    now_s_ += 0.01;
  }
  EXPECT_GT(reassembly_.refused(WireRefusal::incomplete), 490U);
  EXPECT_EQ(add(message_of(noise(60'000), 900).part(0)).refusal, WireRefusal::too_long);
  const auto parts = parts_of(message_of(noise(45'000), 901));
  for (std::size_t i = 0; i + 1 < parts.size(); ++i) EXPECT_FALSE(add(parts[i]).message);
  EXPECT_TRUE(add(parts.back()).message) << "the longest has room in the end";
}

TEST_F(Receiver, slows_a_flood_without_harm_to_others) {
  ReassemblyLimits limits;
  limits.bytes_per_s = 10'000;
  limits.burst_s = 2.0;
  limits.senders = 3;
  limit(limits);
  const std::string part = message_of(noise(1000)).part(0);
  int taken = 0;
  for (int i = 0; i < 1000; ++i) taken += add(part, "t", "stranger").message ? 1 : 0;
  EXPECT_EQ(taken, static_cast<int>(20'000 / part.size()));
  EXPECT_EQ(reassembly_.refused(WireRefusal::too_fast), 1000U - static_cast<std::uint64_t>(taken));
  EXPECT_TRUE(add(part, "t", "robot").message);
  now_s_ += 1.0;
  EXPECT_TRUE(add(part, "t", "stranger").message) << "a second later";
  EXPECT_TRUE(add(part, "t", "third").message);
  EXPECT_EQ(add(part, "t", "fourth").refusal, WireRefusal::too_many_senders);
  now_s_ += 10.0;
  EXPECT_TRUE(add(part, "t", "fourth").message) << "others are silent since long";
}

TEST_F(Receiver, takes_anything_without_trouble) {
  const auto parts = parts_of(message_of(noise(9000)));
  std::uint64_t drawn = 0;
  const auto below = [&](std::size_t end) { return static_cast<std::size_t>(mixed(++drawn) % end); };
  std::size_t complete = 0;
  for (int i = 0; i < 20'000; ++i) {
    std::string part = parts[below(parts.size())];
    for (std::size_t k = below(3); k > 0; --k)
      part[below(std::min<std::size_t>(part.size(), 120))] = static_cast<char>(drawn);
    if (below(4) == 0) part.resize(below(part.size()));
    if (const auto result = add(part); result.message) {
      EXPECT_EQ(result.message->envelope.bytes, noise(9000));
      ++complete;
    }
    now_s_ += 0.001;
    reassembly_.expire(now_s_);
  }
  EXPECT_GT(complete, 10U);
  EXPECT_LE(reassembly_.waiting_bytes(), ReassemblyLimits{}.waiting_bytes);
}

}  // namespace
}  // namespace mapweave::transport
