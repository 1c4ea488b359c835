#include <support/broker_fixture.h>

#include <csignal>
#include <fstream>
#include <mutex>

namespace mapweave::transport {
namespace {

using testing::HasSubstr;

class BrokerTest : public WithBroker {};
class NatsConnectionTest : public WithBroker {};

TEST_F(BrokerTest, answers_on_a_free_port_and_ends) {
  Broker one(options("one")), two(options("two"));
  EXPECT_NE(one.url(), two.url());
  EXPECT_THAT(one.url(), HasSubstr("nats://127.0.0.1:"));
  connect(one);
  const int process = one.process();
  one.stop();
  EXPECT_FALSE(one.is_running());
  EXPECT_NE(::kill(process, 0), 0) << "it has ended, and is no zombie";
  const std::string url = one.url();
  one.start();
  EXPECT_EQ(one.url(), url) << "on the same port";
  EXPECT_TRUE(connect(one)->state().is_connected);
}

TEST_F(BrokerTest, says_why_it_cannot_start) {
  EXPECT_EQ(error_of([] { find_broker("/no/such/program"); }).code(), ErrorCode::kMissing);
  const std::string path = getenv("PATH");
  if (!std::filesystem::exists("/usr/sbin/nats-server")) {
    setenv("PATH", "/nowhere", 1);
    EXPECT_THAT(error_of([] { find_broker(); }).what(), HasSubstr("install --no-install-recommends nats-server"));
    setenv("PATH", path.c_str(), 1);
  }
  Broker first(options("first"));
  auto same = options("second");
  same.port = std::stoi(first.url().substr(first.url().rfind(':') + 1));
  const Error error = error_of([&] { Broker second(same); });
  EXPECT_EQ(error.code(), ErrorCode::kHelperFailed);
  EXPECT_THAT(error.what(), HasSubstr("address already in use"));
  same = options("third");
  same.folder = "/proc/none";
  EXPECT_EQ(error_of([&] { Broker third(same); }).code(), ErrorCode::kCannotWrite);
}

// Threads of this process that a signal of Ctrl-C may reach.
int threads_for_signals() {
  int count = 0;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task")) {
    std::ifstream status(thread.path() / "status");
    for (std::string line; std::getline(status, line);)
      if (line.rfind("SigBlk:", 0) == 0) count += (std::stoull(line.substr(7), nullptr, 16) >> (SIGINT - 1) & 1) == 0;
  }
  return count;
}

TEST_F(BrokerTest, has_no_thread_for_signals_of_the_program) {
  const int before = threads_for_signals();
  EXPECT_GT(before, 0);
  const Broker broker(options("one"));
  EXPECT_EQ(threads_for_signals(), before);
}

TEST_F(BrokerTest, ends_with_its_parent) {
  int pipes[2];
  ASSERT_EQ(pipe(pipes), 0);
  const pid_t parent = fork();
  if (parent == 0) {
    try {
      const Broker broker(options());
      const int process = broker.process();
      if (write(pipes[1], &process, sizeof process) == sizeof process) pause();
    } catch (...) {}
    _exit(1);
  }
  int process = 0;
  ASSERT_EQ(read(pipes[0], &process, sizeof process), static_cast<ssize_t>(sizeof process));
  EXPECT_EQ(::kill(process, 0), 0);
  ::kill(parent, SIGKILL);
  waitpid(parent, nullptr, 0);
  const auto is_gone = [&] {  // or waits for who inherited it
    std::ifstream file("/proc/" + std::to_string(process) + "/stat");
    std::string text;
    std::getline(file, text);
    return text.empty() || text.find(") Z") != std::string::npos;
  };
  EXPECT_TRUE(soon(is_gone));
  close(pipes[0]);
  close(pipes[1]);
}

TEST_F(NatsConnectionTest, carries_messages_to_inboxes) {
  Broker broker(options());
  const auto one = connect(broker), two = connect(broker);
  struct Came {
    std::mutex mutex;
    std::vector<std::string> all;
  };
  const auto came = std::make_shared<Came>();  // a call that has begun may outlive the inbox
  const auto inbox = one->open_inbox(
      [came](const NatsMessage& message) {
        const std::lock_guard lock(came->mutex);
        if (!message.subject.empty())
          came->all.push_back(message.subject.substr(message.subject.rfind('.') + 1) + message.bytes);
      },
      InboxKind::answers);
  EXPECT_TRUE(soon([&] {  // the broker may not know of the inbox yet
    two->publish(inbox->subject() + ".x", "first");
    const std::lock_guard lock(came->mutex);
    return !came->all.empty();
  }));
  {
    const std::lock_guard lock(came->mutex);
    EXPECT_EQ(came->all.front(), "xfirst");
  }
  const auto nobody = two->request("nobody.listens", "", 10s);
  ASSERT_TRUE(nobody);
  EXPECT_EQ(nobody->status, 503);
  EXPECT_LT(*one->state().silent_s, 10.0);
}

TEST_F(NatsConnectionTest, is_made_again_after_the_broker_was_killed_or_the_wire_cut) {
  Broker broker(options());
  const auto connection = connect(broker);
  const auto changes = std::make_shared<std::atomic<int>>(0);
  const auto inbox = connection->open_inbox(
      [changes](const NatsMessage& message) { *changes += message.subject.empty() ? 1 : 0; }, InboxKind::answers);
  connection->cut();
  EXPECT_TRUE(soon([&] { return connection->state().connects == 2 && connection->state().is_connected; }));
  broker.kill();
  EXPECT_TRUE(soon([&] { return !connection->state().is_connected; }));
  EXPECT_FALSE(connection->publish("somewhere", "")) << "says so";
  EXPECT_EQ(error_of([&] { connection->wait_until_connected(10ms); }).code(), ErrorCode::kMissing);
  EXPECT_FALSE(connection->state().trouble.empty());
  EXPECT_GT(*connection->state().silent_s, 0.0);
  broker.start();
  connection->wait_until_connected(20s);
  EXPECT_EQ(connection->state().connects, 3U);
  EXPECT_TRUE(soon([&] { return *changes == 4; })) << "lost and made, twice";
  EXPECT_TRUE(connection->publish("somewhere", ""));
}

TEST_F(NatsConnectionTest, asks_for_jet_stream_again_where_the_wire_is_cut) {
  Broker broker(options());
  const auto connection = connect(broker);
  for (int i = 0; i < 5; ++i) {
    connection->cut();
    EXPECT_NO_THROW(connection->expect_jet_stream(20s));
  }
}

TEST_F(NatsConnectionTest, says_that_a_broker_is_absent_or_has_no_jet_stream) {
  NatsOptions nowhere;
  nowhere.url = "nats://user:secret@127.0.0.1:1";
  const NatsConnection none(nowhere);
  EXPECT_THROW(none.wait_until_connected(10ms), BrokerAway);
  const Error error = error_of([&] { none.wait_until_connected(300ms); });
  EXPECT_EQ(error.code(), ErrorCode::kMissing);
  EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("127.0.0.1:1"), testing::Not(HasSubstr("secret"))));
  auto plain = options();
  plain.has_jet_stream = false;
  Broker broker(plain);
  const auto connection = connect(broker);
  const Error without = error_of([&] { connection->expect_jet_stream(10s); });
  EXPECT_EQ(without.code(), ErrorCode::kUnsupported);
  EXPECT_THAT(without.what(), testing::AllOf(HasSubstr("no JetStream"), HasSubstr("-js")));
}

TEST_F(NatsConnectionTest, says_that_a_password_is_wrong_and_connects_when_it_is_right) {
  auto guarded = options();
  guarded.users = {{"robot", "right one", {}, {}}};
  Broker broker(guarded);
  NatsOptions wrong;
  wrong.url = broker.url();
  wrong.user = "robot";
  wrong.password = "wrong";
  const NatsConnection connection(wrong);
  const Error error = error_of([&] { connection.wait_until_connected(1s); });
  EXPECT_EQ(error.code(), ErrorCode::kBadInput) << error.what();
  EXPECT_THAT(error.what(), HasSubstr("check user, password"));
  wrong.password = "right one";
  const auto right = connect(broker, wrong);
  right->expect_jet_stream(10s);

  broker.stop();  // its operator changes the password, and changes it back
  guarded.users[0].password = "other";
  guarded.port = std::stoi(broker.url().substr(broker.url().rfind(':') + 1));
  broker = Broker(guarded);
  EXPECT_TRUE(soon([&] { return right->state().trouble.find("uthorization") != std::string::npos; }))
      << right->state().trouble;
  broker.stop();
  guarded.users[0].password = wrong.password;
  broker = Broker(guarded);
  right->wait_until_connected(20s);
}

TEST_F(NatsConnectionTest, needs_the_certificates_that_the_broker_asks_for) {
  const std::string folder = folder_.path().string();
  const auto run = [&](const std::string& command) {
    return std::system(("cd " + folder + " && " + command + " >> openssl.log 2>&1").c_str()) == 0;
  };
  const std::string made = "openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 2 ";
  if (!run(made + "-keyout ca.key -out ca.pem -subj /CN=tests -addext basicConstraints=critical,CA:TRUE") ||
      !run(made + "-keyout one.key -out one.pem -subj /CN=localhost -addext subjectAltName=IP:127.0.0.1,DNS:localhost "
                  "-CA ca.pem -CAkey ca.key -addext basicConstraints=critical,CA:FALSE"))
    GTEST_SKIP() << "needs the program openssl, 3.0 or newer";
  auto guarded = options();
  guarded.certificate = folder + "/one.pem";
  guarded.key = folder + "/one.key";
  guarded.ca = folder + "/ca.pem";
  Broker broker(guarded);
  NatsOptions right;
  right.ca = folder + "/ca.pem";
  right.certificate = folder + "/one.pem";
  right.key = folder + "/one.key";
  EXPECT_TRUE(connect(broker, right)->state().is_connected);
  NatsOptions without;
  without.url = broker.url();
  const NatsConnection stranger(without);
  EXPECT_EQ(error_of([&] { stranger.wait_until_connected(1s); }).code(), ErrorCode::kBadInput);
  without.ca = folder + "/none.pem";
  const Error error = error_of([&] { NatsConnection never(without); });
  EXPECT_EQ(error.code(), ErrorCode::kBadInput);
  EXPECT_THAT(error.what(), HasSubstr("none.pem"));
}

}  // namespace
}  // namespace mapweave::transport
