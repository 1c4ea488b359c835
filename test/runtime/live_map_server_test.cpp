#include <mapweave/core/error.h>
#include <mapweave/mapdb/update_journal.h>
#include <mapweave/runtime/live_map_server.h>
#include <mapweave/transport/in_process_channel.h>
#include <support/killed.h>
#include <support/live_channel.h>
#include <support/received_updates.h>
#include <support/temporary_folder.h>

#include <gmock/gmock.h>
#include <atomic>
#include <random>
#include <thread>

namespace mapweave::runtime {
namespace {

using Sent = transport::Channel::Sent;
namespace subject = tiers::subject;
using test::hello_of;
using test::received_updates;
using test::ReceivedUpdate;
using test::take;
using namespace std::chrono_literals;

std::set<SessionId> sessions() {
  std::set<SessionId> result;
  for (const ReceivedUpdate& one : received_updates()) result.insert(one.from);
  return result;
}

std::uint64_t sequence_of(const std::string& update) { return decode_map_update(update, "test").sequence; }

// A client that repeats what is not stored until all is. `acknowledged` is called with each receipt that says more.
// looks: it asks for shared landmarks.
class Client {
 public:
  Client(LiveMapServer& server, const SessionId& session) : Client(server.connect(), session) {}
  Client(std::shared_ptr<transport::Channel> channel, const SessionId& session)
      : session_(session), link_(std::move(channel)) {
    link_->send({subject::kHello, encode(hello_of(session))});
    for (bool welcomed = false; !welcomed && !link_->is_closed();)
      for (const test::ReceivedMessage& message : take(*link_, 10s)) {
        if (message.subject != subject::kWelcome) continue;
        welcomed = true;
        for (const auto& receipt : message.receipts) stored_[receipt.origin.map] = receipt.stored;
      }
  }
  void publish_all(
      const std::function<void()>& acknowledged = [] {}, bool looks = false) {
    for (const ReceivedUpdate& one : received_updates()) {
      if (one.from != session_) continue;
      const MapUpdate update = decode_map_update(one.bytes, "test");
      while (stored_[update.origin.map] < update.sequence && !link_->is_closed()) {
        ASSERT_EQ(link_->send({subject::kUpdate, one.bytes}), Sent::taken);
        if (looks && !update.nodes.empty()) look(update);
        receive_receipts(update.sequence, acknowledged);
      }
    }
  }
  std::uint64_t stored(const MapId& map) { return stored_[map]; }
  transport::Channel& link() { return *link_; }

 private:
  // From where it was last.
  void look(const MapUpdate& update) {
    const Node& node = update.nodes.back();
    EXPECT_NE(link_->send({subject::kView, encode(ClientView{update.origin.map, node.stamp, node.map_from_node, 0})}),
              Sent::later);
  }
  void receive_receipts(std::uint64_t awaited, const std::function<void()>& acknowledged) {
    for (bool is_there = false; !is_there && !link_->is_closed();)
      for (const test::ReceivedMessage& message : take(*link_, 10s)) {
        EXPECT_NE(message.subject, subject::kRefusal) << message.bytes;
        for (const auto& receipt : message.receipts) {
          stored_[receipt.origin.map] = receipt.stored;
          is_there = is_there || receipt.stored >= awaited;
        }
        if (!message.receipts.empty()) acknowledged();
      }
  }

  SessionId session_;
  std::shared_ptr<transport::Channel> link_;
  std::map<MapId, std::uint64_t> stored_;
};

void publish_all(LiveMapServer& server) {
  std::vector<std::thread> clients;
  for (const SessionId& session : sessions())
    clients.emplace_back([&server, session] { Client(server, session).publish_all(); });
  for (std::thread& client : clients) client.join();
}

// All that was published is merged, as far as it is to be.
void await_merge(const LiveMapServer& server) {
  while (server.counts().is_merging) std::this_thread::sleep_for(1ms);
}

std::string sealed_in_lockstep() {
  tiers::VisualServer server(TierId("edge"), {}, {});
  for (const ReceivedUpdate& one : received_updates()) {
    server.greet(hello_of(one.from));
    server.receive(one.from, one.bytes);
  }
  return test::sealed(server);
}

SessionId stranger(const char* robot) { return {{RobotId(robot), SensorId("camera")}, 7}; }

TEST(LiveMapServer, ends_with_the_map_of_the_server_in_lockstep) {
  LiveMapServer server(TierId("edge"), {}, {}, {}, std::nullopt);
  publish_all(server);
  EXPECT_EQ(test::sealed(server.finish()), sealed_in_lockstep());
  const ServerCounts counts = server.counts();
  ASSERT_EQ(counts.clients.size(), sessions().size());
  for (const ClientCounts& client : counts.clients) {
    EXPECT_GT(client.updates, 3U);
    EXPECT_GT(client.update_s, 0.0);
    EXPECT_EQ(client.refused, 0U);
  }
}

TEST(LiveMapServer, lets_no_client_wait_for_one_that_stalls_floods_or_sends_garbage) {
  LiveServerOptions options;
  options.handlers = 1;
  options.queue_kb = 512;
  tiers::ServerOptions sharing;
  sharing.share = tiers::Sharing::view;
  sharing.fuse_after = 5;
  LiveMapServer server(TierId("edge"), sharing, {}, options, std::nullopt);
  std::atomic<bool> ends{false};
  std::atomic<int> put_off{0};
  std::vector<std::thread> hostile;
  const auto flood = [&](const char* robot, bool greets, const transport::Envelope& message) {
    hostile.emplace_back([&, robot, greets, message] {
      const auto link = server.connect();
      if (greets) link->send({subject::kHello, encode(hello_of(stranger(robot)))});
      while (!ends)
        if (link->send(message) == Sent::later) {
          ++put_off;
          std::this_thread::sleep_for(1ms);
        }
    });
  };
  std::mt19937 random(3);
  std::string garbage(3000, ' '), spoilt = received_updates().front().bytes;
  for (char& letter : garbage) letter = static_cast<char>(random());
  spoilt[spoilt.size() / 2] ^= 0x10;
  flood("garbage", true, {subject::kUpdate, garbage});
  flood("spoilt", true, {subject::kUpdate, spoilt});
  flood("rude", false, {subject::kView, garbage});
  flood("thief", true, {subject::kUpdate, received_updates().front().bytes});  // another's map
  flood("echo", true, {subject::kHello, encode(hello_of(stranger("echo")))});
  while (put_off < 3) std::this_thread::sleep_for(1ms);
  publish_all(server);
  ends = true;
  for (std::thread& one : hostile) one.join();
  EXPECT_EQ(test::sealed(server.finish()), sealed_in_lockstep());
  for (const ClientCounts& client : server.counts().clients)
    if (sessions().count(client.session) != 0) {
      EXPECT_EQ(client.refused, 0U);
      EXPECT_LT(client.longest_wait_s, 1.0);
    } else if (client.session != stranger("echo")) {
      EXPECT_GT(client.refused, 0U);
    }
}

// From one of the map's keyframes after the other.
ClientView view_of(const Map& map, std::uint32_t number) {
  const Node& node = (map.nodes.begin() + static_cast<std::ptrdiff_t>(number % map.nodes.size()))->second;
  return {map.id, node.stamp, node.map_from_node, number};
}

TEST(LiveMapServer, merges_aside_and_shares_landmarks_and_places_and_bounds_what_waits_to_be_received) {
  tiers::ServerOptions sharing;
  sharing.share = tiers::Sharing::view;
  sharing.fuse_after = 5;
  LiveServerOptions options;
  options.answers_kb = 64;
  LiveMapServer server(TierId("edge"), sharing, {}, options, std::nullopt);
  tiers::VisualServer lockstep(TierId("edge"), {}, {});
  for (const ReceivedUpdate& one : received_updates()) {
    lockstep.greet(hello_of(one.from));
    lockstep.receive(one.from, one.bytes);
  }
  publish_all(server);
  await_merge(server);
  const ServerCounts joined = server.counts();
  ASSERT_GE(joined.merges, 2);
  std::printf("%d merges, the longest %.3f s; maps held for %.4f s at most\n", joined.merges, joined.longest_merge_s,
              joined.longest_hold_s);
  EXPECT_LT(joined.longest_hold_s, joined.longest_merge_s);

  const Map map = lockstep.maps().back();
  Client beta(server, map.nodes.front().first.session);
  std::size_t most_bytes = 0, landmarks = 0;
  for (std::uint32_t views = 0; landmarks < 100 && views < 2000;) {
    for (int i = 0; i < 200; ++i) {
      Sent sent = Sent::later;
      while (sent == Sent::later) sent = beta.link().send({subject::kView, encode(view_of(map, ++views))});
      ASSERT_EQ(sent, Sent::taken);
    }
    while (server.counts().clients.back().views < views) std::this_thread::sleep_for(1ms);
    std::size_t bytes = 0;
    for (const test::ReceivedMessage& message : take(beta.link(), 0ms)) {
      ASSERT_EQ(message.subject, subject::kShare);
      bytes += message.bytes.size();
      for (const DescribedLandmark& one : decode_share(message.bytes, "test").landmarks) {
        EXPECT_NE(one.id.session, map.nodes.front().first.session);
        ++landmarks;
      }
    }
    most_bytes = std::max(most_bytes, bytes);
  }
  EXPECT_GT(most_bytes, 64U << 10);
  EXPECT_GT(landmarks, 10U);
  EXPECT_LT(most_bytes, 160U << 10) << "what nobody takes does not grow";

  Client gamma(server, stranger("gamma"));
  const Node& asked = map.nodes.find(map.nodes.front().first)[0];
  gamma.link().send({subject::kPlaceRequest, encode(PlaceRequest{asked.stamp, *keyframe_of(asked)})});
  const auto answers = take(gamma.link(), 30s);
  ASSERT_EQ(answers.size(), 1U);
  ASSERT_EQ(answers.front().subject, subject::kPlace);
  const PlaceAnswer answer = decode_place_answer(answers.front().bytes, "test");
  EXPECT_EQ(answer.stamp, asked.stamp);
  EXPECT_LT((answer.map_from_robot.t - asked.map_from_node.t).norm(), 0.1);
}

TEST(LiveMapServer, closes_the_link_that_a_client_has_left) {
  LiveMapServer server(TierId("edge"), {}, {}, {}, std::nullopt);
  const SessionId session = *sessions().begin();
  Client before(server, session), after(server, session);
  EXPECT_TRUE(before.link().is_closed());
  EXPECT_EQ(before.link().send({subject::kUpdate, "x"}), Sent::never);
  EXPECT_FALSE(after.link().is_closed());
  EXPECT_EQ(after.link().send({subject::kUpdate, std::string(std::size_t{5} << 20, 'x')}), Sent::never);
  after.link().send({subject::kHello, encode(hello_of(stranger("other")))});
  const auto answers = take(after.link(), 10s);
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_EQ(answers.front().subject, subject::kRefusal);
  server.finish();
  EXPECT_TRUE(after.link().is_closed());
}

TEST(LiveMapServer, takes_a_hello_twice_and_none_of_another_robot_on_a_robots_wire) {
  LiveMapServer server(TierId("edge"), {}, {}, {}, std::nullopt);
  const auto link = server.connect(RobotId("gamma"));
  const auto answer_to = [&](const SessionId& session) {
    link->send({subject::kHello, encode(hello_of(session))});
    const auto answers = take(*link, 10s);
    return answers.empty() ? std::string() : answers.front().subject;
  };
  EXPECT_EQ(answer_to(stranger("delta")), subject::kRefusal);
  EXPECT_EQ(answer_to(stranger("gamma")), subject::kWelcome);
  EXPECT_EQ(answer_to(stranger("gamma")), subject::kWelcome) << "networks double";
  EXPECT_EQ(answer_to(stranger("delta")), subject::kRefusal);
}

// The server's end of a channel that carries updates twice, as networks may.
class Twice : public transport::Channel {
 public:
  explicit Twice(std::shared_ptr<transport::Channel> once) : once_(std::move(once)) {}
  Sent send(transport::Envelope envelope) override { return once_->send(std::move(envelope)); }
  std::size_t in_flight_bytes() const override { return once_->in_flight_bytes(); }
  std::vector<Delivery> receive(std::chrono::milliseconds patience) override {
    std::vector<Delivery> all;
    for (const Delivery& one : once_->receive(patience))
      for (int i = 0; i < (one.envelope.subject == subject::kUpdate ? 2 : 1); ++i) all.push_back(one);
    return all;
  }
  void acknowledge(std::uint64_t delivery) override { once_->acknowledge(delivery); }
  void set_listener(std::function<void()> listener) override { once_->set_listener(std::move(listener)); }
  void close() override { once_->close(); }
  bool is_closed() const override { return once_->is_closed(); }

 private:
  std::shared_ptr<transport::Channel> once_;
};

TEST(LiveMapServer, takes_any_channel_and_updates_that_come_twice) {
  LiveMapServer server(TierId("edge"), {}, {}, {}, std::nullopt);
  for (const SessionId& session : sessions()) {
    const auto channel = transport::make_in_process_channel();
    server.serve(std::make_shared<Twice>(channel.second));
    Client client(channel.first, session);
    client.publish_all();
    EXPECT_EQ(client.link().send({"picture", "x"}), Sent::taken);
    bool is_refused = false;  // it knows no such subject
    while (!is_refused) {
      const auto answers = take(client.link(), 10s);
      ASSERT_FALSE(answers.empty());
      for (const test::ReceivedMessage& answer : answers)
        is_refused = is_refused || answer.subject == subject::kRefusal;
    }
  }
  EXPECT_EQ(test::sealed(server.finish()), sealed_in_lockstep());
  for (const ClientCounts& client : server.counts().clients) EXPECT_EQ(client.refused, 1U);
}

// The journal as it grows; written anew all the time.
class KilledServer : public testing::TestWithParam<int> {};

TEST_P(KilledServer, goes_on_with_all_that_it_said_it_has) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "edge.mwj";
  LiveServerOptions options;
  options.journal_kb = GetParam();
  ASSERT_GT(received_updates().size(), 8U);
  std::mt19937 random(5);
  tiers::ServerOptions sharing;
  sharing.share = tiers::Sharing::full;
  sharing.fuse_after = 5;
  for (int kill = 0; kill < 20; ++kill) {
    const auto serve = [&](int out) {
      LiveMapServer server(TierId("edge"), sharing, {}, options, path);
      std::vector<std::thread> clients;
      for (const SessionId& session : sessions())
        clients.emplace_back([&server, session, out] {
          Client(server, session).publish_all([out] { (void)!write(out, ".", 1); }, true);
        });
      for (std::thread& client : clients) client.join();
      server.finish();
    };
    const std::size_t most = random() % 5;
    test::killed(serve, most, static_cast<unsigned>(random() % 30000));
  }
  {
    LiveMapServer server(TierId("edge"), sharing, {}, options, path);
    publish_all(server);
  }
  std::size_t entries = 0;
  mapdb::UpdateJournal(path).replay([&](const mapdb::JournalEntry&) { ++entries; });
  if (GetParam() == 1) {  // one that begins writes the journal anew too, so a long one may be as short
    EXPECT_LT(entries, received_updates().size() / 2);
  }
  LiveMapServer again(TierId("edge"), {}, {}, {}, path);
  for (const SessionId& session : sessions()) {
    Client client(again, session);
    for (const ReceivedUpdate& one : received_updates())
      if (one.from == session) {
        EXPECT_GE(client.stored(decode_map_update(one.bytes, "test").origin.map), sequence_of(one.bytes));
      }
  }
  EXPECT_EQ(test::sealed(again.finish()), sealed_in_lockstep());
}
// One session after the other; each joins what its journal holds. What its verdicts rest on, and into how many maps it
// joins.
std::pair<std::set<Hash>, std::size_t> joined_from(const std::filesystem::path& path) {
  LiveMapServer server(TierId("edge"), {}, {}, {}, path);
  await_merge(server);
  std::set<Hash> witnesses;
  const fusion::FusionResult& joined = server.finish().merged();
  for (const Verdict& verdict : joined.verdicts) witnesses.insert(verdict.witnesses.begin(), verdict.witnesses.end());
  return {witnesses, joined.components.size()};
}

TEST(LiveMapServer, keeps_apart_what_was_vetoed_though_it_is_killed) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "edge.mwj", before = folder.path() / "before.mwj";
  {
    LiveMapServer server(TierId("edge"), {}, {}, {}, path);
    publish_all(server);
    server.finish();
    std::filesystem::copy_file(path, before);
    EXPECT_THROW(server.veto({}), Error) << "it would be lost";
  }
  auto [witnesses, components] = joined_from(path);
  std::set<Hash> vetoed;
  ASSERT_EQ(components, 1U);
  for (int round = 0; round < 20 && components == 1; ++round) {
    const auto veto = [&, &rests_on = witnesses](int out) {
      LiveMapServer server(TierId("edge"), {}, {}, {}, path);
      for (const Hash& witness : rests_on) server.veto(witness);
      (void)!write(out, ".", 1);
      while (true) sleep(1);  // until it is killed
    };
    ASSERT_EQ(test::killed(veto, 1, 0), 1U);
    vetoed.insert(witnesses.begin(), witnesses.end());
    std::tie(witnesses, components) = joined_from(path);
  }
  EXPECT_EQ(components, 2U);
  for (int again = 0; again < 2; ++again)
    EXPECT_EQ(joined_from(path).second, 2U) << "from a journal that was written anew, too";

  LiveMapServer serving(TierId("edge"), {}, {}, {}, before);
  for (const Hash& witness : vetoed) serving.veto(witness);
  await_merge(serving);
  EXPECT_EQ(serving.finish().merged().components.size(), 2U) << "it parts them while it serves";
}

INSTANTIATE_TEST_SUITE_P(LongAndShortJournals, KilledServer, testing::Values(65536, 1));

}  // namespace
}  // namespace mapweave::runtime
