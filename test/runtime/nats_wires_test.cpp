#include <mapweave/runtime/nats_wires.h>
#include <mapweave/transport/nats_stream.h>
#include <support/broker_fixture.h>

namespace mapweave::runtime {
namespace {

using namespace std::chrono_literals;
using transport::soon;

class NatsWiresTest : public transport::WithBroker {
 protected:
  static RunConfiguration configuration_at(const transport::Broker& broker) {
    RunConfiguration configuration;
    configuration.live.broker = broker.url();
    return configuration;
  }
};

// Else the edge of a robot that comes after minutes would see its first scan seconds late.
TEST_F(NatsWiresTest, are_listened_to_before_who_opens_them_comes) {
  transport::Broker broker(options());
  const NatsWires wires(configuration_at(broker), 20s);
  const auto at_edge = wires.at_edge(RobotId("alpha"), TierId("north"))();
  transport::ConsumerOptions listens;
  listens.stream = "edge_north_up_0";
  listens.name = "alpha";
  const auto connection = connect(broker);
  const transport::NatsConsumer consumer(connection, listens);
  EXPECT_TRUE(soon([&] {
    const auto state = consumer.state(10s);
    return state && state->readers > 0;
  })) << "it asks for the first message";
  const auto robot = wires.from_robot(RobotId("alpha"), TierId("north"))();
  ASSERT_EQ(robot->send({"sensed", "a scan", {}, 0, false}), transport::Channel::Sent::taken);
  std::vector<transport::Channel::Delivery> came;
  EXPECT_TRUE(soon([&] { return !(came = at_edge->receive(10ms)).empty(); }));
  ASSERT_EQ(came.size(), 1U);
  EXPECT_EQ(came.front().envelope.bytes, "a scan");
}

}  // namespace
}  // namespace mapweave::runtime
