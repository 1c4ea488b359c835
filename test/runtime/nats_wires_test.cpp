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

// A broker sets aside for each stream what it may hold, and refuses the last ones where its store has no room.
TEST_F(NatsWiresTest, of_many_edges_and_cameras_find_room_in_a_store_of_the_size_they_ask_for) {
  RunConfiguration configuration;
  RunPlan plan;
  configuration.server.share = tiers::Sharing::view;
  for (int i = 0; i < 12; ++i) plan.edges.emplace_back("e" + std::to_string(i));
  for (int i = 0; i < 40; ++i) configuration.robots.emplace_back();
  transport::BrokerOptions small = options("small"), large = options("large");
  small.most_store_bytes = store_bytes(configuration, plan) / 2;
  large.most_store_bytes = store_bytes(configuration, plan);
  const auto troubles = [&](const transport::BrokerOptions& of) {
    const transport::Broker broker(of);
    configuration.live.broker = broker.url();
    const NatsWires wires(configuration, 20s);
    std::vector<std::shared_ptr<transport::Channel>> all;
    for (const TierId& edge : plan.edges) {
      all.push_back(wires.at_edge(RobotId("alpha"), edge)());
      all.push_back(wires.at_cloud(edge)());
      all.push_back(wires.at_camera_map_server(RobotId("alpha"), 0, edge)());
    }
    all.push_back(wires.at_worker("one")());
    const auto connection = connect(broker);
    const auto is_made = [&](const std::string& name) {
      transport::StreamOptions one;
      one.name = name;
      return transport::NatsStream(connection, one).state(10s).has_value();
    };
    std::set<std::string> found;
    EXPECT_TRUE(soon([&] {
      bool is_settled = true;
      for (const auto& channel : all) {
        const auto health = channel->health();
        if (!health.trouble.empty()) found.insert(health.trouble);
      }
      for (const TierId& edge : plan.edges)
        for (const char* wire : {"edge_", "cloud_", "cameras_"})
          is_settled = is_settled && is_made(wire + edge.str() + "_up_0") && is_made(wire + edge.str() + "_down_0");
      return !found.empty() || (is_settled && is_made("work_down_0"));
    }));
    return found;
  };
  EXPECT_THAT(troubles(large), testing::IsEmpty());
  EXPECT_THAT(troubles(small), testing::Contains(testing::HasSubstr("insufficient storage")));
}

}  // namespace
}  // namespace mapweave::runtime
