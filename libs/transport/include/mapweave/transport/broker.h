#pragma once
// A NATS server of this program's own (nats-server, Debian's 2.9 or newer), as a child process on one machine.

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::transport {

struct BrokerUser {
  std::string name, password;
  // Subjects that it may publish and receive, with '*' and '>'; empty: all.
  std::vector<std::string> may_publish, may_receive;
};

struct BrokerOptions {
  std::filesystem::path program;  // empty: nats-server on PATH
  std::filesystem::path folder;   // for its configuration, its log and, below "store", its streams
  std::string host = "127.0.0.1";
  int port = 0;      // 0: a free one
  std::string name;  // of the server; empty: one that it chooses
  bool has_jet_stream = true;
  std::string domain;  // of its JetStream; needed where servers are connected
  std::uint64_t most_store_bytes = std::uint64_t{10} << 30;
  std::uint32_t most_message_bytes = std::uint32_t{1} << 20;
  std::optional<int> leaf_port;                // where edges' servers connect; 0: a free one; nullopt: none may
  std::vector<std::string> hubs;               // leaf_url() of servers that it connects to, and for ever again
  std::vector<BrokerUser> users;               // also edges' servers; empty: who reaches the port may do everything
  std::filesystem::path ca, certificate, key;  // PEM files; with a certificate all connections have TLS, with ca
                                               // clients need one as well
  std::filesystem::path hub_ca;                // PEM file by which it knows its hubs; empty: `ca`
};

// Throws Error(kMissing) where there is none: names the Debian package.
std::filesystem::path find_broker(const std::filesystem::path& program = {});

// The configuration file of a server with these options, for who starts it elsewhere. Paths stand in it as given.
// Contract: a port.
std::string broker_configuration(const BrokerOptions& options);

// Not thread-safe. The child is killed with this process, however it ends.
class Broker {
 public:
  // Writes the configuration, starts it, and waits until it answers. Throws Error: kMissing without the program,
  // kCannotWrite, kHelperFailed where it ends or stays silent, with the last lines of its log.
  explicit Broker(BrokerOptions options, std::chrono::milliseconds patience = std::chrono::seconds(20));
  ~Broker();  // as stop()
  Broker(Broker&&) noexcept;
  Broker& operator=(Broker&&) noexcept;

  std::string url() const;       // for clients, without user and password
  std::string leaf_url() const;  // for `hubs` of other servers, without user and password; contract: leaf_port
  int process() const;           // its id
  bool is_running() const;
  // Asks it to end, and kills it where it does not within a few seconds.
  void stop();
  // As a power cut would, but for what the system keeps of its files (SIGKILL).
  void kill();
  // After stop(), kill() or its own end: again, on the same ports and store. Throws as the constructor.
  void start(std::chrono::milliseconds patience = std::chrono::seconds(20));

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::transport
