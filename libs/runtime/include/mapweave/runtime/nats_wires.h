#pragma once
// The channels of a deployment over its NATS brokers: which streams each wire uses.
//
// One broker, or a hub at the cloud and leaf nodes at edges (EdgeEntry::broker). A leaf node has a JetStream domain of
// its own: an edge and its robots go on while the hub is away, and the cloud pulls from the edge's stream.

#include <mapweave/runtime/run_configuration.h>
#include <mapweave/runtime/wires.h>
#include <mapweave/transport/nats_board.h>
#include <mapweave/transport/nats_channel.h>

#include <memory>
#include <string>
#include <vector>

namespace mapweave::runtime {

// The domain of an edge's own broker; empty: it has none of its own.
std::string domain_of(const EdgeEntry& edge);
constexpr char kHubDomain[] = "cloud";  // domain of live.broker where edges have their own brokers

// What the streams of a deployment with these edges may hold together at one broker, which refuses to make the last
// ones where its store is smaller.
std::uint64_t store_bytes(const RunConfiguration& configuration, const RunPlan& plan);

class NatsWires : public Wires {
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

  Connect from_robot(const RobotId& robot, const TierId& edge) const override;
  Connect from_camera(const RobotId& robot, int number, const TierId& edge) const override;
  Connect from_edge(const TierId& edge) const override;
  Connect at_edge(const RobotId& robot, const TierId& edge) const override;
  Connect at_camera_map_server(const RobotId& robot, int number, const TierId& edge) const override;
  Connect at_cloud(const TierId& edge) const override;
  std::shared_ptr<transport::Board> board() const override;
  std::shared_ptr<transport::Board> plans() const override;

  // Between a run and a worker; workers say on a board that they are there.
  Connect to_worker(const std::string& worker) const;
  Connect at_worker(const std::string& worker) const;
  transport::NatsBoard board_of_workers() const;

  // As the own broker of an edge keeps it, for who is connected to live.broker; nullopt: the edge has none.
  std::optional<transport::NatsBoard> board_of(const TierId& edge) const;

 private:
  std::string domain_at(const TierId& edge) const;
  Connect between_tiers(const TierId& edge, transport::NatsChannelSide side) const;

  Connect of_robot(const RobotId& robot, const TierId& edge, transport::NatsChannelSide side) const;
  Connect of_camera(const RobotId& robot, int number, const TierId& edge, transport::NatsChannelSide side) const;
  Connect of_work(const std::string& worker, transport::NatsChannelSide side) const;

  std::shared_ptr<transport::NatsConnection> connection_;
  std::size_t camera_queue_bytes_ = 0;
  std::uint64_t robot_stream_ = 0;
  std::vector<EdgeEntry> edges_;
};

}  // namespace mapweave::runtime
