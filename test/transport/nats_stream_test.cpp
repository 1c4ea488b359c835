#include <support/broker_fixture.h>

#include <mapweave/transport/nats_board.h>
#include <mapweave/transport/nats_stream.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <thread>

namespace mapweave::transport {
namespace {

using Outcome = Publication::Outcome;
using testing::ElementsAre;
using testing::HasSubstr;

StreamOptions stream_named(const std::string& name) { return {name, {"mw." + name + ".>"}, {}, 1 << 20, 120.0}; }

// Reads what a consumer delivers, one message after the other.
class Reader {
 public:
  Reader(const std::shared_ptr<NatsConnection>& connection, const ConsumerOptions& options)
      : consumer(connection, options),
        inbox_(connection->open_inbox(
            [came = came_](const NatsMessage& message) {
              if (message.subject.empty()) return;  // another connection
              const std::lock_guard lock(came->mutex);
              came->messages.push_back(message);
              came->changed.notify_all();
            },
            InboxKind::deliveries)) {}

  // The next message, which may be a status; without one in time an empty one.
  NatsMessage next(std::chrono::milliseconds patience = 10s) {
    std::unique_lock lock(came_->mutex);
    if (!came_->changed.wait_for(lock, patience, [&] { return !came_->messages.empty(); })) return {};
    NatsMessage message = came_->messages.front();
    came_->messages.pop_front();
    return message;
  }
  std::vector<std::string> take(int count, bool acknowledge = true) {
    EXPECT_TRUE(consumer.pull(inbox_->subject(), count, 10.0));
    std::vector<std::string> bytes;
    for (int i = 0; i < count; ++i) {
      const NatsMessage message = next();
      bytes.push_back(message.status == 0 ? message.bytes : std::to_string(message.status));
      if (acknowledge) consumer.acknowledge(message.reply);
    }
    return bytes;
  }
  const std::string& inbox() const { return inbox_->subject(); }

  NatsConsumer consumer;

 private:
  struct Came {
    std::mutex mutex;
    std::condition_variable changed;
    std::deque<NatsMessage> messages;
  };
  const std::shared_ptr<Came> came_ = std::make_shared<Came>();  // a call that has begun may outlive the inbox
  std::unique_ptr<NatsInbox> inbox_;
};

class NatsStreamTest : public WithBroker {};

TEST_F(NatsStreamTest, keeps_messages_and_what_was_acknowledged_over_a_kill) {
  Broker broker(options());
  const auto connection = connect(broker);
  NatsStream stream(connection, stream_named("north"));
  EXPECT_TRUE(stream.ensure(10s));
  EXPECT_FALSE(stream.ensure(10s)) << "it is there";
  NatsStream same(connection, stream.options());
  EXPECT_FALSE(same.ensure(10s));
  EXPECT_TRUE(connection->request("$JS.API.STREAM.DELETE." + stream.options().name, "", 10s));
  EXPECT_TRUE(same.ensure(10s));
  EXPECT_TRUE(stream.ensure(10s)) << "another than before";
  EXPECT_FALSE(stream.ensure(10s));
  for (const char* bytes : {"one", "two", "three"}) {
    EXPECT_EQ(stream.publish("mw.north.alpha", bytes, bytes, 10s).outcome, Outcome::stored);
    EXPECT_TRUE(stream.publish("mw.north.alpha", bytes, bytes, 10s).is_repetition) << "by its id";
  }
  Reader reader(connection, {"north", {}, "cloud", "mw.north.alpha"});
  EXPECT_TRUE(reader.consumer.ensure(10s));
  EXPECT_FALSE(reader.consumer.ensure(10s));
  EXPECT_THAT(reader.take(1), ElementsAre("one"));
  ASSERT_TRUE(soon([&] { return reader.consumer.state(10s)->acknowledged == 1; }));
  std::this_thread::sleep_for(300ms);  // what a server of 2.9 takes to write down what was acknowledged
  broker.kill();
  ASSERT_TRUE(soon([&] { return !connection->state().is_connected; }));
  broker.start();
  connection->wait_until_connected(20s);
  EXPECT_EQ(stream.state(10s)->messages, 3U);
  EXPECT_THAT(reader.take(2, false), ElementsAre("two", "three"));
  EXPECT_EQ(reader.consumer.state(10s)->acknowledged, 1U);
  reader.consumer.restart(10s);
  EXPECT_EQ(reader.consumer.state(10s)->acknowledged, 1U) << "still";
  EXPECT_THAT(reader.take(2), ElementsAre("two", "three")) << "at once, as nobody has acknowledged them";
}

TEST_F(NatsStreamTest, refuses_what_has_no_room_until_there_is_some) {
  Broker broker(options());
  const auto connection = connect(broker);
  NatsStream stream(connection, stream_named("north"));
  stream.ensure(10s);
  std::uint64_t count = 0;
  Publication last;
  while ((last = stream.publish("mw.north.alpha", std::string(100'000, 'x'), {}, 10s)).outcome == Outcome::stored)
    ++count;
  EXPECT_EQ(last.outcome, Outcome::full) << last.reason;
  EXPECT_EQ(count, 10U);
  EXPECT_EQ(stream.state(10s)->messages, count) << "nothing was forgotten";
  stream.purge("mw.north.alpha", 3);
  EXPECT_TRUE(soon([&] { return stream.state(10s)->first == 3; }));
  EXPECT_EQ(stream.publish("mw.north.alpha", "short", {}, 10s).outcome, Outcome::stored);
}

TEST_F(NatsStreamTest, delivers_no_more_than_may_be_unacknowledged) {
  Broker broker(options());
  const auto connection = connect(broker);
  NatsStream stream(connection, stream_named("north"));
  stream.ensure(10s);
  for (int i = 0; i < 5; ++i) stream.publish("mw.north.alpha", std::to_string(i), {}, 10s);
  Reader reader(connection, {"north", {}, "slow", "mw.north.alpha", 30.0, 2});
  reader.consumer.ensure(10s);
  reader.consumer.pull(reader.inbox(), 5, 10.0);
  const NatsMessage first = reader.next();
  EXPECT_EQ(first.bytes, "0");
  EXPECT_EQ(reader.next().bytes, "1");
  EXPECT_TRUE(reader.next(200ms).subject.empty()) << "two are unacknowledged";
  reader.consumer.acknowledge(first.reply);
  EXPECT_EQ(reader.next().bytes, "2");
}

TEST_F(NatsStreamTest, makes_deleted_streams_and_consumers_anew) {
  Broker broker(options());
  const auto connection = connect(broker);
  NatsStream stream(connection, stream_named("north"));
  Reader reader(connection, {"north", {}, "cloud", "mw.north.alpha"});
  EXPECT_EQ(error_of([&] { reader.consumer.ensure(10s); }).code(), ErrorCode::kMissing) << "no stream yet";
  EXPECT_FALSE(stream.state(10s));
  EXPECT_EQ(stream.publish("mw.north.alpha", "lost", {}, 10s).outcome, Outcome::no_stream);
  stream.ensure(10s);
  reader.consumer.ensure(10s);
  EXPECT_TRUE(connection->request("$JS.API.CONSUMER.DELETE.north.cloud", "", 10s));
  EXPECT_FALSE(reader.consumer.state(10s));
  reader.consumer.ask_state(reader.inbox());
  EXPECT_FALSE(consumer_state_of(reader.next()));
  EXPECT_TRUE(reader.consumer.ensure(10s));
  stream.publish("mw.north.alpha", "here", {}, 10s);
  EXPECT_THAT(reader.take(1), ElementsAre("here"));
  EXPECT_TRUE(connection->request("$JS.API.STREAM.DELETE.north", "", 10s));
  EXPECT_FALSE(stream.state(10s));
  EXPECT_TRUE(stream.ensure(10s));
}

// On the connection's thread, where nobody would catch what leaves it.
TEST(NatsAnswers, are_refused_where_their_values_are_of_other_kinds) {
  const auto answer = [](const char* json) {
    NatsMessage message;
    message.bytes = json;
    return message;
  };
  for (const char* json : {"", "[]", "7", R"({"error": 7})", R"({"seq": "7"})", R"({"seq": -7})", R"({"seq": 1e300})",
                           R"({"seq": 7, "duplicate": "no"})", R"({"error": {"err_code": "10077"}})",
                           R"({"error": {"description": 7}})", R"({"error": {"err_code": 1e300, "code": []}})"}) {
    EXPECT_EQ(publication_of(answer(json)).outcome, Outcome::refused) << json;
    EXPECT_FALSE(consumer_state_of(answer(json))) << json;
  }
  const Publication full = publication_of(answer(R"({"error": {"err_code": 10077, "description": {}}})"));
  EXPECT_EQ(full.outcome, Outcome::full);
  EXPECT_EQ(full.reason, "error 10077");
  for (const char* json :
       {R"({"config": 7, "ack_floor": {"stream_seq": 5}, "delivered": {"stream_seq": 7}, "num_pending": 2})",
        R"({"config": {}, "ack_floor": {"stream_seq": -5}, "delivered": {"stream_seq": 7}, "num_pending": 2})",
        R"({"config": {}, "ack_floor": {"stream_seq": 5}, "delivered": {"stream_seq": 1e30}, "num_pending": 2})"})
    EXPECT_FALSE(consumer_state_of(answer(json))) << json;
}

TEST_F(NatsStreamTest, says_what_the_broker_refuses) {
  Broker broker(options());
  const auto connection = connect(broker);
  NatsStream(connection, stream_named("north")).ensure(10s);
  StreamOptions overlapping = stream_named("south");
  overlapping.subjects = {"mw.north.alpha"};
  const Error error = error_of([&] { NatsStream(connection, overlapping).ensure(10s); });
  EXPECT_EQ(error.code(), ErrorCode::kBadInput);
  EXPECT_THAT(error.what(), HasSubstr("subjects overlap"));
  StreamOptions large = stream_named("north");
  large.most_bytes = 2 << 20;
  EXPECT_FALSE(NatsStream(connection, large).ensure(10s)) << "its limit is raised";
  broker.stop();
  EXPECT_EQ(error_of([&] { NatsStream(connection, large).ensure(1s); }).code(), ErrorCode::kMissing);
}

TEST_F(NatsStreamTest, of_an_edge_is_read_by_the_hubs_program_also_after_an_outage) {
  auto hub_options = options("hub"), edge_options = options("edge");
  hub_options.domain = "hub";
  hub_options.leaf_port = 0;
  hub_options.users = {{"cloud", "word", {}, {}},
                       {"edge", "secret", {"_INBOX.>"}, {"$JS.north.API.>", "$JS.ACK.north.>"}}};
  Broker hub(hub_options);
  NatsOptions as_cloud;
  as_cloud.user = "cloud";
  as_cloud.password = "word";
  edge_options.domain = "north";
  edge_options.hubs = {"nats-leaf://edge:secret@" + hub.leaf_url().substr(std::string("nats-leaf://").size())};
  Broker edge(edge_options);
  const auto at_edge = connect(edge), at_hub = connect(hub, as_cloud);
  NatsStream stream(at_edge, stream_named("north"));
  stream.ensure(10s);
  EXPECT_EQ(stream.publish("mw.north.alpha", "one", "1", 10s).outcome, Outcome::stored);
  ASSERT_TRUE(soon([&] {
    const auto answer = at_hub->request("$JS.north.API.INFO", "", 1s);
    return answer && answer->status == 0;
  }));
  at_hub->expect_jet_stream(10s, "north");
  EXPECT_THAT(error_of([&] { at_hub->expect_jet_stream(10s, "south"); }).what(), HasSubstr("domain 'south'"));
  Reader reader(at_hub, {"north", "north", "cloud", "mw.north.>"});
  EXPECT_TRUE(reader.consumer.ensure(10s));
  EXPECT_THAT(reader.take(1), ElementsAre("one"));
  hub.kill();
  EXPECT_EQ(stream.publish("mw.north.alpha", "two", "2", 10s).outcome, Outcome::stored) << "the edge works on";
  hub.start();
  at_hub->wait_until_connected(20s);
  ASSERT_TRUE(soon([&] {
    const auto answer = at_hub->request("$JS.north.API.INFO", "", 1s);
    return answer && answer->status == 0;
  }));
  EXPECT_THAT(reader.take(1), ElementsAre("two"));
  EXPECT_EQ(stream.state(10s)->messages, 2U) << "stored once";

  // What its user may not say does not get from the edge's broker to the hub's.
  std::vector<std::string> came;
  std::mutex mutex;
  const auto inbox = at_hub->open_inbox(
      [&](const NatsMessage& message) {
        const std::lock_guard lock(mutex);
        came.emplace_back(message.bytes);
      },
      InboxKind::answers);
  const auto number = [&] {
    const std::lock_guard lock(mutex);
    return came.size();
  };
  ASSERT_TRUE(soon([&] { return at_edge->publish(inbox->subject(), "answer") && number() > 0; }));
  const auto answer = at_edge->request("$JS.hub.API.INFO", "", 1s);
  EXPECT_TRUE(!answer || answer->status == 503) << "the edge's user may not ask the hub's JetStream";
}

using NatsBoardTest = WithBroker;

TEST_F(NatsBoardTest, keeps_the_last_word_of_each) {
  const Broker broker(options());
  NatsBoard board(connect(broker), "words");
  EXPECT_FALSE(board.last("robot-alpha", 10s)) << "there is no board yet";
  board.ensure(10s);
  board.ensure(10s);
  EXPECT_FALSE(board.last("robot-alpha", 10s));
  const std::string word("\x00 any \xff bytes", 12);
  for (const std::string& one : {std::string("first"), std::string(), word}) EXPECT_TRUE(board.put("robot-alpha", one));
  EXPECT_TRUE(board.put("robot beta.1", "another"));
  ASSERT_TRUE(soon([&] { return board.last("robot beta.1", 10s).has_value(); }));
  const auto last = board.last("robot-alpha", 10s);
  ASSERT_TRUE(last);
  EXPECT_EQ(last->bytes, word);
  EXPECT_LT(std::abs(std::chrono::duration<double>(std::chrono::system_clock::now() - last->stored).count()), 60.0);
  EXPECT_FALSE(board.put("robot-alpha", std::string(300 << 10, 'x'))) << "too long";
}

// Before 2.10 the server ends where a stream is read that it is about to make.
TEST_F(NatsBoardTest, is_asked_while_it_is_made) {
  const Broker broker(options());
  const auto asks = connect(broker), makes = connect(broker);
  for (int number = 0; number < 60; ++number) {
    const std::string name = "words" + std::to_string(number), stream = "stream" + std::to_string(number);
    NatsBoard board(makes, name);
    NatsStream wire(makes, {stream, {"mw." + stream}, {}, 1 << 20, 120.0});
    std::atomic<bool> is_made = false;
    std::thread reader([&] {
      const NatsBoard other(asks, name);
      NatsConsumer consumer(asks, {stream, {}, "reader", "mw." + stream});
      do {
        EXPECT_FALSE(other.last("robot-alpha", 10s));
        EXPECT_TRUE(other.words(10s).empty());
        try {
          consumer.ensure(10s);
        } catch (const Error& error) {
          EXPECT_EQ(error.code(), ErrorCode::kMissing);
        }
      } while (!is_made);
    });
    wire.ensure(10s);
    board.ensure(10s);
    is_made = true;
    reader.join();
  }
}

}  // namespace
}  // namespace mapweave::transport
