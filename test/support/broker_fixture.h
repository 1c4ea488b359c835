#pragma once
// Brokers of a test's own, on loopback and free ports.

#include <mapweave/core/error.h>
#include <mapweave/transport/broker.h>
#include <mapweave/transport/nats_connection.h>
#include <support/temporary_folder.h>

#include <gmock/gmock.h>

#include <thread>

namespace mapweave::transport {

using namespace std::chrono_literals;

inline bool has_broker() {
  try {
    find_broker();
  } catch (const Error&) {
    return false;
  }
  return true;
}

// Whether it becomes true in time; tests of a busy machine wait for what happens, not for a time.
template <class Condition>
bool soon(const Condition& condition, std::chrono::milliseconds patience = 20s) {
  const auto until = std::chrono::steady_clock::now() + patience;
  while (!condition()) {
    if (std::chrono::steady_clock::now() > until) return false;
    std::this_thread::sleep_for(2ms);
  }
  return true;
}

class WithBroker : public testing::Test {
 protected:
  void SetUp() override {
    if (!has_broker()) GTEST_SKIP() << "needs nats-server (Debian's package of that name)";
  }

  BrokerOptions options(const std::string& name = "broker") const {
    BrokerOptions made;
    made.folder = folder_.path() / name;
    made.name = name;
    return made;
  }
  static std::shared_ptr<NatsConnection> connect(const Broker& broker, NatsOptions options = {}) {
    options.url = broker.url();
    auto connection = std::make_shared<NatsConnection>(options);
    connection->wait_until_connected(20s);
    return connection;
  }

  test::TemporaryFolder folder_;
};

template <class Call>
Error error_of(const Call& call) {
  try {
    call();
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "an error was expected";
  return Error(ErrorCode::kInternal, "none");
}

}  // namespace mapweave::transport
