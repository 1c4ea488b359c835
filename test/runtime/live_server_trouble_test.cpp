// What the live camera map server does when the world around it fails.
#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/runtime/live_map_server.h>
#include <support/killed.h>
#include <support/live_channel.h>
#include <support/received_updates.h>
#include <support/temporary_folder.h>

#include <sys/resource.h>

#include <gmock/gmock.h>
#include <fstream>
#include <system_error>
#include <thread>

namespace mapweave::runtime {
namespace {

namespace subject = tiers::subject;
using Sent = transport::Channel::Sent;
using test::hello_of;
using test::received_updates;
using test::ReceivedUpdate;
using test::take;
using namespace std::chrono_literals;

SessionId stranger(std::int64_t run) { return {{RobotId("stranger"), SensorId("camera")}, run}; }

// Of what one client received until nothing more came for so long.
std::uint64_t stored_of(transport::Channel& link, std::chrono::milliseconds patience) {
  std::uint64_t stored = 0;
  while (true) {
    const auto messages = take(link, patience);
    if (messages.empty()) return stored;
    for (const test::ReceivedMessage& message : messages)
      for (const auto& receipt : message.receipts) stored = std::max(stored, receipt.stored);
  }
}

template <class Condition>
bool comes_true(const Condition& condition) {
  for (int i = 0; i < 2000 && !condition(); ++i) std::this_thread::sleep_for(10ms);
  return condition();
}

class SmallDisk {  // no file grows beyond
 public:
  explicit SmallDisk(rlim_t bytes) {
    getrlimit(RLIMIT_FSIZE, &before_);
    handler_ = std::signal(SIGXFSZ, SIG_IGN);
    rlimit less = before_;
    less.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &less);
  }
  ~SmallDisk() {
    setrlimit(RLIMIT_FSIZE, &before_);
    std::signal(SIGXFSZ, handler_);
  }

 private:
  rlimit before_{};
  void (*handler_)(int) = nullptr;
};

TEST(LiveServerTrouble, confirms_nothing_while_the_disk_is_full_and_all_once_there_is_room) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "edge.mwj";
  LiveMapServer server(TierId("edge"), {}, {}, {}, path);
  const SessionId session = received_updates().front().from;
  const auto link = server.connect();
  link->send({subject::kHello, encode(hello_of(session))});
  stored_of(*link, 500ms);
  std::uint64_t last = 0;
  {
    const SmallDisk full(std::filesystem::file_size(path.string() + "-wal"));
    for (const ReceivedUpdate& one : received_updates())
      if (one.from == session) {
        while (link->send({subject::kUpdate, one.bytes}) == Sent::later) std::this_thread::sleep_for(1ms);
        last = decode_map_update(one.bytes, "test").sequence;
      }
    EXPECT_TRUE(comes_true([&] { return !server.counts().trouble.empty(); }));
    EXPECT_NE(server.counts().trouble.find("edge.mwj"), std::string::npos) << server.counts().trouble;
    EXPECT_EQ(stored_of(*link, 300ms), 0U) << "what is not safe is not confirmed";
  }
  std::uint64_t stored = 0;
  EXPECT_TRUE(comes_true([&] {
    stored = std::max(stored, stored_of(*link, 10ms));
    return stored == last;
  })) << stored
      << " of " << last;
  EXPECT_TRUE(comes_true([&] { return server.counts().trouble.empty(); }));
  const std::string sealed = test::sealed(server.finish());
  LiveMapServer again(TierId("edge"), {}, {}, {}, path);
  EXPECT_EQ(test::sealed(again.finish()), sealed);
}

TEST(LiveServerTrouble, does_not_begin_where_it_cannot_write) {
  const test::TemporaryFolder folder;
  std::ofstream(folder.path() / "file") << "no folder";
  EXPECT_THROW(LiveMapServer(TierId("edge"), {}, {}, {}, folder.path() / "file" / "edge.mwj"), Error);
}

TEST(LiveServerTrouble, throws_where_it_cannot_have_its_threads) {
  const auto begins = [](int out) {
    rlimit limit{};
    getrlimit(RLIMIT_AS, &limit);
    std::ifstream file("/proc/self/statm");
    rlim_t pages = 0;
    file >> pages;
    limit.rlim_cur = pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + (rlim_t{200} << 20);
    setrlimit(RLIMIT_AS, &limit);
    LiveServerOptions options;
    options.handlers = 64;
    try {
      LiveMapServer server(TierId("edge"), {}, {}, options, std::nullopt);
    } catch (const std::system_error&) {
      (void)!write(out, "!", 1);
    }
    while (true) sleep(1);  // until it is killed
  };
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers need the address space";
#endif
  EXPECT_EQ(test::killed(begins, 1, 0), 1U);
}

TEST(LiveServerTrouble, says_why_maps_could_not_be_joined_and_joins_them_the_next_time) {
  tiers::ServerOptions eager;
  eager.fuse_after = 2;
  eager.fuse_share = 0.0;
  LiveMapServer server(TierId("edge"), eager, {}, {}, std::nullopt);
  std::map<SessionId, std::shared_ptr<transport::Channel>> links;
  for (const ReceivedUpdate& one : received_updates())
    if (auto& link = links[one.from]; link == nullptr) {
      link = server.connect();
      link->send({subject::kHello, encode(hello_of(one.from))});
    }
  request_interrupt();  // merges throw
  const std::size_t half = received_updates().size() / 2;
  for (std::size_t i = 0; i < half; ++i)
    links[received_updates()[i].from]->send({subject::kUpdate, received_updates()[i].bytes});
  EXPECT_TRUE(comes_true([&] { return !server.counts().trouble.empty(); }));
  clear_interrupt();
  EXPECT_EQ(server.counts().merges, 0);
  for (std::size_t i = half; i < received_updates().size(); ++i)
    links[received_updates()[i].from]->send({subject::kUpdate, received_updates()[i].bytes});
  EXPECT_TRUE(comes_true([&] { return server.counts().merges > 0 && server.counts().trouble.empty(); }));
  for (auto& [session, link] : links) EXPECT_GT(stored_of(*link, 200ms), 0U);
  for (const ClientCounts& client : server.counts().clients) EXPECT_EQ(client.refused, 0U);
}

TEST(LiveServerTrouble, keeps_nothing_of_those_who_come_and_publish_nothing) {
  LiveMapServer server(TierId("edge"), {}, {}, {}, std::nullopt);
  for (std::int64_t run = 0; run < 10'100; ++run) {  // more than a server keeps
    const auto link = server.connect();
    ASSERT_EQ(link->send({subject::kHello, encode(hello_of(stranger(run)))}), Sent::taken);
    const auto messages = take(*link, 10s);
    ASSERT_EQ(messages.size(), 1U);
    ASSERT_EQ(messages.front().subject, subject::kWelcome) << messages.front().bytes;
  }
  EXPECT_LE(server.counts().clients.size(), 1002U);
}

}  // namespace
}  // namespace mapweave::runtime
