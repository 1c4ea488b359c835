// Runs that begin with the maps of sessions before.

#include "simulated_team.h"

#include <mapweave/core/files.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/runtime/batch_runner.h>
#include <mapweave/tiers/edge_server.h>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <set>

namespace mapweave::runtime {
namespace {

using test_support::simulated_team;
using testing::ElementsAre;
using testing::HasSubstr;
namespace fs = std::filesystem;

struct StartMapsTest : testing::Test {
  // One robot's log, mapped under a name of its own.
  Report slam(const std::string& robot, const std::string& log, const std::vector<fs::path>& maps,
              const std::string& out) {
    RunConfiguration one = configuration;
    one.robots = {{robot, simulated_team().log(log).string(), ""}};
    one.edges.clear();
    for (const fs::path& map : maps) one.maps.push_back(map.string());
    return run_slam(one, make_plan(one, {}), {folder / out, false, false}, pool, *silent);
  }
  Report run(const std::string& out) {
    return run_batch(configuration, make_plan(configuration, {}), {folder / out, false, false}, pool, *silent);
  }
  std::string error_of(const std::vector<fs::path>& maps) {
    try {
      slam("alpha", "beta", maps, "no");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  }
  std::vector<std::string> names(const fs::path& store) const {
    std::vector<std::string> result;
    for (const mapdb::MemberMap& member : mapdb::read_store(store).members) {
      result.push_back(member.own.id.str());
      for (const RobotId robot : member.own.robots())
        if (robot.str() != member.own.id.str()) result.back() += " of " + robot.str();
    }
    std::sort(result.begin(), result.end());
    return result;
  }
  test::TemporaryFolder folder;
  RunConfiguration configuration = simulated_team().configuration();
  WorkerPool pool{1};
  std::unique_ptr<Progress> silent = make_silent_progress();
};

TEST_F(StartMapsTest, gives_sessions_of_one_robot_numbers_that_they_keep) {
  slam("alpha", "alpha", {}, "one");
  const Report two = slam("alpha", "beta", {folder / "one"}, "two");
  EXPECT_THAT(two.notes, testing::Contains(HasSubstr("'alpha' of " + (folder / "one").string())));
  ASSERT_EQ(two.team.components.size(), 1u) << "they share rooms";
  EXPECT_THAT(names(folder / "two/map.mwdb"), ElementsAre("alpha", "alpha-1"));
  EXPECT_EQ(two.team.frames.at(0).by, MapId("alpha-1"));
  EXPECT_TRUE(fs::exists(folder / "two/robots/alpha/map.mwdb"));
  EXPECT_TRUE(fs::exists(folder / "two/merges.json"));

  // A third one, of a recording that is known already: the report says so, and the others go on.
  const Report three = slam("alpha", "alpha", {folder / "two/map.mwdb"}, "three");
  EXPECT_EQ(three.exit_code(), ExitCode::stayed_apart);
  std::set<std::string> members;
  for (const auto& component : three.team.components)
    for (const MapId& id : component) members.insert(id.str());
  EXPECT_THAT(members, ElementsAre("alpha", "alpha-1", "alpha-2"));
}

TEST_F(StartMapsTest, keeps_the_first_place_where_it_was_in_run_and_slam) {
  slam("before", "alpha", {}, "one");
  const Map own = mapdb::read_store(folder / "one/map.mwdb").maps.at(0);
  configuration.robots.erase(configuration.robots.begin());
  configuration.maps = {(folder / "one").string()};
  const Report report = run("team");
  ASSERT_EQ(report.team.components.size(), 1u);
  EXPECT_EQ(report.team.frames.at(0).by, MapId("before"));
  configuration.maps.clear();
  slam("beta", "beta", {folder / "one"}, "slam");
  for (const char* store : {"team/team/map.mwdb", "slam/map.mwdb"}) {
    const Map team = mapdb::read_store(folder / store).maps.at(0);
    const auto& [id, node] = own.nodes.front();
    const Node* kept = team.nodes.find(id);
    ASSERT_NE(kept, nullptr) << store;
    EXPECT_LT((kept->map_from_node.t - node.map_from_node.t).norm(), 1e-9) << store;
  }
  const auto config = read_file(folder / "team/config.yaml");
  EXPECT_THAT(config, HasSubstr((folder / "one").string()));
  const auto manifest = nlohmann::json::parse(read_file(folder / "team/manifest.json"));
  EXPECT_THAT(manifest["inputs"].dump(), HasSubstr("one/map.mwdb"));
}

TEST_F(StartMapsTest, keeps_the_names_of_robots_that_the_run_does_not_have) {
  slam("zeta", "alpha", {}, "zeta");
  slam("zeta", "beta", {}, "other");
  const Report report = slam("alpha", "beta", {folder / "zeta", folder / "other"}, "both");
  std::set<std::string> members;
  for (const auto& component : report.team.components)
    for (const MapId& id : component) members.insert(id.str());
  EXPECT_THAT(members, ElementsAre("alpha", "zeta", "zeta-1"));
  EXPECT_THAT(report.notes, testing::Contains(HasSubstr("another map that the run begins with has a robot of that")));
}

TEST_F(StartMapsTest, refuses_what_is_no_start) {
  slam("alpha", "alpha", {}, "one");
  EXPECT_THAT(error_of({folder / "none.mwdb"}), HasSubstr("there is no map"));
  EXPECT_THAT(error_of({folder / "one", folder / "one/map.mwdb"}), HasSubstr("given twice"));
  EXPECT_THAT(error_of({folder / "one/map.yaml"}), HasSubstr("map_server grid"));
  write_file(folder / "one/broken.mwdb", read_file(folder / "one/map.mwdb").substr(0, 3000));
  EXPECT_THAT(error_of({folder / "one/broken.mwdb"}), HasSubstr("broken.mwdb"));
  fs::create_directories(folder / "robot");
  write_file(folder / "robot/next_run.yaml", "maps: []\n");
  EXPECT_THAT(error_of({folder / "robot"}), HasSubstr("names no maps"));
  configuration.sensor = "rgbd";
  EXPECT_NE(error_of({folder / "one"}), "");
  EXPECT_FALSE(fs::exists(folder / "no"));
}

TEST_F(StartMapsTest, lets_a_robot_go_on_with_the_map_that_it_was_sent) {
  configuration.cloud.push_to = {"beta"};
  const Report report = run("first");
  ASSERT_EQ(report.work.pushes.size(), 1u);
  EXPECT_EQ(report.work.pushes[0].next_run, "robots/beta/next_run.yaml");
  const fs::path sent = folder / "first/robots/beta/team/map.mwdb";
  const Map team = mapdb::read_store(sent).maps.at(0);
  EXPECT_EQ(report.work.pushes[0].bytes, tiers::first_update(team, cloud_tier()).size()) << "what it has was sent";
  configuration.cloud.push_to.clear();
  const Report next = slam("gamma", "beta", {folder / "first/robots/beta"}, "second");
  EXPECT_EQ(next.team.frames.size(), next.team.components.size());
  std::set<std::string> members;
  for (const auto& component : next.team.components)
    for (const MapId& id : component) members.insert(id.str());
  EXPECT_TRUE(members.count("team-1") == 1 || report.team.components.size() > 1) << "the sent map, as one";
}

}  // namespace
}  // namespace mapweave::runtime
