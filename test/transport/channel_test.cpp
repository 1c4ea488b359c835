#include <mapweave/transport/in_process_channel.h>

#include <gmock/gmock.h>
#include <atomic>
#include <thread>

namespace mapweave::transport {
namespace {

using namespace std::chrono_literals;
using Sent = Channel::Sent;
using testing::ElementsAre;

std::vector<std::string> received(Channel& channel, std::chrono::milliseconds patience = 0ms) {
  std::vector<std::string> bytes;
  for (const Channel::Delivery& one : channel.receive(patience)) bytes.push_back(one.envelope.bytes);
  return bytes;
}

TEST(InProcessChannel, carries_messages_in_both_directions_in_their_order) {
  const auto [robot, edge] = make_in_process_channel();
  EXPECT_EQ(robot->send({"update", "one", "alpha", 1}), Sent::taken);
  EXPECT_EQ(robot->send({"view", "two"}), Sent::taken);
  EXPECT_EQ(edge->send({"share", "three"}), Sent::taken);
  const auto there = edge->receive(0ms);
  ASSERT_EQ(there.size(), 2U);
  EXPECT_EQ(there[0].envelope.subject, "update");
  EXPECT_EQ(there[0].envelope.sender, "alpha");
  EXPECT_EQ(there[0].envelope.sequence, 1U);
  EXPECT_EQ(there[1].envelope.bytes, "two");
  EXPECT_THAT(received(*robot), ElementsAre("three"));
  EXPECT_TRUE(received(*robot).empty()) << "once";
}

TEST(InProcessChannel, makes_room_when_the_receiver_has_done_with_it) {
  const auto [robot, edge] = make_in_process_channel({10, 2}, {});
  EXPECT_EQ(robot->send({"update", "eleven bytes"}), Sent::never);
  EXPECT_EQ(robot->send({"update", "12345678"}), Sent::taken);
  EXPECT_EQ(robot->send({"update", "123"}), Sent::later);
  const auto there = edge->receive(0ms);
  EXPECT_EQ(robot->send({"update", "123"}), Sent::later) << "received is not done";
  EXPECT_EQ(robot->in_flight_bytes(), 8U);
  edge->acknowledge(there.at(0).number);
  edge->acknowledge(there.at(0).number);
  EXPECT_EQ(robot->in_flight_bytes(), 0U);
  EXPECT_EQ(robot->send({"update", "1"}), Sent::taken);
  EXPECT_EQ(robot->send({"update", "2"}), Sent::taken);
  EXPECT_EQ(robot->send({"update", "3"}), Sent::later) << "two are in flight";
}

TEST(InProcessChannel, keeps_the_last_where_only_that_counts) {
  const auto [robot, edge] = make_in_process_channel({}, {8, 3});
  const auto send = [&](const char* bytes, const char* sender) {
    return edge->send({"receipt", bytes, sender, 0, true});
  };
  EXPECT_EQ(send("a1", "a"), Sent::taken);
  EXPECT_EQ(edge->send({"share", "b"}), Sent::taken);
  EXPECT_EQ(send("c1", "c"), Sent::taken);
  for (const char* bytes : {"a2", "a33", "a4"}) EXPECT_EQ(send(bytes, "a"), Sent::taken) << "in the place of another";
  EXPECT_EQ(edge->in_flight_bytes(), 5U);
  EXPECT_THAT(received(*robot), ElementsAre("a4", "b", "c1"));
  EXPECT_EQ(send("a5", "a"), Sent::later) << "the one before was received";
}

TEST(InProcessChannel, calls_the_listener_and_ends_for_both_where_one_lets_go) {
  auto [robot, edge] = make_in_process_channel();
  std::atomic<int> calls{0};
  robot->send({"hello", "early"});
  edge->set_listener([&calls] { ++calls; });
  EXPECT_EQ(calls, 1) << "something may be there";
  robot->send({"hello", "again"});
  EXPECT_EQ(calls, 2);
  robot.reset();
  EXPECT_EQ(calls, 3);
  EXPECT_TRUE(edge->is_closed());
  EXPECT_EQ(edge->send({"share", ""}), Sent::never);
  EXPECT_THAT(received(*edge), ElementsAre("early", "again")) << "what was sent before";
  EXPECT_TRUE(received(*edge, 10s).empty()) << "at once";
}

TEST(InProcessChannel, wakes_who_waits) {
  const auto [robot, edge] = make_in_process_channel();
  std::thread sender([robot = robot] {
    std::this_thread::sleep_for(20ms);
    robot->send({"hello", "there"});
    std::this_thread::sleep_for(20ms);
    robot->close();
  });
  EXPECT_THAT(received(*edge, 10s), ElementsAre("there"));
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_TRUE(received(*edge, 10s).empty());
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 5s);
  sender.join();
}

TEST(InProcessChannel, loses_nothing_between_threads) {
  constexpr int kThreads = 4, kEach = 500;
  const auto [robot, edge] = make_in_process_channel({64, 8}, {});
  std::vector<std::thread> senders;
  for (int i = 0; i < kThreads; ++i)
    senders.emplace_back([&, i, robot = robot] {
      for (int k = 0; k < kEach; ++k)
        while (robot->send({"update", std::to_string(k), std::to_string(i)}) == Sent::later) std::this_thread::yield();
    });
  std::vector<int> next(kThreads, 0);
  for (int count = 0; count < kThreads * kEach;)
    for (const Channel::Delivery& one : edge->receive(10s)) {
      EXPECT_EQ(one.envelope.bytes, std::to_string(next.at(std::stoul(one.envelope.sender))++)) << "in order";
      edge->acknowledge(one.number);
      ++count;
    }
  for (std::thread& sender : senders) sender.join();
  EXPECT_EQ(robot->in_flight_bytes(), 0U);
}

}  // namespace
}  // namespace mapweave::transport
