// What the coordinator of a deployment makes of the words of programs.
#include <mapweave/maps/coordination.h>
#include <mapweave/runtime/live_coordinator.h>
#include <mapweave/runtime/live_status.h>
#include <mapweave/scheduling/overlap_estimate.h>
#include <support/temporary_folder.h>

#include <gmock/gmock.h>
#include <mapweave/core/files.h>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

RunConfiguration configuration_of_four() {
  RunConfiguration configuration;
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  configuration.coordinator.overlap_period_s = 5.0;
  configuration.live.lost_after_s = 30.0;
  configuration.edges = {{"north"}, {"south"}};
  for (const char* id : {"alpha", "beta", "gamma", "delta"}) {
    RobotEntry robot;
    robot.id = id;
    robot.log = std::string(id) + ".rawlog";
    robot.edge = "north";
    configuration.robots.push_back(robot);
  }
  return configuration;
}

// Robots that announce where they drive share that: alpha with gamma, beta with delta.
void announce_routes(RunConfiguration& configuration) {
  for (RobotEntry& robot : configuration.robots) {
    const double y_m = robot.id == "alpha" || robot.id == "gamma" ? 0.0 : 200.0;
    robot.route = {{0.0, y_m}, {40.0, y_m}};
  }
}

struct LiveCoordinatorTest : testing::Test {
  void start(const std::optional<LivePlan>& before = std::nullopt) {
    plan = make_plan(configuration, {}, LogsAre::with_robots);
    plan.model = folder / "model.json";
    write_file(plan.model,
               R"({"edge_fusion": {"fixed_s": 0, "per_scan_s": 0, "per_scan_pair_s": 1e-4, "per_shared_scan_s": 0}})");
    coordinator = std::make_unique<LiveCoordinator>(configuration, plan, before);
  }
  std::string said(const std::string& program, const std::string& name, Json tier) {
    Json status = program_status(program, name, {std::move(tier)}, {});
    status["said_at_ns"] = ++said_at_ns;
    return status.dump();
  }
  void robot_says(const std::string& name, std::optional<double> bytes_per_s = std::nullopt) {
    LiveRobotCounts counts;
    counts.scans = 400;
    counts.edge = edge_of(name);
    counts.bytes_per_s = bytes_per_s;
    coordinator->receive_robot(RobotId(name), said("robot", name, tier_status(RobotId(name), counts.edge, counts, {})),
                               now_s);
  }
  void edge_says(const std::string& name, double mapping_s = 0.0) {
    LiveEdgeCounts counts;
    for (const PlannedRobot& planned : plan.robots) {
      if (edge_of(planned.id.str()) != TierId(name)) continue;
      LiveEdgeCounts::RobotCounts& robot = counts.robots.emplace_back();
      robot.id = planned.id;
      robot.scans = scans;
      robot.has_ended = ended.count(planned.id.str()) != 0;
    }
    counts.mapping_s = mapping_s;
    counts.bytes_per_s = to_cloud;
    coordinator->receive_edge(TierId(name), said("edge", name, tier_status(TierId(name), counts, {})), now_s);
  }
  void cloud_says(bool is_done, std::uint64_t plan_number) {
    LiveCloudCounts counts;
    counts.is_done = is_done;
    counts.plan = plan_number;
    coordinator->receive_cloud(said("cloud", "cloud", tier_status(counts, {})), now_s);
  }
  TierId edge_of(const std::string& robot) {
    const LivePlan now = coordinator->plan();
    const auto place = now.edge_of.find(RobotId(robot));
    if (place != now.edge_of.end()) return place->second;
    for (const PlannedRobot& planned : plan.robots)
      if (planned.id.str() == robot) return planned.edge;
    return {};
  }
  // All that run say how they are, each second.
  void run(double seconds) {
    for (double until_s = now_s + seconds; now_s < until_s;) {
      now_s += 1.0;
      for (const std::string& edge : edges) edge_says(edge, mapped_s);
      for (const std::string& robot : robots) robot_says(robot);
      coordinator->step(now_s);
    }
  }
  Json status() { return tier_status(coordinator->counts(now_s), {15.0, now_s}); }

  test::TemporaryFolder folder;
  RunConfiguration configuration = configuration_of_four();
  RunPlan plan;
  std::unique_ptr<LiveCoordinator> coordinator;
  std::vector<std::string> edges{"north", "south"}, robots{"alpha", "beta", "gamma", "delta"};
  double mapped_s = 0.0;  // by each edge
  std::set<std::string> ended;
  std::optional<double> to_cloud;
  std::uint64_t scans = 100;
  double now_s = 0.0;
  std::int64_t said_at_ns = 0;
};

void begin_on_both(RunConfiguration& configuration) {
  for (RobotEntry& robot : configuration.robots)
    if (robot.id == "gamma" || robot.id == "delta") robot.edge = "south";
}

using Groups = std::map<std::string, std::set<std::string>>;
Groups groups_of(const LivePlan& plan) {
  Groups groups;
  for (const auto& [robot, edge] : plan.edge_of) groups[edge.str()].insert(robot.str());
  return groups;
}

TEST_F(LiveCoordinatorTest, corrects_a_bad_start_by_what_robots_share) {
  announce_routes(configuration);
  start();
  EXPECT_EQ(coordinator->plan().number, 0u) << "no robot has come";
  robot_says("alpha");
  EXPECT_FALSE(coordinator->step(now_s)) << "its word may be of a program that ended long ago";
  run(2.0);
  const LivePlan made = coordinator->plan();
  EXPECT_EQ(made.edge_of.size(), 4u);
  EXPECT_EQ(made.edge_of.at(RobotId("alpha")), made.edge_of.at(RobotId("gamma")));
  EXPECT_EQ(made.edge_of.at(RobotId("beta")), made.edge_of.at(RobotId("delta")));
  EXPECT_NE(made.edge_of.at(RobotId("alpha")), made.edge_of.at(RobotId("beta")));
  EXPECT_EQ(coordinator->counts(now_s).moves, 2u) << "no more than it takes";
  EXPECT_THAT(coordinator->counts(now_s).last, AllOf(HasSubstr("robot beta comes"), HasSubstr(" to ")));
  const std::uint64_t number = made.number;
  run(20.0);
  EXPECT_EQ(coordinator->plan().number, number) << "nothing is new";
  const Json report = coordinator->report();
  EXPECT_EQ(report["method"], "default");
  EXPECT_EQ(report["overlaps"].size(), 2u);
  EXPECT_EQ(report["wires"].size(), 8u);
  EXPECT_FALSE(report["decisions"].empty());
}

TEST_F(LiveCoordinatorTest, believes_what_edges_say_of_maps_and_not_less_than_before) {
  start();
  run(2.0);
  const LivePlan before = coordinator->plan();
  EXPECT_EQ(groups_of(before), (Groups{{"north", {"alpha", "beta", "delta", "gamma"}}})) << "nothing is known yet";
  const auto report = [&](const char* robot, double y_m, double length_m, std::uint64_t of) {
    const MapSummary summary = scheduling::summary_of_route({{0.0, y_m}, {length_m, y_m}}, 6.0);
    return encode(CoordinatorEvent(MapReport{RobotId(robot), of, summary}));
  };
  const auto send = [&](const char* edge, const std::vector<std::string>& reports) {
    coordinator->receive_maps(TierId(edge), pack_map_reports(reports, 250'000));
  };
  send("south", {report("gamma", 200.0, 40.0, 300)});  // it is not there
  send("north", {report("alpha", 0.0, 40.0, 300), report("beta", 200.0, 40.0, 300), report("gamma", 0.0, 40.0, 300),
                 report("delta", 200.0, 40.0, 300)});
  run(6.0);
  const LivePlan after = coordinator->plan();
  EXPECT_EQ(after.edge_of.at(RobotId("alpha")), after.edge_of.at(RobotId("gamma")));
  EXPECT_GT(after.number, before.number);
  // The new edge has mapped little of them yet: what the old one showed counts.
  for (const auto& [robot, edge] : after.edge_of)
    send(edge.str().c_str(), {report(robot.str().c_str(), 500.0, 1.0, 5)});
  run(12.0);
  EXPECT_EQ(coordinator->plan().number, after.number);
  EXPECT_EQ(coordinator->counts(now_s).unreadable, 0u);
  send("north", {"no report"});
  coordinator->receive_maps(TierId("north"), "7\nabc");
  coordinator->receive_maps(TierId("north"), "9999999999999999999999\nabc");
  send("north", {encode(CoordinatorEvent(EdgeGoes{TierId("north")}))});
  send("north", {report("omega", 0.0, 1.0, 5)});
  EXPECT_EQ(coordinator->counts(now_s).unreadable, 5u);
}

TEST_F(LiveCoordinatorTest, gives_the_robots_of_a_lost_edge_to_the_other_one_and_never_all_to_none) {
  begin_on_both(configuration);
  start();
  run(3.0);
  edges = {"south"};
  run(28.0);
  EXPECT_EQ(groups_of(coordinator->plan()).count("north"), 1u) << "it may start again";
  run(4.0);
  EXPECT_EQ(groups_of(coordinator->plan()), (Groups{{"south", {"alpha", "beta", "delta", "gamma"}}}));
  EXPECT_THAT(coordinator->counts(now_s).last, HasSubstr("edge north goes"));
  EXPECT_FALSE(status()["links"][0]["is_on_wire"]);
  const std::uint64_t number = coordinator->plan().number;
  edges.clear();
  run(60.0);
  EXPECT_EQ(coordinator->plan().number, number) << "there is nobody else";
  EXPECT_THAT(status()["findings"].dump(), HasSubstr("edge south has said nothing"));
  edges = {"north", "south"};
  run(40.0);
  EXPECT_EQ(groups_of(coordinator->plan()).size(), 2u) << "it is back, and there is work for both";
}

TEST_F(LiveCoordinatorTest, ends_when_all_robots_have_ended_where_they_are_and_the_cloud_is_done) {
  begin_on_both(configuration);
  start();
  ended = {"alpha", "beta", "gamma"};
  run(3.0);
  EXPECT_FALSE(coordinator->plan().is_final);
  ended.insert("delta");
  run(1.0);
  const LivePlan last = coordinator->plan();
  EXPECT_TRUE(last.is_final);
  EXPECT_FALSE(last.is_done);
  EXPECT_FALSE(status()["counts"].contains("actual_seconds"));
  const double ended_s = now_s;
  cloud_says(true, last.since - 1);  // of a deployment before
  run(1.0);
  EXPECT_FALSE(coordinator->plan().is_done);
  edges = {"south"};
  run(40.0);
  EXPECT_EQ(groups_of(coordinator->plan()), (Groups{{"south", {"alpha", "beta", "delta", "gamma"}}}))
      << "they are sent again, for the edge that had them is lost";
  EXPECT_TRUE(coordinator->plan().is_final);
  edges = {"north", "south"};
  run(10.0);
  EXPECT_EQ(groups_of(coordinator->plan()).size(), 1u) << "now they stay";
  mapped_s = 12.0;
  run(1.0);
  cloud_says(true, coordinator->plan().number);
  run(1.0);
  EXPECT_TRUE(coordinator->plan().is_done);
  EXPECT_EQ(status()["state"], "done");
  EXPECT_NEAR(status()["counts"]["actual_seconds"].get<double>(), 12.0 + now_s - ended_s, 1.5) << "mapped, and merged";
  EXPECT_FALSE(coordinator->step(now_s + 100.0));
}

TEST_F(LiveCoordinatorTest, goes_on_with_the_plan_that_was_made_before_unless_that_was_done) {
  begin_on_both(configuration);
  LivePlan before{7, 3, false, false, {}};
  for (const char* robot : {"alpha", "gamma", "delta"}) before.edge_of[RobotId(robot)] = TierId("north");
  before.edge_of[RobotId("beta")] = TierId("south");
  configuration.coordinator.hysteresis = 0.99;
  start(before);
  EXPECT_EQ(encode(coordinator->plan()), encode(before));
  run(3.0);
  EXPECT_EQ(encode(coordinator->plan()), encode(before));
  before.is_done = true;
  start(before);
  EXPECT_EQ(coordinator->plan().number, 0u);
  run(3.0);
  EXPECT_EQ(coordinator->plan().since, 8u) << "it counts on";
  EXPECT_EQ(groups_of(coordinator->plan()), (Groups{{"north", {"alpha", "beta"}}, {"south", {"delta", "gamma"}}}));
  before.is_done = false;
  before.edge_of[RobotId("omega")] = TierId("north");
  start(before);
  EXPECT_EQ(coordinator->plan().number, 0u) << "it is of another configuration";
}

TEST_F(LiveCoordinatorTest, uses_what_was_measured_and_says_so) {
  begin_on_both(configuration);
  start();
  run(2.0);
  robot_says("alpha", 5e5);
  to_cloud = 2e6;
  edge_says("south");
  to_cloud.reset();
  scans = 200;
  edge_says("north", 2.0);  // 400 scans in 2 s
  const Json report = coordinator->report();
  std::map<std::string, Json> wires, known;
  for (const Json& wire : report["wires"])
    wires[wire["robot"].get<std::string>() + ">" + wire["edge"].get<std::string>()] = wire;
  for (const Json& edge : report["edges"]) known[edge["id"]] = edge;
  EXPECT_EQ(wires["alpha>north"]["bytes_per_second_is"], "measured");
  EXPECT_EQ(wires["alpha>north"]["bytes_per_second"], 5e5);
  EXPECT_EQ(wires["alpha>south"]["bytes_per_second_is"], "like others") << "what nobody measured is no better";
  EXPECT_EQ(wires["alpha>south"]["bytes_per_second"], 5e5);
  EXPECT_EQ(wires["beta>north"]["bytes_per_second_is"], "configured");
  EXPECT_EQ(known["south"]["bytes_per_second_is"], "measured");
  EXPECT_EQ(known["north"]["bytes_per_second_is"], "like others");
  EXPECT_EQ(known["north"]["bytes_per_second"], 2e6);
  EXPECT_EQ(known["north"]["speed_is"], "measured");
  EXPECT_NEAR(known["north"]["speed"].get<double>(), 0.0007 / (2.0 / 400.0), 1e-9) << "against the model's 0.7 ms";
  EXPECT_EQ(known["south"]["speed_is"], "like others");
  EXPECT_EQ(known["south"]["speed"], known["north"]["speed"]);
  robot_says("alpha", 5.5e5);
  EXPECT_EQ(coordinator->report()["wires"][0]["bytes_per_second"], 5e5) << "nearly the same is no news";
  robot_says("alpha", 1e5);
  EXPECT_EQ(coordinator->report()["wires"][0]["bytes_per_second"], 1e5);
}

TEST_F(LiveCoordinatorTest, takes_robots_off_an_edge_that_is_slow) {
  configuration.robots.pop_back();  // groups are as equal as can be: two and one
  begin_on_both(configuration);
  announce_routes(configuration);
  robots = {"alpha", "beta", "gamma"};
  start();
  run(2.0);
  const auto at_north = [&] { return coordinator->plan().members(TierId("north")).size(); };
  scans = 4000;
  for (int i = 0; i < 2; ++i) {
    now_s += 1.0;
    edge_says("north", 4000.0);  // a second a scan, and more
    edge_says("south", 1.0);
  }
  coordinator->step(now_s += 10.0);
  EXPECT_LT(at_north(), 2u) << coordinator->report().dump(1);
  EXPECT_THAT(coordinator->counts(now_s).last, HasSubstr("edge north changed: speed"));
}

TEST_F(LiveCoordinatorTest, says_who_has_no_edge_and_what_it_cannot_read) {
  configuration.edges[0].capacity = 2;
  configuration.edges[1].capacity = 2;
  for (RobotEntry& robot : configuration.robots) robot.edge.clear();
  start();
  coordinator->receive_robot(RobotId("alpha"), "{", now_s);
  coordinator->receive_edge(TierId("north"), R"({"said_at_ns": 1, "tiers": []})", now_s);
  coordinator->receive_cloud(R"({"said_at_ns": 1, "tiers": [{"counts": {"plan": -1}, "links": []}]})", now_s);
  coordinator->receive_edge(TierId("north"), R"({"said_at_ns": 1, "tiers": [{"counts": {}, "links": [{"name": 7}]}]})",
                            now_s);
  EXPECT_EQ(coordinator->counts(now_s).unreadable, 4u);
  run(4.0);
  EXPECT_EQ(coordinator->plan().members(TierId("north")).size(), 2u);
  edges = {"south"};
  ended = {"alpha", "beta", "gamma", "delta"};
  for (int i = 0; i < 2; ++i) edge_says("south");
  run(40.0);
  const LivePlan made = coordinator->plan();
  EXPECT_EQ(made.members(TierId()).size(), 2u);
  EXPECT_EQ(made.members(TierId("south")).size(), 2u);
  EXPECT_FALSE(made.is_final);
  EXPECT_THAT(status()["findings"].dump(), AllOf(HasSubstr("no edge has room for robot"), HasSubstr("4 words")));
}

TEST(LivePlan, comes_back_from_its_bytes_and_refuses_what_is_none) {
  LivePlan plan{5, 2, true, false, {{RobotId("alpha"), TierId("north")}, {RobotId("beta"), TierId()}}};
  const LivePlan back = decode_live_plan(encode(plan), "test");
  EXPECT_EQ(encode(back), encode(plan));
  EXPECT_TRUE(back.is_final);
  EXPECT_EQ(back.edge_of, plan.edge_of);
  EXPECT_THAT(back.members(TierId("north")), ElementsAre(RobotId("alpha")));
  EXPECT_THAT(back.members(TierId("south")), IsEmpty());
  for (const char* bad : {"", "[]", "{}", R"({"plan":0,"since":1,"final":false,"done":false,"edges":{}})",
                          R"({"plan":1,"since":1,"final":1,"done":false,"edges":{}})",
                          R"({"plan":1,"since":1,"final":false,"done":false,"edges":[]})",
                          R"({"plan":1,"since":1,"final":false,"done":false,"edges":{"no name!":"north"}})",
                          R"({"plan":1,"since":1,"final":false,"done":false,"edges":{"alpha":"no name!"}})",
                          R"({"plan":1,"since":1,"final":false,"done":false,"edges":{"alpha":7}})",
                          R"({"plan":1,"since":1,"final":false,"done":false,"edges":{},"more":1})"})
    EXPECT_THROW(decode_live_plan(bad, "test"), Error) << bad;
}

}  // namespace
}  // namespace mapweave::runtime
