// Robots, edges and a cloud as if each were a program of its own, over channels of this process: the final map is the
// one of a run.
#include "live_team.h"

#include <mapweave/mapdb/map_store.h>
#include <mapweave/maps/receipt.h>
#include <mapweave/tiers/subjects.h>
#include <mapweave/transport/in_process_channel.h>

#include <gmock/gmock.h>

namespace mapweave::runtime {
namespace {

using namespace test_support;
namespace subject = tiers::subject;

TEST_F(LiveTeam, leaves_what_a_run_leaves) {
  start_cloud();
  start_edge("north");
  start_edge("south");
  start_robots();
  const Report report = result();
  expect_as_run();
  ASSERT_EQ(report.robots.size(), 3u);
  for (const RobotReport& robot : report.robots) {
    EXPECT_TRUE(robot.mapped);
    EXPECT_GT(robot.scans, 10u);
    EXPECT_GT(robot.log_seconds, 5.0);
  }
  const json live = json::parse(read_file(settings.out / "manifest.json")),
             run = json::parse(read_file(as_run() / "manifest.json"));
  EXPECT_EQ(live["inputs"], run["inputs"]);
  await([&] { return edges.at("north")->counts().is_done && edges.at("south")->counts().is_done; });
  for (const auto& robot : robots) EXPECT_TRUE(robot->is_done());
}

TEST_F(LiveTeam, does_not_mind_in_which_order_its_programs_start) {
  options.preview_period_s = 0.05;
  start_robots();
  std::this_thread::sleep_for(50ms);
  start_edge("south", "south");
  std::this_thread::sleep_for(300ms);
  start_edge("north", "north");
  await([&] { return edges.at("south")->counts().is_fused; });
  EXPECT_FALSE(edges.at("south")->counts().is_cloud_on_wire || edges.at("south")->counts().cloud_silent_s);
  start_cloud("cloud");
  result();
  EXPECT_EQ(cloud->preview(), nullptr) << "nobody asked for it";
  expect_as_run();
}

TEST_F(LiveTeam, gets_over_wires_that_lose_and_double_and_break) {
  for (const std::uint64_t seed : {1, 1000}) {
    badness = {0.05, 0.05, 0.01, seed};
    settings.out = folder / ("live-" + std::to_string(seed));
    start_cloud();
    start_edge("north", "north" + std::to_string(seed));
    start_edge("south", "south" + std::to_string(seed));
    start_robots();
    result();
    expect_as_run();
    std::uint64_t again = 0;
    for (const auto& [name, edge] : edges) again += edge->counts().again;
    EXPECT_GT(again, 0u);
    EXPECT_GT(connected, 5u) << "wires broke";
    robots.clear();
    edges.clear();
    end_cloud();
  }
}

TEST_F(LiveTeam, goes_on_where_a_killed_edge_and_a_killed_cloud_had_stored) {
  start_cloud("cloud");
  start_edge("north", "north");
  start_edge("south", "south");
  start_robots();
  await([&] { return taken("north") > 20; });
  end_edge("north");
  start_edge("north", "north");
  await([&] { return edges.at("south")->counts().is_fused; });
  end_cloud();
  start_cloud("cloud");
  await([&] { return edges.at("north")->counts().is_fused; });
  end_edge("north");
  start_edge("north", "north");
  result();
  expect_as_run();
}

TEST_F(LiveTeam, sends_all_again_to_an_edge_that_lost_its_store) {
  start_cloud();
  start_edge("north");
  start_edge("south");
  start_robots();
  await([&] { return robots.front()->counts().confirmed > 10; });
  end_edge("north");
  start_edge("north");
  result();
  expect_as_run();
}

TEST_F(LiveTeam, takes_maps_that_robots_made_on_board) {
  configuration.mode = Mode::onboard;
  plan = make_plan(configuration, {});
  choose_sensors(plan, configuration, pool);
  badness = {0.05, 0.05, 0.01, 3};
  start_cloud();
  start_edge("south");
  start_edge("north", "north");
  start_robots();
  await([&] { return edges.at("south")->counts().is_fused; });
  await([&] { return taken("north") > 1; });
  end_edge("north");
  start_edge("north", "north");
  result();
  const fs::path run = folder / "run";
  run_batch(configuration, make_plan(configuration, {}), {run, false, false}, pool, *silent);
  EXPECT_EQ(outputs_of(settings.out), outputs_of(run));
  EXPECT_EQ(merges_of(settings.out), merges_of(run));
}

std::size_t nodes_of(const std::shared_ptr<const LivePreview>& preview, const std::string& robot) {
  std::size_t count = 0;
  if (preview != nullptr)
    for (const LivePreview::JointMap& part : preview->parts)
      for (const auto& node : part.map.nodes) count += node.first.session.client.robot.str() == robot ? 1 : 0;
  return count;
}

// Counts of a tier and its preview, while it may make the next one.
template <class Tier>
void expect_newest_scans_of(const Tier& tier) {
  const std::map<RobotId, Stamp> before = tier.counts().newest_scans;
  std::map<RobotId, Stamp> shown;
  for (const LivePreview::JointMap& part : tier.preview()->parts)
    for (const auto& [id, node] : part.map.nodes) {
      Stamp& newest = shown[id.session.client.robot];
      newest = std::max(newest, node.stamp);
    }
  const std::map<RobotId, Stamp> after = tier.counts().newest_scans;
  EXPECT_FALSE(before.empty());
  for (const auto& [robot, stamp] : before) {
    EXPECT_LE(stamp, shown[robot]) << robot.str();
    EXPECT_LE(shown[robot], after.at(robot)) << robot.str();
  }
}

TEST_F(LiveTeam, shows_previews_while_robots_drive) {
  options.speed = 8.0 / kSlowness;
  keeps_previews = true;
  start_cloud();
  start_edge("north");
  start_edge("south");
  start_robots();
  await([&] { return cloud->counts().maps == 3u; });
  EXPECT_FALSE(cloud->counts().is_sealing);
  EXPECT_FALSE(robots.front()->is_done());
  await(
      [&] { return nodes_of(cloud->preview(), "beta") > 10 && nodes_of(edges.at("north")->preview(), "gamma") > 10; });
  EXPECT_EQ(nodes_of(edges.at("north")->preview(), "beta"), 0u) << "it is of another edge";
  EXPECT_GE(cloud->counts().previews, cloud->preview()->number);
  expect_newest_scans_of(*cloud);
  expect_newest_scans_of(*edges.at("north"));
  EXPECT_LT(cloud->counts().edges.front().silent_s.value(), kPatience.count());
  EXPECT_TRUE(edges.at("north")->counts().cloud_silent_s);
  await([&] { return !cloud->counts().joint.empty() || cloud->counts().is_sealing; });
  result();
  EXPECT_GT(edges.at("north")->counts().previews, 1u);
  expect_as_run();
}

TEST_F(LiveTeam, shows_robots_own_maps_whatever_previews_there_are) {
  options.speed = 4.0 / kSlowness;
  options.preview_period_s = 1e6;
  keeps_previews = true;
  start_cloud();
  start_edge("north");
  start_edge("south");
  start_robots();
  const PlannedRobot& first = plan.robots.front();
  const LiveEdge& edge = *edges.at(first.edge.str());
  await([&] { return edge.map_so_far(first.id) != nullptr; });
  const auto begun = edge.map_so_far(first.id);
  EXPECT_LT(begun->nodes.size(), 20u) << "from its first scans on";
  EXPECT_EQ(begun->id, MapId(first.id.str()));
  await([&] { return edge.map_so_far(first.id)->nodes.size() > begun->nodes.size() + 10; });
  EXPECT_EQ(edge.preview(), nullptr);
  EXPECT_EQ(edges.at(first.edge.str() == "north" ? "south" : "north")->map_so_far(first.id), nullptr);
  result();
  EXPECT_GT(edge.map_so_far(first.id)->nodes.size(), begun->nodes.size() + 10);
  expect_as_run();
}

TEST_F(LiveTeam, does_what_users_ask_for_while_robots_drive) {
  options.speed = 8.0 / kSlowness;
  options.preview_period_s = 0.1;
  start_cloud();
  start_edge("north");
  start_edge("south");
  start_robots();
  LiveRequests requests;
  requests.refused = {{RobotId("alpha"), RobotId("beta")}, {RobotId("beta"), RobotId("gamma")}};
  const auto is_joined = [&](const auto& counts) {
    return std::any_of(counts.joint.begin(), counts.joint.end(), [](const std::vector<MapId>& members) {
      return std::find(members.begin(), members.end(), MapId("beta")) != members.end();
    });
  };
  await([&] { return is_joined(cloud->counts()); });
  EXPECT_TRUE(cloud->follow(requests));
  for (const auto& [name, edge] : edges) EXPECT_TRUE(edge->follow(requests));
  await([&] { return !is_joined(cloud->counts()); });
  result();
  EXPECT_FALSE(cloud->follow(requests)) << "too late";
  const fs::path run = folder / "run";
  configuration.team.refuse = {"alpha,beta", "beta,gamma"};
  run_batch(configuration, make_plan(configuration, {}), {run, false, false}, pool, *silent);
  EXPECT_EQ(merges_of(settings.out), merges_of(run));
  EXPECT_NE(merges_of(settings.out), merges_of(as_run()));
}

// The cloud alone is asked to keep two robots apart whose maps edge north merges, and thins.
struct LiveTeamTakenApart : LiveTeam {
  LiveTeamTakenApart() {
    for (RobotEntry& robot : configuration.robots) robot.edge = robot.id == "gamma" ? "south" : "north";
    plan = make_plan(configuration, {});
    choose_sensors(plan, configuration, pool);
    start_cloud();
    LiveRequests requests;
    requests.refused = {{RobotId("alpha"), RobotId("beta")}};
    EXPECT_TRUE(cloud->follow(requests));
    start_edge("north");
  }
};

TEST_F(LiveTeamTakenApart, says_who_sent_whole_maps) {
  start_edge("south");
  start_robots();
  const Report report = result();
  EXPECT_THAT(report.notes, testing::AllOf(testing::Contains(testing::HasSubstr("edge north sent whole maps")).Times(1),
                                           testing::Not(testing::Contains(testing::HasSubstr("did not send")))));
}

TEST_F(LiveTeamTakenApart, says_whose_maps_stay_thinned_where_their_edge_is_gone) {
  start_robots();
  await([&] { return cloud->counts().edges.front().has_fused; });
  end_edge("north");
  start_edge("south");
  await([&] { return cloud->counts().is_sealing; });
  EXPECT_FALSE(cloud->wait(300ms)) << "north is to answer";
  cloud->seal_now();
  const Report report = result();
  EXPECT_THAT(report.notes, testing::AllOf(testing::Contains(testing::ContainsRegex(
                                               "edge north merged the maps 'alpha', 'beta'.*did not send them")),
                                           testing::Not(testing::Contains(testing::HasSubstr("sent whole maps")))));
  for (const RobotReport& robot : report.robots) EXPECT_TRUE(robot.mapped);
  std::size_t nodes = 0;
  for (const auto& team : fs::directory_iterator(settings.out))
    if (team.path().filename().string().rfind("team", 0) == 0)
      for (const Map& map : mapdb::read_store(team.path() / "map.mwdb").maps) nodes += map.nodes.size();
  for (const RobotId& robot : {RobotId("alpha"), RobotId("beta"), RobotId("gamma")})
    nodes -= mapdb::read_store(settings.out / "robots" / robot.str() / "map.mwdb").maps.at(0).nodes.size();
  EXPECT_EQ(nodes, 0u) << "every pose is there";
}

TEST(LiveRequests, are_read_as_they_were_written) {
  const RunConfiguration configuration = three_robots_configuration();
  const RunPlan plan = make_plan(configuration, {});
  LiveRequests requests;
  requests.refused = {{RobotId("alpha"), RobotId("beta")}};
  requests.starts[RobotId("gamma")] = {1.0, -2.0, 0.5, 0.3, 0.2};
  const LiveRequests back = decode_live_requests(encode(requests), plan, "here");
  EXPECT_EQ(back.refused, requests.refused);
  EXPECT_EQ(back.starts.at(RobotId("gamma")).yaw_rad, 0.5);
  EXPECT_EQ(start_of(configuration, back, RobotId("gamma")).sigma_m, 0.3);
  EXPECT_EQ(refused_in(plan, back).size(), 1u);
  for (const char* bad :
       {"", "[]", "{}", R"({"refused":[],"starts":3})", R"({"refused":[["alpha"]],"starts":{}})",
        R"({"refused":[["alpha","alpha"]],"starts":{}})", R"({"refused":[["alpha","nobody"]],"starts":{}})",
        R"({"refused":[[1,2]],"starts":{}})", R"({"refused":[],"starts":{"beta":{"x_m":"1"}}})",
        R"({"refused":[],"starts":{"beta":{"x_m":1e9,"y_m":0,"yaw_rad":0,"sigma_m":1,"sigma_rad":1}}})",
        R"({"refused":[],"starts":{"beta":{"x_m":1,"y_m":0,"yaw_rad":0,"sigma_m":1,"sigma_rad":0}}})"})
    EXPECT_THROW(decode_live_requests(bad, plan, "here"), Error) << bad;
}

TEST_F(LiveTeam, waits_for_no_robot_that_has_said_all) {
  start_cloud();
  start_edge("north");
  start_edge("south");
  start_robots();
  for (const auto& robot : robots) ASSERT_TRUE(robot->wait(kPatience));
  for (const auto& entry : edges)
    for (const LiveEdgeCounts::RobotCounts& robot : entry.second->counts().robots)
      EXPECT_TRUE(robot.has_said_all) << robot.id.str();
  result();
}

TEST_F(LiveTeam, counts_the_scans_that_a_robot_has_no_room_for) {
  options.speed = 1000.0;
  options.robot_buffer_kb = 8;
  configuration.robots.resize(1);
  configuration.edges = {{"north"}};
  plan = make_plan(configuration, {});
  choose_sensors(plan, configuration, pool);
  start_robots();
  await([&] { return robots.front()->counts().is_read; });
  const LiveRobotCounts before = robots.front()->counts();
  EXPECT_EQ(before.confirmed, 0u);
  EXPECT_GT(before.lost_scans, 5u);
  EXPECT_GT(before.scans, before.lost_scans);
  start_cloud();
  start_edge("north");
  const Report report = result();
  EXPECT_EQ(report.robots.front().scans + before.lost_scans, before.scans);
  EXPECT_FALSE(report.robots.front().trouble);
  EXPECT_THAT(report.notes, testing::Contains(testing::HasSubstr("scans were lost")));
}

TEST_F(LiveTeam, seals_without_those_that_never_came) {
  options.patience_s = 0.2;
  start_cloud();
  start_edge("north");
  start_robots();
  await([&] { return cloud->counts().edges.front().has_fused; });
  EXPECT_FALSE(cloud->wait(300ms));
  testing::internal::CaptureStderr();
  std::this_thread::sleep_for(500ms);
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              testing::AllOf(testing::HasSubstr("the cloud waits for edge south"),
                             testing::HasSubstr("robot beta: edge south does not answer")));
  cloud->seal_now();
  const Report report = result();
  EXPECT_TRUE(report.robots[0].mapped && !report.robots[1].mapped && report.robots[2].mapped);
  EXPECT_THAT(report.notes, testing::Contains(testing::HasSubstr("robot beta: its map never came")));
  EXPECT_TRUE(fs::exists(settings.out / "robots/alpha/map.mwdb"));
  EXPECT_FALSE(fs::exists(settings.out / "robots/beta"));
}

// Whoever speaks to an edge or the cloud by hand.
struct Stranger {
  template <class Tier>
  explicit Stranger(Tier& tier) : channel(tier.connect()) {}
  void say(const std::string& what, const std::string& bytes, const std::string& sender = "",
           std::uint64_t number = 0) {
    channel->send({what, bytes, sender, number});
  }
  // The next message of this subject.
  std::optional<std::string> answer(const std::string& what) {
    const auto end = std::chrono::steady_clock::now() + 10s;
    while (std::chrono::steady_clock::now() < end)
      for (transport::Channel::Delivery& one : channel->receive(50ms)) {
        channel->acknowledge(one.number);
        if (one.envelope.subject == what) return one.envelope.bytes;
      }
    return std::nullopt;
  }
  std::string refusal() {
    const auto bytes = answer("refusal");
    return bytes ? decode_refusal(*bytes, "test").why.what() : "";
  }
  std::shared_ptr<transport::Channel> channel;
};

Hello hello_of(const std::string& robot, const Hash& agreement, std::int64_t run = 7) {
  return {{{RobotId(robot), SensorId("laser")}, run}, agreement};
}

TEST_F(LiveTeam, refuses_strangers_and_what_cannot_be_read) {
  start_edge("north");
  LiveEdge& edge = *edges.at("north");
  const Hash agreement = agreement_of(configuration);
  Stranger unknown(edge), other_version(edge), noise(edge);
  unknown.say("hello", encode(hello_of("omega", agreement)));
  EXPECT_THAT(unknown.refusal(), testing::AllOf(testing::HasSubstr("'omega' is no robot of edge 'north'"),
                                                testing::HasSubstr("alpha, gamma")));
  other_version.say("hello", encode(hello_of("alpha", Hash{})));
  EXPECT_THAT(other_version.refusal(), testing::HasSubstr("another version of mapweave"));
  noise.say("hello", "no hello at all");
  await([&] { return edge.counts().unreadable == 1; });

  Stranger alpha(edge);
  alpha.say("hello", encode(hello_of("alpha", agreement)));
  ASSERT_TRUE(alpha.answer("welcome"));
  alpha.say(subject::kSensed, "no scan at all", "alpha/7", 1);
  EXPECT_THAT(alpha.refusal(), testing::HasSubstr("robot alpha"));
  Sensed of_another{RobotId("gamma"), 1, Stamp{7}, Pose3()};
  alpha.say(subject::kSensed, encode(of_another), "alpha/7", 1);
  EXPECT_THAT(alpha.refusal(), testing::HasSubstr("gamma"));
  alpha.say("dance", "", "alpha/7", 1);
  EXPECT_THAT(alpha.refusal(), testing::HasSubstr("does not say 'dance'"));
  EXPECT_EQ(edge.counts().unreadable, 4u);
  EXPECT_EQ(edge.counts().robots.front().taken, 0u);

  Stranger twice(edge);
  twice.say("hello", encode(hello_of("alpha", agreement, 8)));
  EXPECT_THAT(twice.refusal(), testing::HasSubstr("robot 'alpha' is here already"));
  alpha.say(subject::kSensed, encode(Sensed{RobotId("alpha"), 1, Stamp{7}, Pose3()}), "alpha/7", 1);
  await([&] { return edge.counts().robots.front().mapped == 1; });
  EXPECT_FALSE(alpha.channel->is_closed()) << "the one that was here first goes on";
  EXPECT_EQ(edge.counts().refused, 3u) << "unknown, of another version, and twice";
}

TEST_F(LiveTeam, leaves_out_what_an_edge_sends_that_cannot_be_read) {
  start_cloud();
  const Hash agreement = agreement_of(configuration);
  Stranger unknown(*cloud), north(*cloud);
  unknown.say("hello", encode(Hello{{{RobotId("west"), SensorId("edge")}, 7}, agreement}));
  EXPECT_THAT(unknown.refusal(), testing::AllOf(testing::HasSubstr("'west' is no edge"), testing::HasSubstr("north")));
  north.say("hello", encode(Hello{{{RobotId("north"), SensorId("edge")}, 7}, agreement}));
  ASSERT_TRUE(north.answer("welcome"));
  std::uint64_t number = 0;
  const auto say = [&](const char* what, const std::string& bytes) { north.say(what, bytes, "north/7", ++number); };
  const std::string report =
      R"({"robot":"alpha","scans":1,"lost_scans":0,"sensed_bytes":1,"map_bytes":1,"log_seconds":1,)"
      R"("mapping_cpu_seconds":1,"helper_cpu_seconds":0,"wall_seconds":1,"notes":[],"log":"","log_sha256":"",)"
      R"("sensor":"laser","odometry":[],"live":)";
  say(subject::kRobotMap, "no map");
  say(subject::kRobotReport, "{");
  say(subject::kRobotReport, report + "[[1,0,0,0,0,0,0,2]]}");
  say(subject::kRobotReport, report + "[[2,0,0,0,0,0,0,1],[1,0,0,0,0,0,0,1]]}");
  say(subject::kRobotReport, std::string(report).replace(10, 5, "beta") + "[]}");
  say("dance", "x");
  await([&] { return cloud->counts().unreadable == 6; });
  say(subject::kFinalUpdate, "no update");
  say(subject::kMerged, "no merge");
  say(subject::kRobotReport, report + "[[1,0,0,0,0,0,0,1]]}");
  say(subject::kFused, "");
  await([&] { return cloud->counts().edges.front().has_fused; });
  cloud->seal_now();
  const Report result_of_nothing = result();
  EXPECT_EQ(cloud->counts().unreadable, 8u);
  EXPECT_EQ(cloud->counts().refused, 1u);
  EXPECT_EQ(result_of_nothing.robots.front().scans, 1u);
  EXPECT_FALSE(result_of_nothing.robots.front().mapped);
}

std::string refusal_of(const RunConfiguration& configuration, const RunPlan& plan) {
  try {
    expect_live(configuration, plan);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST_F(LiveTeam, knows_its_configuration_before_it_starts) {
  EXPECT_NO_THROW(expect_live(configuration, plan));
  EXPECT_THROW(LiveEdge(TierId("west"), site(""), [] { return nullptr; }), Error);
  RunConfiguration on_board = configuration;
  on_board.mode = Mode::onboard;
  EXPECT_NO_THROW(expect_live(on_board, plan));
  on_board.cloud.push_to = {"alpha"};
  EXPECT_THAT(refusal_of(on_board, plan), testing::HasSubstr("cloud.push_to"));
  on_board.cloud.push_to.clear();
  on_board.mode = Mode::cloud_only;
  EXPECT_THROW(expect_live(on_board, plan), Error);
  RunConfiguration sharing = configuration;
  sharing.server.share = tiers::Sharing::view;
  EXPECT_THAT(refusal_of(sharing, plan), testing::HasSubstr("server.across_edges"));
  sharing.server.across_edges = false;
  EXPECT_EQ(refusal_of(sharing, plan), "");
  sharing.coordinator.method = scheduling::PlanMethod::standard;
  EXPECT_THAT(refusal_of(sharing, plan), testing::HasSubstr("a coordinator may move their robots"));
  sharing.coordinator.method = std::nullopt;
  sharing.robots.front().own.push_back({"rig.longest_gap_s", "0.4", false, "here"});
  EXPECT_THAT(refusal_of(sharing, make_plan(sharing, {})), testing::HasSubstr("different options of rig"));
  RunConfiguration moved = configuration;
  moved.robots.front().log = "elsewhere.rawlog";
  moved.output.png = false;
  EXPECT_EQ(agreement_of(moved), agreement_of(configuration));
  moved.seed = 2;
  EXPECT_NE(agreement_of(moved), agreement_of(configuration));
}

}  // namespace
}  // namespace mapweave::runtime
