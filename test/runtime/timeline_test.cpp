#include <gtest/gtest.h>
#include <mapweave/runtime/timeline.h>

namespace mapweave::runtime {
namespace {

Work two_robots() {
  Work work;
  work.robots = {{RobotId("alpha"), TierId("north"), 100.0, 1.0, 10.0, 0.0, 1'000'000, 200'000},
                 {RobotId("beta"), TierId("south"), 100.0, 2.0, 20.0, 0.0, 2'000'000, 400'000}};
  work.edges = {{TierId("north"), 3.0, 300'000}, {TierId("south"), 4.0, 500'000}};
  work.fusing_s = 5.0;
  return work;
}

NetworkOptions wires() {
  NetworkOptions network;
  network.robot_edge.bytes_per_s = 1e6, network.robot_cloud.bytes_per_s = 1e5, network.edge_cloud.bytes_per_s = 5e5;
  return network;
}

TEST(Timeline, adds_what_edges_wait_for) {
  ProcessorOptions processors;
  processors.robot = 0.5, processors.edge = 2.0;
  const Timeline line = timeline(Mode::offload, two_robots(), wires(), processors, 1);
  ASSERT_EQ(line.robots.size(), 2U);
  EXPECT_NEAR(line.robots[0].packed_s, 2.0, 1e-9);
  EXPECT_NEAR(line.robots[0].arrived_s, 3.0, 1e-6);
  EXPECT_NEAR(line.robots[0].mapped_s, 8.0, 1e-6);
  EXPECT_NEAR(line.robots[1].mapped_s, 4.0 + 2.0 + 10.0, 1e-6);
  EXPECT_NEAR(line.robots[1].load, 0.04, 1e-9);
  ASSERT_EQ(line.edges.size(), 2U);
  EXPECT_NEAR(line.edges[0].arrived_s, 8.0 + 1.5 + 0.6, 1e-6);
  EXPECT_NEAR(line.edges[1].arrived_s, 16.0 + 2.0 + 1.0, 1e-6);
  EXPECT_NEAR(line.total_s, 19.0 + 5.0, 1e-6);
}

TEST(Timeline, has_robots_map_where_no_edge_does) {
  ProcessorOptions processors;
  processors.robot = 0.5;
  const Timeline onboard = timeline(Mode::onboard, two_robots(), wires(), processors, 1);
  EXPECT_NEAR(onboard.robots[1].mapped_s, 40.0, 1e-9);
  EXPECT_NEAR(onboard.robots[1].arrived_s, 40.4, 1e-6);
  EXPECT_NEAR(onboard.robots[1].load, 0.4, 1e-9);
  EXPECT_NEAR(onboard.total_s, 40.4 + 4.0 + 1.0 + 5.0, 1e-6);
  Work work = two_robots();
  work.edges.clear();
  const Timeline alone = timeline(Mode::cloud_only, work, wires(), processors, 1);
  EXPECT_NEAR(alone.robots[1].arrived_s, 44.0, 1e-6);
  EXPECT_NEAR(alone.total_s, 44.0 + 5.0, 1e-6);
}

TEST(Timeline, takes_the_wire_that_is_named) {
  NetworkOptions network = wires();
  LinkEntry slow;
  slow.from = "alpha", slow.to = "north", slow.bytes_per_s = 1e5;
  network.links = {slow};
  const Timeline line = timeline(Mode::offload, two_robots(), network, {}, 1);
  EXPECT_NEAR(line.robots[0].arrived_s, 1.0 + 10.0, 1e-6);
  EXPECT_NEAR(line.robots[1].arrived_s, 2.0 + 2.0, 1e-6);
}

}  // namespace
}  // namespace mapweave::runtime
