#include <mapweave/core/error.h>
#include <mapweave/runtime/nats_wires.h>
#include <mapweave/transport/nats_channel.h>

#include <algorithm>

namespace mapweave::runtime {
namespace {

constexpr std::size_t kLongestMessage = std::size_t{64} << 20;

// Names of streams have no dots.
std::string stream_name(const std::string& name) {
  std::string made = name;
  std::replace(made.begin(), made.end(), '.', '_');
  return made;
}

// All of a wire is in one class, so that it comes in the order in which it was said.
transport::NatsChannelOptions options_of(const std::string& wire, const std::string& peer,
                                         transport::NatsChannelSide side) {
  transport::NatsChannelOptions options;
  options.peer = peer;
  options.side = side;
  options.out = {wire + "_up", {}};
  options.in = {wire + "_down", {}};
  if (side == transport::NatsChannelSide::accepts) std::swap(options.out, options.in);
  return options;
}

// A robot's whole map is one message.
transport::NatsChannelOptions with_maps(transport::NatsChannelOptions options) {
  options.limits.bytes = kLongestMessage;
  options.received.message_bytes = kLongestMessage;
  return options;
}

Connect connect(const std::shared_ptr<transport::NatsConnection>& connection, transport::NatsChannelOptions options) {
  return [connection, options = std::move(options)]() -> std::shared_ptr<transport::Channel> {
    return std::make_shared<transport::NatsChannel>(connection, options);
  };
}

std::string of_edge(const TierId& edge) { return "edge_" + stream_name(edge.str()); }
std::string of_cloud(const TierId& edge) { return "cloud_" + stream_name(edge.str()); }

}  // namespace

NatsWires::NatsWires(const std::string& broker, std::chrono::milliseconds patience) {
  transport::NatsOptions options;
  options.url = broker;
  connection_ = std::make_shared<transport::NatsConnection>(options);
  connection_->wait_until_connected(patience);
  connection_->expect_jet_stream(patience);
}

Connect NatsWires::from_robot(const RobotId& robot, const TierId& edge) const {
  return connect(connection_, options_of(of_edge(edge), robot.str(), transport::NatsChannelSide::opens));
}
Connect NatsWires::at_edge(const RobotId& robot, const TierId& edge) const {
  return connect(connection_, options_of(of_edge(edge), robot.str(), transport::NatsChannelSide::accepts));
}
Connect NatsWires::from_edge(const TierId& edge) const {
  return connect(connection_, with_maps(options_of(of_cloud(edge), edge.str(), transport::NatsChannelSide::opens)));
}
Connect NatsWires::at_cloud(const TierId& edge) const {
  return connect(connection_, with_maps(options_of(of_cloud(edge), edge.str(), transport::NatsChannelSide::accepts)));
}

void ServedWires::keep() {
  for (Wire& wire : wires_)
    if (wire.channel == nullptr || wire.channel->is_closed()) {
      wire.channel = wire.accept();
      serve_(wire.channel);
    }
}

}  // namespace mapweave::runtime
