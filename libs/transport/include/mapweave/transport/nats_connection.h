#pragma once
// A program's connection to a NATS server (its broker): made anew for ever, and watched. Streams (nats_stream.h) and
// channels (nats_channel.h) share one. Protocol: https://docs.nats.io/reference/reference-protocols.

#include <mapweave/core/error.h>

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace mapweave::transport {

struct NatsOptions {
  std::string url = "nats://127.0.0.1:4222";
  std::string user, password, token;
  std::string ca, ca_text, certificate, key;
  std::string inbox = "_INBOX";
  double connect_s = 5.0;
  double least_wait_s = 0.1, most_wait_s = 5.0;
  double silence_s = 15.0;

  template <class Visitor>
  void describe(Visitor& v) {
    v.text("url", url,
           "where the broker listens: nats://host:port, or tls://host:port; several are separated by commas");
    v.text("user", user, "name of the account's user; empty: none");
    v.text("password", password, "password of the account's user");
    v.text("token", token, "token in place of user and password; empty: none");
    v.text("ca", ca, "PEM file with the certificates that the broker's must be signed by; turns TLS on");
    v.text("ca_text", ca_text,
           "certificates that the broker's must be signed by, as PEM text in place of the file ca; turns TLS on");
    v.text("inbox", inbox, "what subjects begin with on which answers come: those that the user may receive");
    v.text("certificate", certificate, "PEM file with this program's certificate, for brokers that ask for one");
    v.text("key", key, "PEM file with the private key of the certificate");
    v.number("connect_s", connect_s, 0.1, 60.0, "longest time in seconds that one attempt to connect may take");
    v.number("least_wait_s", least_wait_s, 0.01, 60.0, "seconds until the second attempt to connect; doubled by each");
    v.number("most_wait_s", most_wait_s, 0.01, 600.0, "longest time in seconds between attempts to connect");
    v.number("silence_s", silence_s, 1.0, 600.0,
             "seconds without a sign of the broker after which the connection is given up and made anew");
  }
};

// What an operator wants to know of a connection.
struct NatsState {
  bool is_connected = false;
  std::string server;                           // that it is connected to, or shall be; without a password
  std::optional<double> connected_s, silent_s;  // since then; since anything came, also if it is not connected any more
  std::uint64_t connects = 0;                   // so often: one more than reconnects
  std::string trouble;                          // the last one, also if it has passed
};

struct NatsMessage {
  std::string subject, reply, bytes;
  int status = 0;  // 0: a message; else the broker's own, as of HTTP: 404, 408, 409; 503: nobody listens there
  std::string description;
};

// answers: to requests and publications; also to subjects below it ("<subject>.<token>"). deliveries: of a consumer.
enum class InboxKind { answers, deliveries };
class NatsInbox {
 public:
  // No call of the handler begins any more. One that has begun is not waited for, as it may wait for a lock of who
  // destroys this: what a handler uses it must own, or find gone (std::weak_ptr).
  virtual ~NatsInbox() = default;
  virtual const std::string& subject() const = 0;
};

// All calls are thread-safe. A thread of its own connects and hands over what comes, one message after the other.
// The broker does not answer now; it may later, and nothing else has to change. Its code is kMissing.
class BrokerAway : public Error {
 public:
  BrokerAway(std::string what, std::string where, std::string remedy)
      : Error(ErrorCode::kMissing, std::move(what), std::move(where), std::move(remedy)) {}
};

class NatsConnection {
 public:
  // Returns at once. Throws Error(kBadInput) for options that can never work: a certificate that cannot be read.
  explicit NatsConnection(NatsOptions options);
  // Streams, channels and inboxes of it must be gone.
  ~NatsConnection();
  NatsConnection(const NatsConnection&) = delete;
  NatsConnection& operator=(const NatsConnection&) = delete;

  NatsState state() const;
  // Changes with each connection that is made or lost: what was under way on the one before is lost.
  std::uint64_t generation() const;
  // Throws Error where it takes longer: kBadInput for a wrong user, password, token or certificate, else BrokerAway.
  void wait_until_connected(std::chrono::milliseconds patience) const;
  // Throws Error: kUnsupported where the broker has no JetStream, or not for this account; BrokerAway where it does not
  // answer. domain: of another broker that this one is connected to; empty: its own.
  void expect_jet_stream(std::chrono::milliseconds patience, const std::string& domain = {});

  // The handler is called on the connection's thread and must not wait. It is called with an empty message after each
  // change of generation().
  std::unique_ptr<NatsInbox> open_inbox(std::function<void(const NatsMessage&)> handler, InboxKind kind);
  // Soon, on the connection's thread.
  void post(std::function<void()> work);
  // false: there is no connection. May wait for a socket that is full. message_id: by which a stream knows repetitions.
  bool publish(const std::string& subject, std::string_view bytes, const std::string& reply = {},
               const std::string& message_id = {});
  // The first answer; nullopt: none came in time. Not for the connection's own thread (contract).
  std::optional<NatsMessage> request(const std::string& subject, std::string_view bytes,
                                     std::chrono::milliseconds patience, const std::string& message_id = {});
  // Whether the caller is the connection's thread, which must not wait.
  bool is_own_thread() const;
  // Lets go of the connection, which is made anew: as if the wire had been cut.
  void cut();

 private:
  struct State;
  std::shared_ptr<State> state_;
};

}  // namespace mapweave::transport
