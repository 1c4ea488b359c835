#pragma once
// The channels of a deployment over its NATS brokers: which streams each wire uses, and what keeps them open.
//
// One broker, or a hub at the cloud and leaf nodes at edges (EdgeEntry::broker). A leaf node has a JetStream domain of
// its own: an edge and its robots go on while the hub is away, and the cloud pulls from the edge's stream.

#include <mapweave/runtime/live_cloud.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/transport/nats_board.h>
#include <mapweave/transport/nats_channel.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::runtime {

// The domain of an edge's own broker; empty: it has none of its own.
std::string domain_of(const EdgeEntry& edge);
constexpr char kHubDomain[] = "cloud";  // of live.broker, where edges have brokers of their own

// All calls are thread-safe.
class NatsWires {
 public:
  // Of a robot or an edge: over the edge's broker.
  NatsWires(const RunConfiguration& configuration, const TierId& edge, std::chrono::milliseconds patience)
      : NatsWires(configuration, live_at(configuration, edge), patience) {}
  // Of the cloud, and of all programs of one machine.
  NatsWires(const RunConfiguration& configuration, std::chrono::milliseconds patience)
      : NatsWires(configuration, configuration.live, patience) {}

  // By `broker`, `keys` and `unprotected`. Throws Error: BrokerAway where the broker does not answer in time,
  // kUnsupported where it has no JetStream, kBadInput for an address that cannot be, for keys that it does not accept
  // or that are none, and for another machine without keys, unless it may be unprotected.
  NatsWires(const RunConfiguration& configuration, const LiveOptions& live, std::chrono::milliseconds patience);

  // Ends that open: for LiveRobot, and for LiveEdge.
  Connect from_robot(const RobotId& robot, const TierId& edge) const;
  Connect from_camera(const RobotId& robot, int number, const TierId& edge) const;  // numbered as ConnectCamera says
  Connect from_edge(const TierId& edge) const;
  // Ends that accept.
  Connect at_edge(const RobotId& robot, const TierId& edge) const;
  Connect at_map_server(const RobotId& robot, int number, const TierId& edge) const;
  Connect at_cloud(const TierId& edge) const;

  // Where every program of the deployment says how it is (program_status), under the name that its user has or would
  // have ("robot-alpha", "edge-north", "cloud"). Made by edges, the cloud, and who has no accounts.
  transport::NatsBoard board() const;
  // Between a run and a worker; workers say on a board that they are there.
  Connect to_worker(const std::string& worker) const;
  Connect at_worker(const std::string& worker) const;
  transport::NatsBoard board_of_workers() const;

  // As the own broker of an edge keeps it, for who is connected to live.broker; nullopt: the edge has none.
  std::optional<transport::NatsBoard> board_of(const TierId& edge) const;
  // Where the coordinator says which robot has which edge (LivePlan), under "coordinator"; it alone makes it.
  transport::NatsBoard plans() const;

 private:
  std::string domain_at(const TierId& edge) const;
  Connect between_tiers(const TierId& edge, transport::NatsChannelSide side) const;

  Connect of_camera(const RobotId& robot, int number, const TierId& edge, transport::NatsChannelSide side) const;

  std::shared_ptr<transport::NatsConnection> connection_;
  std::size_t camera_queue_bytes_ = 0;
  std::vector<EdgeEntry> edges_;
};

// Channels that one program serves: each is made anew where it was closed. Not thread-safe.
class ServedWires {
 public:
  // serve: as LiveEdge's or LiveCloud's. Each wire has a name.
  explicit ServedWires(std::function<void(std::shared_ptr<transport::Channel>)> serve) : serve_(std::move(serve)) {}
  void add(const std::string& name, Connect accept) { wires_.try_emplace(name, Wire{std::move(accept), nullptr}); }
  void remove(const std::string& name);  // closed
  void keep();                           // now and then

 private:
  struct Wire {
    Connect accept;
    std::shared_ptr<transport::Channel> channel;
  };
  std::function<void(std::shared_ptr<transport::Channel>)> serve_;
  std::map<std::string, Wire> wires_;
};

// Wires of the cameras of an edge's robots, where they share while they drive: nobody says beforehand how many a robot
// has, so each has one more than have come. Not thread-safe.
class CameraWires {
 public:
  CameraWires(const NatsWires& wires, const TierId& edge, LiveEdge& server);
  void add(const RobotId& robot);
  void keep();  // now and then

 private:
  struct Robot {
    explicit Robot(std::function<void(std::shared_ptr<transport::Channel>)> serve) : wires(std::move(serve)) {}
    ServedWires wires;
    std::size_t count = 0;
  };
  const NatsWires& wires_;
  const TierId edge_;
  LiveEdge& server_;
  std::map<RobotId, Robot> robots_;
  std::chrono::steady_clock::time_point next_{};
};

}  // namespace mapweave::runtime
