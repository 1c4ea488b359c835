#include <support/broker_fixture.h>

#include <mapweave/core/mixed_bits.h>
#include <mapweave/transport/nats_channel.h>
#include <mapweave/transport/nats_stream.h>

#include <mutex>

namespace mapweave::transport {
namespace {

using Sent = Channel::Sent;
using testing::ElementsAre;
using testing::IsEmpty;

std::string noise(std::size_t size, std::uint64_t seed) {
  std::string bytes(size, '\0');
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>(mixed(mixed(seed) + i));
  return bytes;
}

NatsChannelOptions robot_options() {
  NatsChannelOptions options;
  options.peer = "alpha.camera";
  options.out = {"north_up", {}, 64 << 20};
  options.in = {"north_down", {}, 64 << 20};
  options.priorities = {{"hello", "view", "welcome", "receipts"}};
  options.repeat_s = 1.0;
  return options;
}
NatsChannelOptions edge_options() {
  NatsChannelOptions options = robot_options();
  options.side = NatsChannelSide::accepts;
  std::swap(options.out, options.in);
  return options;
}

void send(Channel& channel, Envelope envelope) {
  Sent sent = Sent::later;
  EXPECT_TRUE(soon([&] { return (sent = channel.send(envelope)) != Sent::later; }, 60s));
  EXPECT_EQ(sent, Sent::taken);
}

// So many messages' bytes, acknowledged.
std::vector<std::string> receive(Channel& channel, std::size_t count, std::chrono::milliseconds patience = 60s) {
  std::vector<std::string> bytes;
  const auto until = std::chrono::steady_clock::now() + patience;
  while (bytes.size() < count && std::chrono::steady_clock::now() < until)
    for (const Channel::Delivery& one : channel.receive(50ms)) {
      bytes.push_back(one.envelope.bytes);
      channel.acknowledge(one.number);
    }
  return bytes;
}

std::vector<std::string> numbers(int from, int to) {
  std::vector<std::string> all;
  for (int i = from; i < to; ++i) all.push_back(std::to_string(i));
  return all;
}

class NatsChannelTest : public WithBroker {
 protected:
  void SetUp() override {
    WithBroker::SetUp();
    if (IsSkipped()) return;
    broker = std::make_unique<Broker>(options());
    at_robot = connect(*broker);
    at_edge = connect(*broker);
  }
  void connect_both() {
    robot = std::make_unique<NatsChannel>(at_robot, robot_options());
    edge = std::make_unique<NatsChannel>(at_edge, edge_options());
  }

  std::unique_ptr<Broker> broker;
  std::shared_ptr<NatsConnection> at_robot, at_edge;
  std::unique_ptr<NatsChannel> robot, edge;
};

TEST_F(NatsChannelTest, carries_messages_in_both_directions_in_their_order) {
  robot = std::make_unique<NatsChannel>(at_robot, robot_options());
  std::vector<std::string> bytes;
  for (int i = 0; i < 200; ++i) send(*robot, {"update", std::to_string(i), "alpha", static_cast<std::uint64_t>(i) + 1});
  EXPECT_EQ(robot->state().has_reader, false);
  edge = std::make_unique<NatsChannel>(at_edge, edge_options());  // ends may start in any order
  const auto calls = std::make_shared<std::atomic<int>>(0);
  edge->set_listener([calls] { ++*calls; });
  const auto first = [&] {
    for (;;)
      if (auto some = edge->receive(10s); !some.empty()) return some;
  }();
  EXPECT_EQ(first[0].envelope.subject, "update");
  EXPECT_EQ(first[0].envelope.sender, "alpha");
  EXPECT_EQ(first[0].envelope.sequence, 1U);
  std::vector<std::string> all;
  for (const auto& one : first) {
    all.push_back(one.envelope.bytes);
    edge->acknowledge(one.number);
  }
  for (const auto& more : receive(*edge, 200 - first.size())) all.push_back(more);
  EXPECT_EQ(all, numbers(0, 200));
  EXPECT_GT(*calls, 1);
  send(*edge, {"receipts", "thanks", "alpha", 0, true});
  EXPECT_THAT(receive(*robot, 1), ElementsAre("thanks"));
  EXPECT_TRUE(soon([&] { return robot->in_flight_bytes() == 0 && edge->in_flight_bytes() == 0; }));
  EXPECT_TRUE(soon([&] { return robot->state().has_reader; }));
  EXPECT_TRUE(robot->state().is_open);
  EXPECT_TRUE(edge->state().is_open);
  EXPECT_EQ(edge->state().received.repeated, 0U);
  EXPECT_TRUE(soon([&] { return robot->state().trouble.empty(); })) << robot->state().trouble;
}

TEST_F(NatsChannelTest, carries_long_messages_in_parts_and_measures_the_link) {
  connect_both();
  const std::string large = noise(5'000'000, 1);
  for (int i = 0; i < 3; ++i) send(*robot, {"update", large, "alpha", static_cast<std::uint64_t>(i) + 1});
  send(*robot, {"view", "urgent"});
  for (const std::string& bytes : receive(*edge, 4)) EXPECT_TRUE(bytes == "urgent" || bytes == large);
  EXPECT_EQ(edge->state().received.messages, 4U);
  EXPECT_GE(robot->state().sent_parts, 60U);
  ASSERT_TRUE(robot->bytes_per_s());
  EXPECT_GT(robot->bytes_per_s()->bytes_per_s, 1e5);
  EXPECT_LT(robot->bytes_per_s()->age_s, 30.0);
  EXPECT_FALSE(edge->bytes_per_s()) << "it sent next to nothing";
}

TEST_F(NatsChannelTest, says_later_where_the_other_end_does_not_acknowledge) {
  auto limited = robot_options();
  limited.limits = {1000, 3};
  robot = std::make_unique<NatsChannel>(at_robot, limited);
  edge = std::make_unique<NatsChannel>(at_edge, edge_options());
  EXPECT_EQ(robot->send({"update", std::string(1001, 'x')}), Sent::never);
  EXPECT_EQ(robot->send({"update", std::string(900, 'x')}), Sent::taken);
  EXPECT_EQ(robot->send({"update", std::string(101, 'x')}), Sent::later);
  const auto some = [&] {
    std::vector<Channel::Delivery> got;
    soon([&] { return !(got = edge->receive(1s)).empty(); });
    return got;
  }();
  ASSERT_EQ(some.size(), 1U);
  std::this_thread::sleep_for(300ms);
  EXPECT_EQ(robot->send({"update", std::string(101, 'x')}), Sent::later) << "received is not done";
  EXPECT_GE(robot->in_flight_bytes(), 900U);
  edge->acknowledge(some[0].number);
  EXPECT_TRUE(soon([&] { return robot->send({"update", std::string(101, 'x')}) == Sent::taken; }));
}

TEST_F(NatsChannelTest, loses_nothing_when_the_broker_is_killed_and_the_wire_cut) {
  connect_both();
  const int count = 400;
  std::thread sending([&] {
    for (int i = 0; i < count; ++i) {
      send(*robot, {"update", std::to_string(i), "alpha", static_cast<std::uint64_t>(i) + 1});
      std::this_thread::sleep_for(2ms);
    }
  });
  std::vector<std::string> all;
  const auto take = [&](std::size_t until) {
    if (all.size() < until)
      for (const auto& one : receive(*edge, until - all.size())) all.push_back(one);
    EXPECT_GE(all.size(), until);
  };
  take(50);
  broker->kill();
  std::this_thread::sleep_for(50ms);
  broker->start();
  take(150);
  at_robot->cut();
  take(250);
  at_edge->cut();
  take(300);
  broker->kill();
  broker->start();
  take(count);
  sending.join();
  EXPECT_EQ(all, numbers(0, count)) << "once and in order";
  EXPECT_EQ(edge->state().received.skipped, 0U);
  EXPECT_TRUE(soon([&] { return robot->in_flight_bytes() == 0; }));
  EXPECT_FALSE(robot->is_closed());
}

TEST_F(NatsChannelTest, goes_on_where_streams_and_consumers_are_deleted) {
  connect_both();
  send(*robot, {"update", "0"});
  EXPECT_THAT(receive(*edge, 1), ElementsAre("0"));
  EXPECT_TRUE(at_edge->request("$JS.API.CONSUMER.DELETE.north_up_1.alpha=2ecamera", "", 10s));
  for (int i = 1; i < 20; ++i) send(*robot, {"update", std::to_string(i)});
  EXPECT_EQ(receive(*edge, 19), numbers(1, 20));
  EXPECT_TRUE(soon([&] { return robot->in_flight_bytes() == 0; }));
  const auto made = robot->state().streams_made;
  EXPECT_TRUE(at_edge->request("$JS.API.STREAM.DELETE.north_up_1", "", 10s));
  for (int i = 20; i < 40; ++i) send(*robot, {"update", std::to_string(i)});
  EXPECT_EQ(receive(*edge, 20), numbers(20, 40));
  EXPECT_GE(robot->state().streams_made, made + 1) << "twice where the broker delivers nothing of the new one";
  EXPECT_GT(edge->state().consumers_made, 2U);
}

TEST_F(NatsChannelTest, waits_where_the_stream_is_full) {
  auto small = robot_options();
  small.out.stream_bytes = 600'000;
  auto other = edge_options();
  other.in.stream_bytes = small.out.stream_bytes;
  robot = std::make_unique<NatsChannel>(at_robot, small);
  edge = std::make_unique<NatsChannel>(at_edge, other);
  EXPECT_EQ(robot->send({"update", noise(300'001, 1)}), Sent::never) << "half of the stream at most";
  ASSERT_TRUE(soon([&] { return robot->state().streams_made == 2; }));
  const NatsStream stream(at_edge, {"north_up_1", {}, {}, 0, 0.0});
  const std::string of_another = "mw.north_up.1.beta";  // who never receives
  while (stream.publish(of_another, noise(50'000, 1), {}, 10s).outcome == Publication::Outcome::stored) {}
  std::thread sending([&] {
    for (std::uint64_t i = 0; i < 10; ++i) send(*robot, {"update", noise(100'000, i), "alpha", i + 1});
  });
  EXPECT_TRUE(soon([&] {
    const NatsChannelState now = robot->state();
    return now.full_s && now.trouble.find("maximum bytes") != std::string::npos;
  })) << "and nothing was forgotten";
  stream.purge(of_another, 1000);
  const auto all = receive(*edge, 10);
  sending.join();
  ASSERT_EQ(all.size(), 10U);
  for (std::uint64_t i = 0; i < 10; ++i) EXPECT_TRUE(all[i] == noise(100'000, i)) << i;
  EXPECT_TRUE(soon([&] { return !robot->state().full_s; }));
}

TEST_F(NatsChannelTest, begins_another_session_when_either_program_is_started_again) {
  connect_both();
  send(*robot, {"hello", "first"});
  EXPECT_THAT(receive(*edge, 1), ElementsAre("first"));
  send(*robot, {"update", "never acknowledged"});
  EXPECT_TRUE(soon([&] { return edge->receive(1s).size() == 1; }));

  edge.reset();  // the edge's program ends in order
  EXPECT_TRUE(soon([&] { return robot->is_closed(); }));
  EXPECT_EQ(robot->send({"view", "x"}), Sent::never);
  auto killed = robot_options();
  killed.linger_s = 0.0;
  robot = std::make_unique<NatsChannel>(at_robot, killed);
  edge = std::make_unique<NatsChannel>(at_edge, edge_options());
  send(*robot, {"hello", "second"});
  EXPECT_THAT(receive(*edge, 1), ElementsAre("second")) << "what was in flight is forgotten";

  robot.reset();  // the robot's program is killed, and started again
  EXPECT_FALSE(edge->is_closed());
  const auto robot_again = std::make_unique<NatsChannel>(at_robot, robot_options());
  send(*robot_again, {"hello", "third"});
  EXPECT_TRUE(soon([&] { return edge->is_closed(); }));
  killed = edge_options();
  killed.linger_s = 0.0;
  edge = std::make_unique<NatsChannel>(at_edge, killed);
  EXPECT_THAT(receive(*edge, 1), ElementsAre("third"));
  send(*edge, {"welcome", "you"});
  EXPECT_THAT(receive(*robot_again, 1), ElementsAre("you"));

  edge.reset();  // the edge's program is killed: another one knows nothing of the session
  EXPECT_FALSE(robot_again->is_closed());
  const NatsChannel edge_again(at_edge, edge_options());
  send(*robot_again, {"view", "lost"});
  EXPECT_TRUE(soon([&] { return robot_again->is_closed(); })) << "and says so";
}

TEST_F(NatsChannelTest, may_be_let_go_of_by_its_listener) {
  connect_both();
  const auto is_gone = std::make_shared<std::atomic<bool>>(false);
  send(*robot, {"hello", "x"});
  EXPECT_THAT(receive(*edge, 1), ElementsAre("x"));
  const auto held = std::make_shared<std::unique_ptr<NatsChannel>>(std::move(edge));
  (*held)->set_listener([weak = std::weak_ptr(held), is_gone] {
    const auto its = weak.lock();
    if (!its || !*its || !(*its)->is_closed()) return;
    its->reset();
    *is_gone = true;
  });
  robot.reset();
  EXPECT_TRUE(soon([&] { return is_gone->load(); }));
  connect_both();
  send(*robot, {"hello", "y"});
  EXPECT_THAT(receive(*edge, 1), ElementsAre("y"));
}

TEST_F(NatsChannelTest, of_others_carries_nothing_and_of_strangers_nothing_either) {
  connect_both();
  auto beta_options = robot_options();
  beta_options.peer = "beta";
  NatsChannel beta(at_robot, beta_options);
  send(beta, {"hello", "of beta"});
  send(*robot, {"hello", "of alpha"});
  EXPECT_THAT(receive(*edge, 1), ElementsAre("of alpha"));
  for (int i = 0; i < 50; ++i) at_robot->publish("mw.north_up.0.alpha=2ecamera", "some other program's bytes");
  send(*robot, {"hello", "again"});
  EXPECT_THAT(receive(*edge, 1), ElementsAre("again"));
  const auto index = static_cast<std::size_t>(WireRefusal::not_an_envelope);
  EXPECT_TRUE(soon([&] { return edge->state().refused[index] == 50; }));
  EXPECT_EQ(edge->health().refused, 50U);
  EXPECT_THAT(edge->receive(100ms), IsEmpty());
}

TEST_F(NatsChannelTest, reads_an_edges_streams_from_its_hub_also_after_an_outage) {
  auto hub_options = options("hub"), leaf_options = options("leaf");
  hub_options.domain = "hub";
  hub_options.leaf_port = 0;
  Broker hub(hub_options);
  leaf_options.domain = "north";
  leaf_options.hubs = {hub.leaf_url()};
  Broker leaf(leaf_options);
  const auto at_leaf = connect(leaf), at_hub = connect(hub);
  auto upward = robot_options();
  upward.out = {"north_maps", "north", 64 << 20};
  upward.in = {"north_orders", "hub", 64 << 20};
  upward.link_end = LinkEnd::receiver;
  auto downward = edge_options();
  downward.out = upward.in;
  downward.in = upward.out;
  NatsChannel up(at_leaf, upward), down(at_hub, downward);
  const std::string large = noise(1'000'000, 3);
  send(up, {"update", large});
  EXPECT_THAT(receive(down, 1), ElementsAre(large));
  send(down, {"receipts", "thanks"});
  EXPECT_THAT(receive(up, 1), ElementsAre("thanks"));
  hub.kill();
  for (int i = 0; i < 20; ++i) send(up, {"update", std::to_string(i)});
  std::this_thread::sleep_for(300ms);
  hub.start();
  EXPECT_EQ(receive(down, 20), numbers(0, 20));
  EXPECT_TRUE(soon([&] { return up.in_flight_bytes() == 0; }));
}

}  // namespace
}  // namespace mapweave::transport
