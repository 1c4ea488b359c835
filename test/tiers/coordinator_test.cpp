#include <mapweave/core/error.h>
#include <mapweave/tiers/coordinator.h>

#include <gmock/gmock.h>

#include <algorithm>

namespace mapweave::tiers {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

MapSummary corridor(double from_x, double to_x) {
  return scheduling::summary_of_route({{from_x, 0.0}, {to_x, 0.0}}, 3.0);
}

EdgeIs edge(const char* id, double bytes_per_s = 1e6, std::optional<std::uint32_t> capacity = {}) {
  return {TierId(id), bytes_per_s, 1.0, capacity};
}

// Robots a and b drive one corridor, c and d another one.
Coordinator two_corridors(double hysteresis = 0.1, const scheduling::LatencyModel& model = {}) {
  CoordinatorOptions options;
  options.hysteresis = hysteresis;
  options.plan.model = model;
  Coordinator coordinator(options);
  coordinator.receive(edge("north"));
  coordinator.receive(edge("south"));
  coordinator.receive(RobotComes{RobotId("a"), corridor(0, 20), {}});
  coordinator.receive(RobotComes{RobotId("c"), corridor(100, 120), {}});
  coordinator.receive(RobotComes{RobotId("b"), corridor(4, 24), {}});
  coordinator.receive(RobotComes{RobotId("d"), corridor(104, 124), {}});
  return coordinator;
}

TierId at(const Coordinator& coordinator, const char* robot) { return coordinator.edge_of().at(RobotId(robot)); }

TEST(Coordinator, groups_who_announces_the_same_route) {
  Coordinator coordinator = two_corridors();
  const auto decision = coordinator.decide(0.0);
  ASSERT_TRUE(decision);
  EXPECT_TRUE(decision->is_new_plan);
  EXPECT_EQ(decision->moves.size(), 4u);
  EXPECT_EQ(at(coordinator, "a"), at(coordinator, "b"));
  EXPECT_EQ(at(coordinator, "c"), at(coordinator, "d"));
  EXPECT_NE(at(coordinator, "a"), at(coordinator, "c"));
  EXPECT_EQ(decision->cut_weight, 0.0);
  EXPECT_GT(decision->expected_s, 0.0);
  EXPECT_LE(decision->lower_bound_s, decision->expected_s);
  EXPECT_THAT(decision->because, testing::Contains("robot a comes"));
  EXPECT_FALSE(coordinator.decide(1.0)) << "nothing was received";
}

TEST(Coordinator, moves_robots_off_an_edge_that_goes_and_nobody_else) {
  Coordinator coordinator = two_corridors(0.9);
  coordinator.receive(edge("west"));
  coordinator.decide(0.0);
  const auto before = coordinator.edge_of();
  const TierId gone = at(coordinator, "a");
  coordinator.receive(EdgeGoes{gone});
  const auto decision = coordinator.decide(5.0);
  ASSERT_TRUE(decision);
  EXPECT_THAT(decision->because, ElementsAre("edge " + gone.str() + " goes"));
  ASSERT_FALSE(decision->is_new_plan);
  std::size_t homeless = 0;
  for (const auto& [robot, edge] : decision->edge_of) {
    EXPECT_NE(edge, gone);
    EXPECT_FALSE(edge.empty());
    if (before.at(robot) == gone)
      ++homeless;
    else
      EXPECT_EQ(edge, before.at(robot));
  }
  EXPECT_EQ(decision->moves.size(), homeless);
  for (const auto& move : decision->moves) EXPECT_TRUE(move.from.empty());
}

TEST(Coordinator, leaves_where_it_is_what_a_robot_sensed_that_goes) {
  Coordinator coordinator = two_corridors();
  coordinator.decide(0.0);
  const auto before = coordinator.edge_of();
  coordinator.receive(RobotGoes{RobotId("c")});
  const auto decision = coordinator.decide(5.0);
  ASSERT_TRUE(decision);
  EXPECT_THAT(decision->because, ElementsAre("robot c has sensed all"));
  EXPECT_TRUE(decision->moves.empty());
  EXPECT_EQ(coordinator.edge_of(), before);
}

TEST(Coordinator, decides_anew_where_an_edge_changes) {
  Coordinator coordinator = two_corridors();
  coordinator.decide(0.0);
  coordinator.receive(edge("north"));
  EXPECT_FALSE(coordinator.decide(1.0)) << "as it was";
  double now_s = 2.0, before_s = 0.0;
  EdgeIs north = edge("north");
  const auto change = [&](const char* what) {
    coordinator.receive(north);
    const auto decision = coordinator.decide(now_s++);
    ASSERT_TRUE(decision) << what;
    EXPECT_THAT(decision->because, ElementsAre(std::string("edge north changed: ") + what)) << what;
    EXPECT_GT(decision->expected_s, before_s) << what;
    before_s = decision->expected_s;
  };
  north.bytes_per_s = 1e5;
  change("bandwidth 1e+06 -> 100000 bytes/s");
  north.delay_s = 9.0;
  change("delay default -> 9 s");
}

TEST(Coordinator, takes_robots_from_an_edge_that_became_slow) {
  Coordinator coordinator = two_corridors();
  const auto before = coordinator.decide(0.0);
  ASSERT_TRUE(before);
  EdgeIs north = edge("north");
  north.speed = 0.1;
  coordinator.receive(north);
  const auto decision = coordinator.decide(1.0);
  ASSERT_TRUE(decision);
  EXPECT_THAT(decision->because, ElementsAre("edge north changed: speed 1 -> 0.1"));
  const auto on_north = [](const CoordinatorDecision& of) {
    return std::count_if(of.edge_of.begin(), of.edge_of.end(),
                         [](const auto& placed) { return placed.second == TierId("north"); });
  };
  EXPECT_GT(on_north(*before), on_north(*decision));
  EXPECT_LT(decision->expected_s, decision->staying_s);
  EXPECT_GT(decision->staying_s, before->expected_s);
}

TEST(Coordinator, moves_robots_off_an_edge_that_takes_fewer_than_it_holds) {
  Coordinator coordinator = two_corridors(0.9);
  coordinator.decide(0.0);
  coordinator.receive(edge("north", 1e6, 1));
  const auto decision = coordinator.decide(1.0);
  ASSERT_TRUE(decision);
  EXPECT_EQ(decision->moves.size(), 1u);
  int on_north = 0;
  for (const auto& [robot, edge] : decision->edge_of) on_north += edge == TierId("north");
  EXPECT_EQ(on_north, 1);
}

TEST(Coordinator, maps_on_board_where_there_is_no_edge_and_comes_back) {
  Coordinator coordinator = two_corridors();
  coordinator.decide(0.0);
  coordinator.receive(EdgeGoes{TierId("north")});
  coordinator.receive(EdgeGoes{TierId("south")});
  const auto alone = coordinator.decide(1.0);
  ASSERT_TRUE(alone);
  for (const auto& [robot, edge] : alone->edge_of) EXPECT_TRUE(edge.empty()) << robot.str();
  coordinator.receive(edge("south", 1e6, 3));
  const auto decision = coordinator.decide(2.0);
  ASSERT_TRUE(decision);
  int placed = 0;
  for (const auto& [robot, edge] : decision->edge_of) placed += edge == TierId("south");
  EXPECT_EQ(placed, 3) << "as many as it holds";
}

TEST(Coordinator, leaves_robots_where_moving_costs_more_than_it_saves) {
  scheduling::LatencyModel no_cost;  // of sending and mapping again
  no_cost.slam_s_per_scan = no_cost.scan_bytes = no_cost.robot_bytes_fixed = 0.0;
  for (const bool costs : {false, true}) {
    Coordinator coordinator = two_corridors(0.0, costs ? scheduling::LatencyModel() : no_cost);
    coordinator.decide(0.0);
    coordinator.receive(MapReport{RobotId("a"), 2000, corridor(100, 120)});
    coordinator.receive(MapReport{RobotId("b"), 2000, corridor(200, 220)});
    coordinator.receive(MapReport{RobotId("d"), 100, corridor(200, 220)});
    coordinator.receive(MapReport{RobotId("c"), 100, corridor(100, 120)});
    const auto decision = coordinator.decide(10.0);
    ASSERT_TRUE(decision);
    EXPECT_EQ(decision->moves.empty(), costs);
  }
}

TEST(Coordinator, says_of_whom_it_knows_nothing) {
  Coordinator coordinator{CoordinatorOptions{}};
  coordinator.receive(edge("north"));
  coordinator.receive(RobotComes{RobotId("a"), std::nullopt, {}});
  coordinator.receive(RobotComes{RobotId("b"), corridor(0, 20), {}});
  EXPECT_THAT(coordinator.decide(0.0)->unknown, ElementsAre(RobotId("a")));
  coordinator.receive(MapReport{RobotId("a"), 10, corridor(0, 20)});
  EXPECT_THAT(coordinator.decide(1.0)->unknown, ElementsAre());
}

TEST(Coordinator, leaves_a_robot_where_moving_saves_little) {
  scheduling::LatencyModel no_cost;  // of sending and mapping again
  no_cost.slam_s_per_scan = no_cost.scan_bytes = no_cost.robot_bytes_fixed = 0.0;
  for (const double hysteresis : {0.0, 0.9}) {
    Coordinator coordinator = two_corridors(hysteresis, no_cost);
    coordinator.decide(0.0);
    const auto before = coordinator.edge_of();
    // From now on a sees what c sees, b what d sees; a and b, who drove far, are fused on one edge.
    coordinator.receive(MapReport{RobotId("a"), 2000, corridor(100, 120)});
    coordinator.receive(MapReport{RobotId("b"), 2000, corridor(200, 220)});
    coordinator.receive(MapReport{RobotId("d"), 100, corridor(200, 220)});
    coordinator.receive(MapReport{RobotId("c"), 100, corridor(100, 120)});
    const auto decision = coordinator.decide(10.0);
    ASSERT_TRUE(decision);
    EXPECT_EQ(decision->is_new_plan, hysteresis == 0.0);
    EXPECT_EQ(decision->moves.empty(), hysteresis > 0.0);
    EXPECT_EQ(coordinator.edge_of() == before, hysteresis > 0.0);
    EXPECT_LE(decision->expected_s, decision->staying_s);
    EXPECT_THAT(decision->because, ElementsAre("maps have grown"));
    if (hysteresis == 0.0) {
      EXPECT_EQ(at(coordinator, "a"), at(coordinator, "c"));
      EXPECT_EQ(decision->moves.size(), 2u) << "edges are exchanged so that few robots move";
    }
  }
}

TEST(Coordinator, moves_a_robot_whose_wire_became_slow) {
  Coordinator coordinator = two_corridors();
  for (const char* robot : {"a", "b", "c", "d"})
    for (const char* at : {"north", "south"}) coordinator.receive(LinkIs{RobotId(robot), TierId(at), 1e6, 0.01});
  coordinator.decide(0.0);
  const TierId before = at(coordinator, "a");
  coordinator.receive(LinkIs{RobotId("a"), before, 1e6, 0.01});
  EXPECT_FALSE(coordinator.decide(1.0)) << "as it was";
  coordinator.receive(LinkIs{RobotId("a"), before, 1e3, 0.01});
  const auto decision = coordinator.decide(2.0);
  ASSERT_TRUE(decision);
  EXPECT_THAT(decision->because, ElementsAre("link from a to " + before.str() + " changed"));
  EXPECT_NE(at(coordinator, "a"), before);
  EXPECT_LT(decision->expected_s, decision->staying_s);
}

TEST(Coordinator, decides_the_same_whoever_speaks_first) {
  CoordinatorOptions options;
  std::vector<CoordinatorEvent> events{edge("north"), edge("south")};
  for (const char* robot : {"a", "b", "c", "d", "e"})
    events.push_back(RobotComes{RobotId(robot), corridor(8.0 * robot[0], 8.0 * robot[0] + 15.0), {}});
  Coordinator forth(options), back(options);
  for (auto event = events.begin(); event != events.end(); ++event) forth.receive(*event);
  for (auto event = events.rbegin(); event != events.rend(); ++event) back.receive(*event);
  const auto one = forth.decide(0.0), other = back.decide(0.0);
  EXPECT_EQ(one->edge_of, other->edge_of);
  EXPECT_EQ(one->expected_s, other->expected_s);
}

TEST(Coordinator, knows_nothing_of_robots_that_never_came) {
  Coordinator coordinator{CoordinatorOptions()};
  EXPECT_THROW(coordinator.receive(RobotGoes{RobotId("a")}), ContractViolation);
  EXPECT_THROW(coordinator.receive(MapReport{RobotId("a"), 1, {}}), ContractViolation);
  EXPECT_FALSE(coordinator.decide(0.0));
}

}  // namespace
}  // namespace mapweave::tiers
