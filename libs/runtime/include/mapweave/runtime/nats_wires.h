#pragma once
// The channels of a deployment over one NATS broker: which streams each wire uses, and what keeps them open.

#include <mapweave/runtime/live_cloud.h>
#include <mapweave/transport/nats_board.h>

#include <map>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::runtime {

// All calls are thread-safe.
class NatsWires {
 public:
  // By `broker`, `keys` and `unprotected`. Throws Error: kMissing where the broker does not answer in time,
  // kUnsupported where it has no JetStream, kBadInput for an address that cannot be, for keys that it does not accept
  // or that are none, and for another machine without keys, unless it may be unprotected.
  NatsWires(const LiveOptions& options, std::chrono::milliseconds patience);

  // Ends that open: for LiveRobot, and for LiveEdge.
  Connect from_robot(const RobotId& robot, const TierId& edge) const;
  Connect from_edge(const TierId& edge) const;
  // Ends that accept.
  Connect at_edge(const RobotId& robot, const TierId& edge) const;
  Connect at_cloud(const TierId& edge) const;

  // Where every program of the deployment says how it is (program_status), under the name that its user has or would
  // have ("robot-alpha", "edge-north", "cloud"). Made by edges, the cloud, and who has no accounts.
  transport::NatsBoard board() const;
  // Where the coordinator says which robot has which edge (LivePlan), under "coordinator"; it alone makes it.
  transport::NatsBoard plans() const;

 private:
  std::shared_ptr<transport::NatsConnection> connection_;
  bool has_accounts_ = false;
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

}  // namespace mapweave::runtime
