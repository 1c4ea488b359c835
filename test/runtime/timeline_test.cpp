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
  network.robot_edge.bytes_per_s = 1e6;
  network.robot_cloud.bytes_per_s = 1e5;
  network.edge_cloud.bytes_per_s = 5e5;
  return network;
}

TimelineOptions with(Mode mode, const NetworkOptions& network, const ProcessorOptions& processors = {}) {
  TimelineOptions options;
  options.mode = mode;
  options.network = network;
  options.processors = processors;
  return options;
}

TEST(Timeline, adds_what_edges_wait_for) {
  ProcessorOptions processors;
  processors.robot = 0.5;
  processors.edge = 2.0;
  const Timeline line = timeline(with(Mode::offload, wires(), processors), two_robots());
  ASSERT_EQ(line.robots.size(), 2U);
  EXPECT_NEAR(line.robots[0].packed_s, 2.0, 1e-9);
  EXPECT_NEAR(line.robots[0].arrived_s, 3.0, 1e-6);
  EXPECT_NEAR(line.robots[0].mapped_s, 8.0, 1e-6);
  EXPECT_NEAR(line.robots[1].mapped_s, 4.0 + 2.0 + 10.0, 1e-6);
  EXPECT_NEAR(line.robots[1].load, 0.04, 1e-9);
  ASSERT_EQ(line.edges.size(), 2U);
  EXPECT_NEAR(line.edges[0].arrived_s, 8.0 + 1.5 + 0.2, 1e-6) << "the map is there already";
  EXPECT_NEAR(line.edges[1].arrived_s, 16.0 + 2.0 + 0.2, 1e-6);
  EXPECT_NEAR(line.total_s, 18.2 + 5.0, 1e-6);
}

TEST(Timeline, has_robots_map_where_no_edge_does) {
  ProcessorOptions processors;
  processors.robot = 0.5;
  const Timeline onboard = timeline(with(Mode::onboard, wires(), processors), two_robots());
  EXPECT_NEAR(onboard.robots[1].mapped_s, 40.0, 1e-9);
  EXPECT_NEAR(onboard.robots[1].arrived_s, 40.4, 1e-6);
  EXPECT_NEAR(onboard.robots[1].load, 0.4, 1e-9);
  EXPECT_NEAR(onboard.total_s, 40.4 + 4.0 + 0.2 + 5.0, 1e-6);
  Work work = two_robots();
  work.edges.clear();
  const Timeline alone = timeline(with(Mode::cloud_only, wires(), processors), work);
  EXPECT_NEAR(alone.robots[1].arrived_s, 44.0, 1e-6);
  EXPECT_NEAR(alone.total_s, 44.0 + 5.0, 1e-6);
}

TEST(Timeline, takes_the_wire_that_is_named) {
  NetworkOptions network = wires();
  LinkEntry slow;
  slow.from = "alpha";
  slow.to = "north";
  slow.bytes_per_s = 1e5;
  network.links = {slow};
  const Timeline line = timeline(with(Mode::offload, network), two_robots());
  EXPECT_NEAR(line.robots[0].arrived_s, 1.0 + 10.0, 1e-6);
  EXPECT_NEAR(line.robots[1].arrived_s, 2.0 + 2.0, 1e-6);
}

TEST(Timeline, joins_at_an_edge_where_there_is_no_cloud_and_sends_to_robots) {
  TimelineOptions options = with(Mode::offload, wires());
  options.cloud.at = "south";
  Work work = two_robots();
  work.edges[1].speed = 2.0;
  work.pushes = {{RobotId("alpha"), 1'000'000}};
  const Timeline line = timeline(options, work);
  EXPECT_NEAR(line.edges[1].fused_s, 2.0 + 2.0 + 10.0 + 2.0, 1e-6) << "an edge of twice the speed";
  EXPECT_EQ(line.edges[1].arrived_s, line.edges[1].fused_s) << "it is there";
  EXPECT_NEAR(line.edges[0].arrived_s, 1.0 + 1.0 + 10.0 + 3.0 + 0.2, 1e-6);
  EXPECT_NEAR(line.total_s, 16.0 + 2.5, 1e-6);
  ASSERT_EQ(line.pushes.size(), 1U);
  EXPECT_NEAR(line.pushes[0].arrived_s, 18.5 + 1.0, 1e-6);
}

TEST(Timeline, sends_maps_once_all_are_there_to_edges_that_have_fused_their_own) {
  Work work = two_robots();
  work.edges[0].sent_bytes = 500'000;
  work.edges[0].judging_s = 2.0;
  work.edges[0].judged_bytes = 50'000;
  work.planning_s = 1.5;
  const double all_there_s = 2.0 + 2.0 + 20.0 + 0.8, sent_s = all_there_s + 1.5 + 1.0;
  Timeline line = timeline(with(Mode::offload, wires()), work);
  EXPECT_NEAR(line.edges[0].judged_s, sent_s + 2.0 + 0.1, 1e-6);
  EXPECT_NEAR(line.edges[1].arrived_s, 24.0 + 4.0 + 0.2, 1e-6) << "fused while the other judged";
  EXPECT_EQ(line.edges[1].judged_s, 0.0);
  EXPECT_NEAR(line.total_s, line.edges[0].judged_s + 5.0 - 1.5, 1e-6);
  work.edges[0].fusing_s = 40.0;
  line = timeline(with(Mode::offload, wires()), work);
  EXPECT_NEAR(line.edges[0].judged_s, 12.0 + 40.0 + 2.0 + 0.1, 1e-6);
}

TEST(Timeline, knows_common_processors) {
  ProcessorOptions processors;
  processors.robot_profile = transport::ProcessorProfile::raspberry_pi_3b_plus;
  processors.robot = 2.0;
  EXPECT_NEAR(timeline(with(Mode::offload, wires(), processors), two_robots()).robots[0].packed_s, 1.0 / 0.24, 1e-9);
}

TEST(Timeline, has_a_robot_without_an_edge_map_on_board) {
  Work work = two_robots();
  work.robots[0].edge = TierId();
  work.edges.erase(work.edges.begin());
  const Timeline line = timeline(with(Mode::offload, wires()), work);
  EXPECT_NEAR(line.robots[0].mapped_s, 10.0, 1e-9);
  EXPECT_NEAR(line.robots[0].arrived_s, 12.0, 1e-6) << "over its wire to the cloud";
  EXPECT_NEAR(line.robots[1].mapped_s, 24.0, 1e-6);
  EXPECT_NEAR(line.total_s, 24.0 + 4.0 + 0.2 + 5.0, 1e-6);
}

}  // namespace
}  // namespace mapweave::runtime
