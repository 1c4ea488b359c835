// What programs of a deployment say of themselves, as JSON and as metrics.
#include <mapweave/runtime/live_status.h>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <map>
#include <regex>
#include <set>
#include <sstream>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;
using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr StatusTerms kLongUp{15.0, 100.0};

LiveCloudCounts collecting_cloud() {
  LiveCloudCounts counts;
  counts.edges = {{TierId("north"), 12, 11, true, false, true, 1, 0.5},
                  {TierId("south"), 3, 3, false, true, true, 2, 90.0}};
  counts.previews = 7;
  counts.maps = 3;
  counts.joint = {{MapId("alpha"), MapId("beta")}};
  counts.newest_scans = {{RobotId("beta"), Stamp{1'500'000'000}}};
  return counts;
}

LiveEdgeCounts mapping_edge() {
  LiveEdgeCounts counts;
  LiveEdgeCounts::RobotCounts alpha;
  alpha.id = RobotId("alpha");
  alpha.taken = 40;
  alpha.scans = 20;
  alpha.is_on_wire = true;
  alpha.silent_s = 0.1;
  counts.robots = {alpha};
  counts.is_cloud_on_wire = true;
  counts.cloud_silent_s = 1.0;
  return counts;
}

std::vector<std::string> findings(const Json& tier, const std::string& level) {
  std::vector<std::string> texts;
  for (const Json& finding : tier["findings"])
    if (finding["level"] == level) texts.push_back(finding["what"]);
  return texts;
}

TEST(LiveStatus, says_what_a_cloud_has_and_of_whom) {
  const Json status = tier_status(collecting_cloud(), kLongUp);
  EXPECT_EQ(status["role"], "cloud");
  EXPECT_EQ(status["state"], "collecting");
  EXPECT_EQ(status["counts"]["preview_maps"], 3);
  EXPECT_EQ(status["joint"], Json::parse(R"([["alpha", "beta"]])"));
  EXPECT_EQ(status["newest_scan_s"], Json::parse(R"({"beta": 1.5})"));
  ASSERT_EQ(status["links"].size(), 2u);
  EXPECT_EQ(status["links"][0]["counts"]["taken"], 12);
  EXPECT_EQ(status["links"][0]["silent_seconds"], 0.5);
  EXPECT_TRUE(status["links"][0]["is_on_wire"]);
  EXPECT_FALSE(status["links"][1]["is_needed"]) << "its maps are all here";
  EXPECT_THAT(status["findings"], IsEmpty());
}

TEST(LiveStatus, names_who_is_missing_once_patience_is_over) {
  LiveCloudCounts counts = collecting_cloud();
  counts.edges[0].silent_s = 20.0;
  counts.edges[1] = {TierId("south"), 0, 0, false, false, false, 0, std::nullopt};
  EXPECT_THAT(findings(tier_status(counts, {15.0, 3.0}), "warning"),
              ElementsAre("edge north has said nothing for 20 s"));
  const Json late = tier_status(counts, kLongUp);
  EXPECT_THAT(findings(late, "warning"), ElementsAre(HasSubstr("edge north"), "edge south never came"));
  EXPECT_THAT(findings(late, "error"), ElementsAre(HasSubstr("nobody")));
  EXPECT_THAT(late["findings"][1]["remedy"], HasSubstr("mapweave serve edge --name south"));
  counts.edges[0].silent_s = 0.2;
  EXPECT_THAT(findings(tier_status(counts, kLongUp), "error"), IsEmpty()) << "one of two is there";
  EXPECT_THAT(tier_status(LiveCloudCounts{}, kLongUp)["findings"], IsEmpty()) << "nobody is needed";
}

TEST(LiveStatus, says_what_an_edge_maps_and_what_it_could_not) {
  LiveEdgeCounts counts = mapping_edge();
  EXPECT_EQ(tier_status(TierId("north"), counts, kLongUp)["links"].size(), 2u) << "a robot and the cloud";
  EXPECT_THAT(tier_status(TierId("north"), counts, kLongUp)["findings"], IsEmpty());
  counts.robots[0].lost_scans = 4;
  counts.refused = 1;
  counts.unreadable = 2;
  counts.cloud_silent_s.reset();
  counts.trouble = "disk full";
  const Json status = tier_status(TierId("north"), counts, kLongUp);
  EXPECT_THAT(findings(status, "error"), ElementsAre("disk full"));
  EXPECT_THAT(findings(status, "warning"), ElementsAre("the cloud never came", HasSubstr("refused 1 times"),
                                                       HasSubstr("2 messages"), "robot alpha had no room for 4 scans"));
  counts.is_fused = true;
  EXPECT_EQ(tier_status(TierId("north"), counts, kLongUp)["state"], "merged");
}

TEST(LiveStatus, says_what_is_wrong_with_wires) {
  LiveEdgeCounts counts = mapping_edge();
  counts.robots[0].wire.refused = 3;
  counts.robots[0].wire.unconfirmed = 5;
  counts.cloud_wire.full_s = 20.0;
  counts.cloud_wire.trouble = "no room";
  const Json status = tier_status(TierId("north"), counts, kLongUp);
  EXPECT_EQ(status["links"][0]["counts"]["wire_refused"], 3);
  EXPECT_EQ(status["links"][0]["counts"]["wire_sent_again"], 5);
  EXPECT_EQ(status["links"][1]["counts"]["wire_full_seconds"], 20.0);
  EXPECT_THAT(findings(status, "warning"), ElementsAre("its wire to robot alpha: 3 parts that came are no messages",
                                                       "its wire to the cloud: the broker has had no room for 20 s"));
  counts.cloud_wire.full_s = 1.0;
  EXPECT_THAT(findings(tier_status(TierId("north"), counts, kLongUp), "warning"),
              Contains("its wire to the cloud: no room"));
  EXPECT_THAT(findings(status, "error"), IsEmpty()) << "it may go on by itself";
  counts = mapping_edge();
  counts.robots[0].begun = 4;
  counts.robots[0].begun_soon = 1;
  EXPECT_THAT(findings(tier_status(TierId("north"), counts, kLongUp), "warning"), IsEmpty()) << "it was started again";
  counts.robots[0].begun_soon = 2;
  EXPECT_THAT(findings(tier_status(TierId("north"), counts, kLongUp), "warning"),
              Contains("robot alpha has begun 4 times, the last ones in a row"));
}

TEST(LiveStatus, misses_no_robot_that_has_said_all) {
  LiveEdgeCounts counts = mapping_edge();
  counts.robots[0].is_on_wire = false;
  counts.robots[0].silent_s = 60.0;
  EXPECT_THAT(findings(tier_status(TierId("north"), counts, kLongUp), "warning"), ElementsAre(HasSubstr("alpha")));
  counts.robots[0].has_said_all = true;  // it is still mapped
  EXPECT_THAT(tier_status(TierId("north"), counts, kLongUp)["findings"], IsEmpty());
}

TEST(LiveStatus, knows_when_a_robot_is_done) {
  LiveRobotCounts counts;
  counts.messages = 5;
  counts.confirmed = 4;
  counts.is_read = true;
  counts.silent_s = 30.0;
  counts.refusal = "it is no robot of mine";
  const Json status = tier_status(RobotId("alpha"), TierId("north"), counts, kLongUp);
  EXPECT_EQ(status["state"], "sending the rest");
  EXPECT_THAT(findings(status, "error"),
              AllOf(Contains(HasSubstr("refuses: it is no robot of mine")), Contains(HasSubstr("nobody"))));
  counts.confirmed = 5;
  counts.refusal.clear();
  const Json done = tier_status(RobotId("alpha"), TierId("north"), counts, kLongUp);
  EXPECT_TRUE(done["is_done"]);
  EXPECT_THAT(done["findings"], IsEmpty()) << "its edge is not needed any more";
}

TEST(LiveStatus, says_what_cameras_share_and_who_does_not_answer) {
  LiveEdgeCounts edge = mapping_edge();
  ClientCounts front, front_again;
  front.session = {{RobotId("alpha"), SensorId("front")}, 7};
  front.received_bytes = 1000;
  front.shares = 3;
  front_again = front;
  front_again.session.run = 8;
  front_again.refused = 2;
  ServerCounts server;
  server.clients = {front, front_again};
  server.merges = 4;
  server.trouble = "the maps could not be merged";
  edge.cameras = server;
  const Json at_edge = tier_status(TierId("north"), edge, kLongUp);
  EXPECT_EQ(at_edge["counts"]["cameras"], 1) << "of two runs";
  EXPECT_EQ(at_edge["counts"]["camera_received_bytes"], 2000);
  EXPECT_EQ(at_edge["counts"]["camera_shares"], 6);
  EXPECT_EQ(at_edge["counts"]["camera_merges"], 4);
  EXPECT_THAT(findings(at_edge, "error"), ElementsAre(HasSubstr("could not be merged")));
  EXPECT_THAT(findings(at_edge, "warning"), ElementsAre(HasSubstr("refused 2 messages of cameras")));

  LiveRobotCounts robot;
  EXPECT_FALSE(tier_status(RobotId("alpha"), TierId("north"), robot, kLongUp)["counts"].contains("cameras"));
  robot.sharing = {2, 1, 500, 300, 12, 80, ""};
  const Json alone = tier_status(RobotId("alpha"), TierId("north"), robot, kLongUp);
  EXPECT_EQ(alone["counts"]["shared_keyframes"], 12);
  EXPECT_EQ(alone["counts"]["borrowed_landmarks"], 80);
  EXPECT_THAT(findings(alone, "warning"), Contains(HasSubstr("1 of its 2 cameras have no answer of edge north")));
  robot.sharing->refusal = "its vocabulary is another one";
  EXPECT_THAT(findings(tier_status(RobotId("alpha"), TierId("north"), robot, kLongUp), "warning"),
              Contains(HasSubstr("refuses: its vocabulary")));
}

TEST(LiveStatus, is_healthy_without_errors_alone) {
  LiveEdgeCounts edge = mapping_edge();
  edge.robots[0].lost_scans = 1;
  const auto status = [&] {
    return program_status("demo", "demo",
                          {tier_status(collecting_cloud(), kLongUp), tier_status(TierId("north"), edge, kLongUp)},
                          kLongUp);
  };
  EXPECT_TRUE(status()["is_healthy"]) << "a warning is no error";
  edge.trouble = "disk full";
  EXPECT_FALSE(status()["is_healthy"]);
  EXPECT_EQ(status()["problems"], Json::parse(R"(["edge north: disk full"])"));
  EXPECT_GT(status()["process"]["cpu_seconds"], 0.0);
  EXPECT_GT(status()["process"]["resident_bytes"], 1 << 20);
}

// Every sample by its name and labels. Fails on what Prometheus would not read.
std::map<std::string, double> parsed(const std::string& text) {
  static const std::regex kSample(
      R"re((mapweave_[a-z_]+)(\{[a-z_]+="(?:[^"\\]|\\.)*"(?:,[a-z_]+="(?:[^"\\]|\\.)*")*\})? (-?[0-9.e+-]+))re"),
      kHelp(R"(# HELP (mapweave_[a-z_]+) \S.*)"), kType("# TYPE (mapweave_[a-z_]+) (counter|gauge)");
  std::map<std::string, double> samples;
  std::set<std::string> begun;
  std::string helped, typed, kind, line;
  std::istringstream lines(text);
  while (std::getline(lines, line)) {
    std::smatch found;
    if (std::regex_match(line, found, kHelp)) {
      helped = found[1];
      EXPECT_TRUE(begun.insert(helped).second) << line;
    } else if (std::regex_match(line, found, kType)) {
      typed = found[1];
      kind = found[2];
      EXPECT_EQ(typed, helped);
    } else if (std::regex_match(line, found, kSample)) {
      EXPECT_EQ(found[1], typed) << line;
      EXPECT_EQ(kind == "counter", std::regex_match(found[1].str(), std::regex(".*_total"))) << line;
      EXPECT_TRUE(samples.emplace(found[1].str() + found[2].str(), std::stod(found[3])).second) << line;
    } else {
      ADD_FAILURE() << "not a line of the format: " << line;
    }
  }
  EXPECT_EQ(text.back(), '\n');
  return samples;
}

TEST(LiveMetrics, hold_every_number_of_the_status) {
  LiveRobotCounts robot;
  robot.recorded_s = 12.5;
  const Json status =
      program_status("demo", "demo",
                     {tier_status(collecting_cloud(), kLongUp), tier_status(TierId("north"), mapping_edge(), kLongUp),
                      tier_status(RobotId("alpha"), TierId("north"), robot, kLongUp)},
                     kLongUp);
  const auto samples = parsed(metrics_text(status));
  EXPECT_EQ(samples.at("mapweave_healthy"), 1.0);
  EXPECT_EQ(samples.at(R"(mapweave_recorded_seconds{role="robot",tier="alpha"})"), 12.5);
  EXPECT_EQ(samples.at(R"(mapweave_joined_maps{role="cloud",tier="cloud"})"), 2.0);
  EXPECT_EQ(samples.at(R"(mapweave_link_taken_total{role="cloud",tier="cloud",peer_role="edge",peer="north"})"), 12.0);
  EXPECT_EQ(samples.at(R"(mapweave_link_scans_total{role="edge",tier="north",peer_role="robot",peer="alpha"})"), 20.0);
  EXPECT_GT(samples.at("mapweave_process_cpu_seconds_total"), 0.0);
  const auto has = [&](const std::string& metric) {
    return std::any_of(samples.begin(), samples.end(), [&](const auto& sample) {
      return sample.first.rfind(metric + "{", 0) == 0 || sample.first.rfind(metric + "_total{", 0) == 0;
    });
  };
  for (const Json& tier : status["tiers"]) {
    for (const auto& [key, value] : tier["counts"].items()) EXPECT_TRUE(has("mapweave_" + key)) << key;
    for (const Json& link : tier["links"])
      for (const auto& [key, value] : link["counts"].items()) EXPECT_TRUE(has("mapweave_link_" + key)) << key;
  }
}

TEST(LiveMetrics, escape_what_names_hold) {
  const Json status = program_status("cloud", "a\"b\\c\nd", {}, kLongUp);
  const auto samples = parsed(metrics_text(status));
  EXPECT_EQ(
      std::count_if(samples.begin(), samples.end(),
                    [](const auto& sample) { return sample.first.find(R"(name="a\"b\\c\nd")") != std::string::npos; }),
      1);
}

}  // namespace
}  // namespace mapweave::runtime
