#include <mapweave/transport/direct_channel.h>

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <random>
#include <thread>

namespace mapweave::transport {
namespace {

using namespace std::chrono_literals;
using Sent = Channel::Sent;

// Carries packets one after the other, and loses some of them.
class Pipe {
 public:
  explicit Pipe(double loss = 0.0) : loss_(loss), thread_([this] { run(); }) {}
  ~Pipe() {
    {
      const std::lock_guard lock(mutex_);
      ends_ = true;
    }
    changed_.notify_all();
    thread_.join();
  }
  void lead_to(DirectChannel* end) {
    const std::lock_guard delivery(delivery_);
    end_ = end;
  }
  void send(std::string packet) {
    const std::lock_guard lock(mutex_);
    if (std::uniform_real_distribution<>()(random_) < loss_) return;
    packets_.push_back(std::move(packet));
    changed_.notify_all();
  }

 private:
  void run() {
    std::unique_lock lock(mutex_);
    for (;;) {
      changed_.wait(lock, [&] { return ends_ || !packets_.empty(); });
      if (ends_) return;
      const std::string packet = std::move(packets_.front());
      packets_.pop_front();
      lock.unlock();
      {
        const std::lock_guard delivery(delivery_);
        if (end_ != nullptr) end_->take(packet);
      }
      lock.lock();
    }
  }
  const double loss_;
  std::mutex mutex_, delivery_;
  std::condition_variable changed_;
  std::deque<std::string> packets_;
  std::mt19937 random_{7};
  DirectChannel* end_ = nullptr;
  bool ends_ = false;
  std::thread thread_;
};

DirectChannelOptions options_of(bool opens) {
  DirectChannelOptions options;
  options.peer = "alpha";
  options.opens = opens;
  options.priorities = {{"hello"}};
  options.confirm_s = 0.2;
  options.linger_s = 0.1;
  return options;
}

// One end, which the other one reaches while this is there.
class End {
 public:
  End(bool opens, Pipe& out, Pipe& in)
      : in_(in), channel(options_of(opens), [&out](std::string packet) { out.send(std::move(packet)); }) {
    in_.lead_to(&channel);
  }
  ~End() { in_.lead_to(nullptr); }

 private:
  Pipe& in_;

 public:
  DirectChannel channel;
};

std::vector<std::string> take(Channel& channel, std::size_t count) {
  std::vector<std::string> bytes;
  for (int i = 0; i < 300 && bytes.size() < count && !channel.is_closed(); ++i)
    for (const Channel::Delivery& one : channel.receive(100ms)) {
      bytes.push_back(one.envelope.bytes);
      channel.acknowledge(one.number);
    }
  return bytes;
}

bool eventually(const std::function<bool()>& condition) {
  for (int i = 0; i < 600 && !condition(); ++i) std::this_thread::sleep_for(50ms);
  return condition();
}

class DirectChannelTest : public testing::TestWithParam<double> {
 protected:
  Pipe up_{GetParam()}, down_{GetParam()};
};

TEST_P(DirectChannelTest, carries_messages_of_any_length_in_order_though_packets_are_lost) {
  End robot(true, up_, down_), edge(false, down_, up_);
  std::vector<std::string> said;
  for (std::size_t i = 0; i < 60; ++i)
    said.push_back(std::string(i % 7 == 0 ? 700'000 : 100 * i, static_cast<char>('a' + i % 26)));
  std::thread speaker([&] {
    for (const std::string& one : said)
      while (robot.channel.send({"update", one}) != Sent::taken) std::this_thread::sleep_for(5ms);
  });
  EXPECT_EQ(take(edge.channel, said.size()), said);
  speaker.join();
  EXPECT_TRUE(eventually([&] { return robot.channel.in_flight_bytes() == 0; })) << "all is acknowledged";
  edge.channel.send({"share", "back"});
  EXPECT_EQ(take(robot.channel, 1), std::vector<std::string>{"back"});
  EXPECT_EQ(edge.channel.health().refused, 0U);
}

TEST_P(DirectChannelTest, closes_both_ends_where_one_is_closed_and_the_next_one_works) {
  End edge(false, down_, up_);
  for (const char* word : {"one", "two"}) {
    End robot(true, up_, down_);
    robot.channel.send({"update", word});
    if (std::string(word) == "one") {
      EXPECT_EQ(take(edge.channel, 1), std::vector<std::string>{"one"});
      continue;
    }
    EXPECT_TRUE(eventually([&] { return edge.channel.is_closed(); })) << "its session has ended, or another one began";
    up_.lead_to(nullptr);
    End next(false, down_, up_);
    EXPECT_EQ(take(next.channel, 1), std::vector<std::string>{"two"});
  }
}

TEST_P(DirectChannelTest, ends_a_session_that_the_other_end_knows_nothing_of) {
  End robot(true, up_, down_);
  {
    End edge(false, down_, up_);
    robot.channel.send({"update", "one"});
    EXPECT_EQ(take(edge.channel, 1), std::vector<std::string>{"one"});
    EXPECT_TRUE(eventually([&] { return robot.channel.in_flight_bytes() == 0; }));
    up_.lead_to(nullptr);  // as if it were killed
    down_.lead_to(nullptr);
  }
  down_.lead_to(&robot.channel);
  End edge(false, down_, up_);
  EXPECT_TRUE(eventually([&] {
    robot.channel.send({"update", "two"});
    return robot.channel.is_closed();
  }));
}

INSTANTIATE_TEST_SUITE_P(Loss, DirectChannelTest, testing::Values(0.0, 0.3));

TEST(DirectChannel, takes_nothing_of_strangers) {
  Pipe nowhere;
  End edge(false, nowhere, nowhere);
  nowhere.lead_to(nullptr);
  std::mt19937 random(3);
  for (int i = 0; i < 20'000; ++i) {
    std::string packet(random() % 200, '\0');
    for (char& one : packet) one = static_cast<char>(random());
    if (packet.size() > 2 && i % 2 == 0) {
      packet[0] = i % 4 == 0 ? 'P' : 'N';
      packet[1] = static_cast<char>(i % 3);
    }
    edge.channel.take(packet);
  }
  EXPECT_TRUE(edge.channel.receive(0ms).empty());
  EXPECT_FALSE(edge.channel.is_closed());
  EXPECT_GT(edge.channel.health().refused, 1000U);
}

}  // namespace
}  // namespace mapweave::transport
