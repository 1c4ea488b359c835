#include <mapweave/runtime/run_configuration.h>

#include <gmock/gmock.h>
#include <mapweave/core/exit_code.h>
#include <mapweave/core/files.h>
#include <support/temporary_folder.h>

#include <algorithm>

namespace mapweave::runtime {
namespace {

using testing::HasSubstr;

std::string zeros(int count) {
  std::string text;
  for (int i = 0; i < count; ++i) text += " 0";
  return text;
}

struct PlanTest : testing::Test {
  PlanTest() {
    for (const char* log : {"a.rawlog", "b.rawlog", "c.rawlog"}) write_file(folder / log, "a log");
    for (const char* list : {"robots", "edges"})
      for (const char* number : {".0", ".1", ".2"})
        for (const char* field : {".id", ".log", ".edge"})
          origins.set(std::string(list) + number + field,
                      {std::string("team.yaml: ") + list + number + field, folder / "team.yaml"});
  }
  RunPlan plan() { return make_plan(configuration, origins); }
  std::string complaint() {
    try {
      plan();
    } catch (const Error& error) {
      EXPECT_EQ(exit_code(error.code()), ExitCode::bad_input);
      return error.what();
    }
    return "none";
  }
  test::TemporaryFolder folder;
  RunConfiguration configuration;
  Origins origins;
};

TEST_F(PlanTest, takes_a_folder_of_pictures_for_a_log) {
  std::filesystem::create_directory(folder / "walk");
  configuration.robots = {{"", "walk/", ""}};
  const RunPlan made = plan();
  ASSERT_EQ(made.robots.size(), 1u);
  EXPECT_EQ(made.robots[0].id, RobotId("walk"));
}

TEST_F(PlanTest, sorts_robots_and_finds_their_logs_beside_the_configuration) {
  configuration.robots = {{"beta", "b.rawlog", "south"}, {"alpha", "a.rawlog", "north"}};
  const RunPlan made = plan();
  ASSERT_EQ(made.robots.size(), 2u);
  EXPECT_EQ(made.robots[0].id, RobotId("alpha"));
  EXPECT_EQ(made.robots[0].edge, TierId("north"));
  EXPECT_EQ(made.robots[0].log, folder / "a.rawlog");
  EXPECT_THAT(made.edges, testing::ElementsAre(TierId("north"), TierId("south")));
}

TEST_F(PlanTest, refuses_wires_of_nobody_and_traces_that_are_not_there) {
  configuration.robots = {{"alpha", "a.rawlog", "north"}, {"beta", "b.rawlog", "south"}};
  LinkEntry link;
  link.from = "alpa";
  link.to = "north";
  configuration.network.links = {link};
  EXPECT_THAT(complaint(), HasSubstr("did you mean 'alpha'?"));
  configuration.network.links[0].from = "alpha";
  configuration.network.links[0].to = "beta";
  EXPECT_THAT(complaint(), HasSubstr("unknown robot or edge 'beta'; the configuration has: "));
  configuration.network.links[0].to = "cloud";
  EXPECT_EQ(complaint(), "none");
  configuration.network.edge_cloud.trace = "nothing.csv";
  EXPECT_THAT(complaint(), HasSubstr("nothing.csv"));
}

TEST_F(PlanTest, takes_a_vocabulary_beside_the_configuration_for_cameras_and_merges) {
  write_file(folder / "words.txt", "2 1 0 0\n0 1" + zeros(31) + " 7 1\n0 1" + zeros(32) + " 1\n");
  origins.set("visual.vocabulary", {"team.yaml:3", folder / "team.yaml"});
  configuration.visual.vocabulary = "words.txt";
  read_vocabulary(configuration, origins);
  EXPECT_EQ(configuration.visual.vocabulary, (folder / "words.txt").string());
  EXPECT_EQ(configuration.visual.chosen_vocabulary.get().words(), 2U);
  EXPECT_EQ(configuration.fusion.visual.vocabulary.get().hash(), configuration.visual.chosen_vocabulary.get().hash());
  configuration.visual.vocabulary = "none.txt";
  try {
    read_vocabulary(configuration, origins);
    FAIL() << "there is no such file";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), testing::AllOf(HasSubstr("none.txt"), HasSubstr("team.yaml:3")));
  }
}

TEST_F(PlanTest, refuses_an_edge_that_is_not_among_those_listed) {
  configuration.robots = {{"alpha", "a.rawlog", "nort"}, {"beta", "b.rawlog", "north"}};
  configuration.edges = {{"north"}};
  EXPECT_THAT(complaint(), testing::AllOf(HasSubstr("did you mean 'north'?"), HasSubstr("robots.0.edge")));
}

TEST_F(PlanTest, gives_robots_without_an_edge_to_the_edges_in_turn_whatever_the_order_of_the_list) {
  configuration.edges = {{"west"}, {"east"}};
  configuration.robots = {{"r1", "a.rawlog", ""}, {"r2", "b.rawlog", ""}, {"r3", "c.rawlog", ""}};
  for (int order = 0; order < 2; ++order) {
    const RunPlan made = plan();
    EXPECT_EQ(made.robots[0].edge, TierId("west"));
    EXPECT_EQ(made.robots[1].edge, TierId("east"));
    EXPECT_EQ(made.robots[2].edge, TierId("west"));
    std::reverse(configuration.robots.begin(), configuration.robots.end());
  }
}

TEST_F(PlanTest, names_robots_after_their_logs_and_needs_no_edges) {
  configuration.robots = {{"", "b.rawlog", ""}, {"", "a.rawlog", ""}};
  const RunPlan made = plan();
  EXPECT_EQ(made.robots[0].id, RobotId("a"));
  EXPECT_EQ(made.edges.size(), 1u);
}

TEST_F(PlanTest, carries_out_the_effective_configuration_as_the_first_one) {
  configuration.robots = {{"beta", "b.rawlog", ""}, {"", "a.rawlog", ""}};
  configuration.edges = {{"west"}, {"east"}};
  const RunPlan first = plan();
  configuration = effective(configuration, first);
  const RunPlan second = plan();
  ASSERT_EQ(second.robots.size(), 2u);
  for (std::size_t i = 0; i < 2; ++i) {
    EXPECT_EQ(first.robots[i].id, second.robots[i].id);
    EXPECT_EQ(first.robots[i].edge, second.robots[i].edge);
    EXPECT_EQ(first.robots[i].log, second.robots[i].log);
  }
}

TEST_F(PlanTest, lets_a_robot_have_options_of_its_own) {
  write_file(folder / "team.yaml",
             "laser: {engine: rbpf, graph: {front_end: {submap_length_m: 5}}}\n"
             "robots:\n"
             "  - {id: alpha, log: a.rawlog, sensor: \"rgbd\", laser: {graph: {front_end: {submap_length_m: 3}}}}\n"
             "  - {id: beta, log: b.rawlog}\n");
  origins = load(configuration, {{folder / "team.yaml"}, {}, {"robots.0.laser.engine=icp"}});
  const RunPlan made = plan();
  const RunConfiguration& alpha = configuration_of(configuration, made.robots[0]);
  EXPECT_EQ(alpha.sensor, "rgbd");
  EXPECT_EQ(alpha.laser.engine, laser::Engine::icp);
  EXPECT_EQ(alpha.laser.graph.front_end.submap_length_m, 3.0);
  const RunConfiguration& beta = configuration_of(configuration, made.robots[1]);
  EXPECT_EQ(&beta, &configuration);
  EXPECT_EQ(beta.laser.graph.front_end.submap_length_m, 5.0);
  EXPECT_EQ(beta.laser.engine, laser::Engine::rbpf);

  write_file(folder / "again.yaml", to_yaml(effective(configuration, made)));
  RunConfiguration again;
  const Origins of_again = load(again, {{folder / "again.yaml"}, {}, {}});
  const RunPlan second = make_plan(again, of_again);
  EXPECT_EQ(to_yaml(configuration_of(again, second.robots[0]).laser), to_yaml(alpha.laser)) << "as it was carried out";
  EXPECT_EQ(configuration_of(again, second.robots[0]).sensor, "rgbd");
}

TEST_F(PlanTest, refuses_options_of_a_robot_alone_that_cannot_be_and_says_where_they_stand) {
  const auto complaint_of = [&](const std::string& line) {
    write_file(folder / "team.yaml", "robots:\n  - id: alpha\n    log: a.rawlog\n    " + line + "\n");
    configuration = {};
    try {
      origins = load(configuration, {{folder / "team.yaml"}, {}, {}});
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return complaint();
  };
  EXPECT_THAT(complaint_of("laser: {enginge: icp}"),
              testing::AllOf(HasSubstr("team.yaml:4"), HasSubstr("laser.enginge"), HasSubstr("laser.engine")));
  EXPECT_THAT(complaint_of("laser: {engine: best}"), testing::AllOf(HasSubstr("team.yaml:4"), HasSubstr("'best'")));
  EXPECT_THAT(complaint_of("sensor: sonar"), testing::AllOf(HasSubstr("team.yaml:4"), HasSubstr("'sonar'")));
  EXPECT_THAT(complaint_of("laser: {graph: [1]}"), HasSubstr("is a list"));
  EXPECT_THAT(complaint_of("laser: {engine: }"), HasSubstr("has no value"));
  EXPECT_THAT(complaint_of("visual: {vocabulary: words.gz}"), HasSubstr("vocabulary of its own"));
  EXPECT_THAT(complaint_of("fusion: {stride_m: 1}"), HasSubstr("unknown key 'fusion'"));
}

TEST(RunConfiguration, takes_options_by_the_keys_of_earlier_versions) {
  RunConfiguration configuration;
  testing::internal::CaptureStderr();
  load(configuration, {{},
                       {},
                       {"bind.longest_gap_s=2", "bind.tie_m=0.11", "bind.tie_rad=0.12", "bind.step_m=0.13",
                        "bind.step_share=0.14", "bind.step_rad=0.15", "bind.least_shared=16", "rig.tie_m=0.21",
                        "rig.tie_rad=0.22", "rig.step_m=0.23", "rig.step_share=0.24", "rig.step_rad=0.25",
                        "rig.step_scale=0.26", "rig.way.doubt_m=0.27", "fusion.visual.companions=31"}});
  const std::string notes = testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::count(notes.begin(), notes.end(), '\n'), 15) << notes;
  const rig::LaserCameraOptions& alignment = configuration.laser_cameras;
  EXPECT_EQ(alignment.longest_gap_s, 2.0);
  EXPECT_EQ(alignment.extrinsic_sigma_m, 0.11);
  EXPECT_EQ(alignment.extrinsic_sigma_rad, 0.12);
  EXPECT_EQ(alignment.covisibility_sigma_m, 0.13);
  EXPECT_EQ(alignment.covisibility_sigma_per_m, 0.14);
  EXPECT_EQ(alignment.covisibility_sigma_rad, 0.15);
  EXPECT_EQ(alignment.least_shared, 16);
  EXPECT_EQ(configuration.rig.extrinsic_sigma_m, 0.21);
  EXPECT_EQ(configuration.rig.extrinsic_sigma_rad, 0.22);
  EXPECT_EQ(configuration.rig.covisibility_sigma_m, 0.23);
  EXPECT_EQ(configuration.rig.covisibility_sigma_per_m, 0.24);
  EXPECT_EQ(configuration.rig.covisibility_sigma_rad, 0.25);
  EXPECT_EQ(configuration.rig.covisibility_sigma_scale, 0.26);
  EXPECT_EQ(configuration.rig.trajectory.doubt_m, 0.27);
  EXPECT_EQ(configuration.fusion.visual.covisible, 31);
}

TEST_F(PlanTest, refuses_what_cannot_be_run_and_says_where_it_stands) {
  EXPECT_THAT(complaint(), HasSubstr("no robots"));
  configuration.robots = {{"alpha", "a.rawlog", "north"}, {"alpha", "b.rawlog", "north"}};
  EXPECT_THAT(complaint(), testing::AllOf(HasSubstr("two robots are called 'alpha'"),
                                          HasSubstr("team.yaml: robots.1.id"), HasSubstr("robots.0.id")));
  configuration.robots = {{"../alpha", "a.rawlog", ""}};
  EXPECT_THAT(complaint(), testing::AllOf(HasSubstr("'../alpha'"), HasSubstr("robots.0.id")));
  configuration.robots = {{"alpha", "a.rawlog", "no/rth"}};
  EXPECT_THAT(complaint(), testing::AllOf(HasSubstr("'no/rth'"), HasSubstr("robots.0.edge")));
  configuration.robots = {{"alpha", "a.rawlog", "cloud"}};
  EXPECT_THAT(complaint(), HasSubstr("tier above"));
  configuration.robots = {{"alpha", "", ""}};
  EXPECT_THAT(complaint(), HasSubstr("without a log"));
  configuration.robots = {{"alpha", "none.rawlog", ""}};
  EXPECT_THAT(complaint(), testing::AllOf(HasSubstr("there is no log"), HasSubstr("robots.0.log")));
  configuration.robots = {{"alpha", "a.rawlog", "north"}};
  configuration.edges = {{"north"}, {"south"}};
  EXPECT_THAT(complaint(),
              testing::AllOf(HasSubstr("no robot uses edge 'south'"), HasSubstr("edges.1.id"), HasSubstr("remove it")));
  configuration.edges = {{"north"}, {"north"}};
  EXPECT_THAT(complaint(), HasSubstr("two edges are called 'north'"));
}

TEST(NameOfFile, is_fit_for_a_robot) {
  EXPECT_EQ(name_of_file("logs/office east.rawlog.gz"), "office-east");
  EXPECT_EQ(name_of_file("intel.clf.gz"), "intel");
  EXPECT_EQ(name_of_file("hall.yaml"), "hall");
  EXPECT_EQ(name_of_file("hall.yml"), "hall");
  EXPECT_EQ(name_of_file("x.yaml.mwdb"), "x.yaml");
  EXPECT_EQ(name_of_file("edge.mwj"), "edge");
  EXPECT_EQ(name_of_file("2006-01ENE-21-SENA_Telecom Faculty_one_loop_only.rawlog"),
            "2006-01ENE-21-SENA_Telecom-Faculty_one_loop_only");
  EXPECT_EQ(name_of_file(std::string(100, 'x') + ".rawlog"), std::string(64, 'x'));
}

TEST_F(PlanTest, leaves_robots_to_the_coordinator_and_edges_without_robots) {
  configuration.robots = {{"alpha", "a.rawlog", ""}, {"beta", "b.rawlog", "south"}};
  configuration.edges = {{"north"}, {"south"}, {"west"}};
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  const RunPlan made = plan();
  EXPECT_EQ(made.edges.size(), 3u);
  EXPECT_TRUE(made.robots[0].edge.empty());
  EXPECT_EQ(made.robots[1].edge, TierId("south"));
  EXPECT_EQ(effective(configuration, made).edges.size(), 3u);
  configuration.mode = Mode::cloud_only;
  EXPECT_THAT(complaint(), HasSubstr("cloud-only has none"));
  configuration.mode = Mode::onboard;
  configuration.coordinator.at = "sout";
  EXPECT_THAT(complaint(), HasSubstr("did you mean 'south'?"));
  configuration.coordinator.at.clear();
  configuration.coordinator.model = "model.json";
  EXPECT_THAT(complaint(), HasSubstr("model.json"));
}

TEST_F(PlanTest, refuses_edges_that_cannot_be) {
  configuration.robots = {{"alpha", "a.rawlog", ""}, {"beta", "b.rawlog", ""}, {"gamma", "c.rawlog", ""}};
  configuration.edges = {{"north"}};
  configuration.edges[0].capacity = 2;
  EXPECT_THAT(complaint(), HasSubstr("takes 2 robots, and 3 use it"));
  configuration.coordinator.method = scheduling::PlanMethod::standard;
  EXPECT_THAT(complaint(), HasSubstr("hold 2 of 3 robots"));
  configuration.edges[0].capacity = 0;
  configuration.edges[0].from_s = 5.0;
  configuration.edges[0].until_s = 4.0;
  EXPECT_THAT(complaint(), HasSubstr("goes before it comes"));
  configuration.edges[0].until_s = 0.0;
  configuration.cloud.at = "cloud";
  EXPECT_THAT(complaint(), HasSubstr("unknown edge 'cloud'; the configuration has: north"));
  configuration.cloud.at = "north";
  configuration.cloud.push_to = {"alpha", "delta"};
  EXPECT_THAT(complaint(), HasSubstr("unknown robot 'delta'; the configuration has: alpha, "));
  configuration.cloud.push_to = {"alpha"};
  EXPECT_EQ(complaint(), "none");
  configuration.edges.push_back({"south"});
  configuration.edges[0].from_s = 0.0;
  configuration.edges[0].until_s = 4.0;
  EXPECT_THAT(complaint(), testing::AllOf(HasSubstr("cloud.at names edge 'north'"), HasSubstr("until_s")));
  configuration.cloud.at = "south";
  configuration.coordinator.at = "north";
  EXPECT_THAT(complaint(),
              testing::AllOf(HasSubstr("coordinator.at names edge 'north'"), HasSubstr("edge that stays")));
  configuration.coordinator.at = "south";
  EXPECT_EQ(complaint(), "none");
}

}  // namespace
}  // namespace mapweave::runtime
