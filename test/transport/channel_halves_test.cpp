// Both halves of a channel over a broker, without one.
#include <mapweave/core/error.h>
#include <mapweave/core/mixed_bits.h>
#include <mapweave/transport/channel_receiver.h>
#include <mapweave/transport/channel_sender.h>

#include <gmock/gmock.h>

#include <map>

namespace mapweave::transport {
namespace {

using Sent = Channel::Sent;
using Outcome = Publication::Outcome;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr std::uint64_t kSession = 77;

Envelope message(std::string bytes, const std::string& subject = "update") { return {subject, std::move(bytes)}; }

// A stream for each class, in memory, with a reader of each: what a broker does, and what can go wrong with it.
struct Broker {
  struct Stored {
    std::string bytes, id;
    bool is_acknowledged = false;
  };
  std::vector<std::vector<Stored>> streams;
  explicit Broker(std::size_t classes) : streams(classes) {}

  Publication store(const ChannelSender::MessagePart& part) {
    auto& stream = streams[part.priority];
    for (std::size_t i = 0; i < stream.size(); ++i)
      if (stream[i].id == part.message_id) return {Outcome::stored, i + 1, true, {}};
    stream.push_back({part.bytes, part.message_id});
    return {Outcome::stored, stream.size(), false, {}};
  }
  static std::string reply(std::size_t priority, std::size_t index) {
    return std::to_string(priority) + "." + std::to_string(index);
  }
  void acknowledge(const std::string& reply) {
    const std::size_t dot = reply.find('.');
    streams.at(std::stoul(reply)).at(std::stoul(reply.substr(dot + 1))).is_acknowledged = true;
  }
  std::uint64_t floor(std::size_t priority) const {
    std::uint64_t number = 0;
    for (const Stored& one : streams[priority]) {
      if (!one.is_acknowledged) break;
      ++number;
    }
    return number;
  }
};

class Halves : public testing::Test {
 protected:
  void SetUp() override {
    sender.begin(kSession);
    sender.put({"", "nonce"}, 0, WireKind::opens);
  }
  static ChannelSenderOptions sender_options() {
    ChannelSenderOptions options;
    options.priorities = 2;
    options.limits = {1 << 20, 64};
    return options;
  }
  static ChannelReceiverOptions receiver_options() {
    ChannelReceiverOptions options;
    options.accepts = true;
    options.priorities = 2;
    return options;
  }
  // All that can be published now is stored.
  void publish() {
    while (auto part = sender.next(now_s)) sender.published(part->token, broker.store(*part), now_s);
  }
  void deliver(std::size_t priority, std::size_t index) {
    receiver.add(priority, broker.streams[priority][index].bytes, Broker::reply(priority, index), now_s);
  }
  void deliver_all(std::size_t priority) {
    for (std::size_t i = 0; i < broker.streams[priority].size(); ++i) deliver(priority, i);
  }
  std::vector<std::string> received(bool acknowledges = true) {
    std::vector<std::string> bytes;
    for (const auto& one : receiver.take()) {
      bytes.push_back(one.envelope.bytes);
      if (acknowledges) receiver.acknowledge(one.number);
    }
    return bytes;
  }
  void settle() {
    for (const std::string& reply : receiver.take_acknowledged()) broker.acknowledge(reply);
    for (std::size_t priority = 0; priority < 2; ++priority)
      sender.acknowledged(priority, broker.floor(priority), now_s);
  }

  double now_s = 1.0;
  ChannelSender sender{sender_options()};
  ChannelReceiver receiver{receiver_options()};
  Broker broker{2};
};

TEST_F(Halves, carry_messages_in_order_and_make_room) {
  EXPECT_EQ(sender.put(message("one"), 1), Sent::taken);
  EXPECT_EQ(sender.put(message("urgent"), 0), Sent::taken);
  EXPECT_EQ(sender.put(message(std::string(2 << 20, 'x')), 1), Sent::never);
  EXPECT_EQ(sender.put(message(std::string((1 << 20) - 5, 'x')), 1), Sent::later);
  EXPECT_EQ(sender.bytes(), 14U) << "with what opens";
  EXPECT_FALSE(sender.is_idle());
  publish();
  EXPECT_TRUE(sender.is_idle());
  EXPECT_EQ(broker.streams[0].size(), 2U);
  deliver_all(1);
  EXPECT_THAT(received(), IsEmpty()) << "nobody has opened the session yet";
  deliver_all(0);
  EXPECT_EQ(receiver.session(), kSession);
  const auto messages = receiver.take();
  ASSERT_EQ(messages.size(), 2U);
  settle();
  EXPECT_EQ(sender.bytes(), 9U);
  receiver.acknowledge(messages[0].number);
  receiver.acknowledge(messages[0].number);
  receiver.acknowledge(messages[1].number);
  settle();
  EXPECT_EQ(sender.bytes(), 0U);
  EXPECT_EQ(receiver.bytes(), 0U);
}

TEST_F(Halves, send_what_is_urgent_first_and_little_at_once) {
  for (int i = 0; i < 10; ++i) sender.put(message(std::string(60'000, 'x')), 1);
  std::size_t flying = 0;
  std::vector<ChannelSender::MessagePart> parts;
  while (auto part = sender.next(now_s)) {
    flying += part->bytes.size();
    parts.push_back(*part);
  }
  EXPECT_LT(flying, 200'000U) << "before the link was measured";
  sender.put(message("pose"), 0);
  sender.published(parts[0].token, broker.store(parts[0]), now_s);
  sender.published(parts[1].token, broker.store(parts[1]), now_s);
  const auto next = sender.next(now_s);
  ASSERT_TRUE(next);
  EXPECT_EQ(next->priority, 0U) << "although the others wait for longer";
}

TEST_F(Halves, keep_the_last_of_what_was_not_begun) {
  for (const char* bytes : {"a", "bb", "ccc"}) EXPECT_EQ(sender.put({"receipts", bytes, "m", 0, true}, 0), Sent::taken);
  EXPECT_EQ(sender.put({"receipts", "other", "n", 0, true}, 0), Sent::taken);
  publish();
  EXPECT_EQ(sender.put({"receipts", "d", "m", 0, true}, 0), Sent::taken);
  publish();
  deliver_all(0);
  EXPECT_THAT(received(), ElementsAre("ccc", "other", "d"));
}

TEST_F(Halves, hold_a_full_stream_up_and_try_again) {
  sender.put(message("one"), 1);
  auto part = sender.next(now_s);
  sender.published(part->token, broker.store(*part), now_s);
  part = sender.next(now_s);
  sender.published(part->token, {Outcome::full, 0, false, "maximum bytes exceeded"}, now_s);
  EXPECT_FALSE(sender.next(now_s)) << "held up";
  EXPECT_EQ(sender.full_since_s(), now_s);
  EXPECT_EQ(sender.trouble(), "maximum bytes exceeded");
  now_s += 1.0;
  publish();
  EXPECT_TRUE(sender.is_idle());
  EXPECT_FALSE(sender.full_since_s());
  EXPECT_EQ(sender.trouble(), "");
}

TEST_F(Halves, send_again_what_a_lost_stream_held) {
  sender.put(message("one"), 1);
  sender.put(message("two"), 1);
  publish();
  deliver_all(0);
  deliver(1, 0);
  EXPECT_THAT(received(), ElementsAre("one"));
  settle();
  broker.streams[1].clear();  // deleted, and made again by whomever
  sender.put(message("three"), 1);
  publish();
  EXPECT_EQ(broker.streams[1].size(), 2U);
  deliver_all(1);
  EXPECT_THAT(received(), testing::UnorderedElementsAre("two", "three"));
}

TEST_F(Halves, give_up_what_never_comes_and_take_it_late) {
  for (const char* bytes : {"one", "two", "three"}) sender.put(message(bytes), 1);
  publish();
  deliver_all(0);
  deliver(1, 0);
  deliver(1, 2);
  EXPECT_THAT(received(), ElementsAre("one"));
  receiver.tick(now_s += 40.0);
  EXPECT_THAT(received(), IsEmpty());
  receiver.tick(now_s += 40.0);
  EXPECT_THAT(received(), ElementsAre("three"));
  EXPECT_EQ(receiver.counts().skipped, 1U);
  deliver(1, 1);
  deliver(1, 1);
  EXPECT_THAT(received(), ElementsAre("two")) << "late, but not lost";
}

TEST_F(Halves, survive_any_loss_repetition_and_disorder) {
  std::uint64_t drawn = 3;
  const auto below = [&](std::size_t end) { return static_cast<std::size_t>(mixed(++drawn) % end); };
  std::vector<std::string> sent[2], got[2];
  for (int round = 0; round < 4000 || sent[0].size() + sent[1].size() > got[0].size() + got[1].size(); ++round) {
    ASSERT_LT(round, 40'000);
    now_s += 0.05;
    const std::size_t priority = below(2);
    const std::string bytes = std::to_string(priority) + std::string(below(150'000), 'x') + std::to_string(round);
    if (round < 4000 && sender.put(message(bytes, priority == 0 ? "pose" : "update"), priority) == Sent::taken)
      sent[priority].push_back(bytes);
    for (int i = 0; i < 3; ++i)
      if (auto part = sender.next(now_s)) {
        const std::size_t fate = below(20);
        if (fate == 0) continue;  // lost on its path
        const Publication stored = broker.store(*part);
        if (fate == 1) continue;  // its confirmation is lost
        if (fate == 2)
          sender.published(part->token, {Outcome::full, 0, false, "full"}, now_s);  // and yet stored, even
        else
          sender.published(part->token, stored, now_s);
      }
    if (below(40) == 0) sender.lost();
    sender.expire(now_s);
    for (std::size_t one = 0; one < 2; ++one) {
      const std::size_t floor = broker.floor(one), count = broker.streams[one].size();
      for (int i = 0; i < 6 && floor < count; ++i)
        deliver(one, floor + below(std::min<std::size_t>(count - floor, 64)));
    }
    for (const auto& one : receiver.take()) {
      got[one.envelope.subject == "pose" ? 0 : 1].push_back(one.envelope.bytes);
      receiver.acknowledge(one.number);
    }
    receiver.tick(now_s);
    for (const std::string& reply : receiver.take_acknowledged())
      if (below(10) > 0) broker.acknowledge(reply);
    EXPECT_THAT(receiver.take_refused(), IsEmpty());
    for (std::size_t one = 0; one < 2; ++one) sender.acknowledged(one, broker.floor(one), now_s);
  }
  EXPECT_EQ(receiver.counts().skipped, 0U);
  EXPECT_GT(sent[0].size(), 500U);
  for (std::size_t one = 0; one < 2; ++one) EXPECT_TRUE(got[one] == sent[one]) << "all, once, in order: class " << one;
}

TEST_F(Halves, end_when_the_other_end_closes_or_begins_again) {
  sender.put(message("last"), 1);
  sender.put({}, 0, WireKind::closes);
  publish();
  deliver_all(0);
  EXPECT_TRUE(receiver.is_closed());
  settle();

  ChannelReceiver second(receiver_options());
  ChannelSender again(sender_options());
  again.begin(kSession + 1);
  again.put({"", "another"}, 0, WireKind::opens);
  const WireMessage first({"", "nonce"}, WireKind::opens, 0, kSession, 1, 4096);
  second.add(0, first.part(0), "a", now_s);
  const WireMessage rest({"update", "rest"}, WireKind::message, 1, kSession, 1, 4096);
  second.add(1, rest.part(0), "b", now_s);
  EXPECT_EQ(second.take().size(), 1U);
  EXPECT_FALSE(second.is_closed());
  second.add(0, again.next(now_s)->bytes, "c", now_s);
  EXPECT_TRUE(second.is_closed()) << "its peer has opened another session";
  EXPECT_THAT(second.take_acknowledged(), ElementsAre("a", "b")) << "the new session stays for the next channel";
  EXPECT_THAT(second.held(), IsEmpty());
}

TEST_F(Halves, clear_away_what_older_sessions_left_when_they_end) {
  const auto part = [](WireKind kind, std::uint64_t session, std::uint64_t number) {
    return WireMessage({kind == WireKind::message ? "update" : "", "x"}, kind, 0, session, number, 4096).part(0);
  };
  for (const WireKind end : {WireKind::opens, WireKind::closes, WireKind::message}) {
    ChannelReceiver late(receiver_options());
    late.add(0, part(WireKind::message, 5, 9), "of a killed one", now_s);
    late.add(0, part(WireKind::opens, 6, 1), "opens", now_s);
    late.add(1, WireMessage({"update", "y"}, WireKind::message, 1, 7, 2, 4096).part(0), "of the next", now_s);
    late.add(1, WireMessage({"update", "y"}, WireKind::message, 1, 4, 2, 4096).part(0), "of another", now_s);
    EXPECT_FALSE(late.is_closed());
    if (end == WireKind::opens)
      late.add(0, part(WireKind::opens, 7, 1), "opens the next", now_s);
    else  // in its turn, or as its sender's program was started again
      late.add(0, part(WireKind::closes, 6, end == WireKind::closes ? 2 : kEndNumber), "closes", now_s);
    EXPECT_TRUE(late.is_closed());
    const auto acknowledged = late.take_acknowledged();
    EXPECT_THAT(acknowledged, testing::IsSupersetOf({"of a killed one", "opens"}));
    EXPECT_THAT(acknowledged, testing::Not(testing::Contains("of the next")));
    EXPECT_EQ(std::count(acknowledged.begin(), acknowledged.end(), "of another"), end == WireKind::opens ? 1 : 0);
  }
}

TEST_F(Halves, notice_that_the_other_program_was_started_again) {
  ChannelReceiverOptions options = receiver_options();
  options.accepts = false;
  options.session = kSession;
  ChannelReceiver opener(options);
  opener.add(0, WireMessage({"", "1"}, WireKind::opens, 0, kSession, 1, 4096).part(0), "a", now_s);
  opener.add(0, WireMessage({"", "1"}, WireKind::opens, 0, kSession, 1, 4096).part(0), "a2", now_s);
  EXPECT_FALSE(opener.is_closed());
  opener.add(0, WireMessage({"", "old"}, WireKind::message, 0, kSession - 1, 7, 4096).part(0), "old", now_s);
  EXPECT_EQ(opener.counts().stale, 1U);
  opener.add(0, WireMessage({"", "2"}, WireKind::opens, 0, kSession, 1, 4096).part(0), "b", now_s);
  EXPECT_TRUE(opener.is_closed());

  ChannelReceiver late(receiver_options());
  late.add(1, WireMessage({"update", "x"}, WireKind::message, 1, 5, 9, 4096).part(0), "c", now_s);
  late.tick(now_s + 1.0);
  EXPECT_THAT(late.held(), ElementsAre("c"));
  late.tick(now_s + 5.0);
  EXPECT_THAT(late.take_unknown_sessions(), ElementsAre(5U)) << "it began before this program";
  EXPECT_THAT(late.take_acknowledged(), ElementsAre("c"));
  ChannelReceiver other(options);
  other.add(0, WireMessage({"", "2"}, WireKind::closes, 0, kSession, kEndNumber, 4096).part(0), "d", now_s);
  EXPECT_TRUE(other.is_closed());
}

TEST_F(Halves, take_no_harm_from_impossible_numbers) {
  publish();
  deliver_all(0);
  const std::uint64_t far = std::uint64_t{1} << 60;
  receiver.add(1, WireMessage({"update", "x"}, WireKind::message, 1, kSession, far, 4096).part(0), "a", now_s);
  receiver.add(1, WireMessage({"update", "x"}, WireKind::message, 0, kSession, 2, 4096).part(0), "b", now_s);
  receiver.add(0, "no part at all", "c", now_s);
  receiver.tick(now_s + 100.0);
  EXPECT_THAT(received(), IsEmpty());
  EXPECT_THAT(receiver.take_refused(), ElementsAre("c"));
  EXPECT_EQ(receiver.refused(WireRefusal::not_an_envelope), 1U);
  sender.put(message("right"), 1);
  publish();
  deliver_all(1);
  EXPECT_THAT(received(), ElementsAre("right"));
}

TEST(BandwidthMeter, measures_a_link_only_while_it_is_busy) {
  BandwidthMeter meter;
  meter.sent(1000, 0.0);
  meter.confirmed(1000, 0.5);
  EXPECT_FALSE(meter.estimate()) << "a single message says nothing";
  for (int i = 0; i < 40; ++i) meter.sent(50'000, 10.0);
  for (int i = 1; i <= 40; ++i) meter.confirmed(50'000, 10.3 + 0.1 * i);
  ASSERT_TRUE(meter.estimate());
  EXPECT_NEAR(meter.estimate()->bytes_per_s, 500'000.0, 5'000.0) << "the first round trip does not count";
  EXPECT_NEAR(meter.estimate()->at_s, 14.3, 0.31);
  const double before = meter.estimate()->at_s;
  meter.sent(100, 1000.0);
  meter.confirmed(100, 1001.0);
  EXPECT_EQ(meter.estimate()->at_s, before) << "an idle link is not a slow one";
  meter.sent(400'000, 2000.0);
  meter.lost();
  meter.sent(400'000, 2100.0);
  for (int i = 0; i < 4; ++i) meter.confirmed(100'000, 2100.5 + 0.5 * i);
  EXPECT_LT(meter.estimate()->bytes_per_s, 400'000.0);
  EXPECT_GT(meter.estimate()->bytes_per_s, 200'000.0) << "an outage is not a slow link";
}

}  // namespace
}  // namespace mapweave::transport
