#include "simulated_team.h"

#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/merge_runner.h>

#include <gmock/gmock.h>

#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/mapdb/map_store.h>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>

#include <sys/resource.h>
#include <csignal>

namespace mapweave::runtime {
namespace {

using nlohmann::json;
using test_support::simulated_team;
using testing::HasSubstr;
namespace fs = std::filesystem;

json parsed(const fs::path& file) { return json::parse(read_file(file)); }

std::string entries(const fs::path& folder) {
  std::set<std::string> names;
  if (fs::exists(folder))
    for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename());
  std::string text;
  for (const auto& name : names) text += name + " ";
  return text;
}

// Interrupts as soon as the named task begins.
class InterruptAt : public Progress {
 public:
  explicit InterruptAt(std::string task) : task_(std::move(task)) {}
  int begin(std::string_view task, std::uint64_t, std::string_view) override {
    if (task == task_) request_interrupt();
    return 0;
  }
  void advance(int, std::uint64_t) override {}
  void end(int) override {}
  void say(std::string_view) override {}

 private:
  std::string task_;
};

struct BatchTest : testing::Test {
  ~BatchTest() override { clear_interrupt(); }
  Report run(const std::string& out, int threads = 1, bool keep_going = false, Progress* watched = nullptr) {
    WorkerPool pool(threads);
    return run_batch(configuration, make_plan(configuration, {}), {folder / out, false, keep_going}, pool,
                     watched != nullptr ? *watched : *silent);
  }
  void break_log(const std::string& robot) {  // cut in the middle
    const std::string bytes = read_file(simulated_team().log(robot));
    write_file(folder / (robot + ".rawlog"), std::string_view(bytes).substr(0, bytes.size() / 2));
    for (RobotEntry& entry : configuration.robots)
      if (entry.id == robot) entry.log = folder / (robot + ".rawlog");
  }
  test::TemporaryFolder folder;
  RunConfiguration configuration = simulated_team().configuration();
  std::unique_ptr<Progress> silent = make_silent_progress();
};

// As a user writes it, of both robots: their starts, if any.
RunConfiguration with_starts(RunConfiguration configuration, const std::string& alpha, const std::string& beta,
                             const test::TemporaryFolder& folder) {
  const auto line = [&](const std::string& id, const std::string& start) {
    const std::string log = "\"" + simulated_team().log(id).string() + "\"";
    return "  - {id: " + id + ", log: " + log + (start.empty() ? "" : ", start: {" + start + "}") + "}\n";
  };
  write_file(folder / "run.yaml", "robots:\n" + line("alpha", alpha) + line("beta", beta));
  const Origins origins = load(configuration, {{folder / "run.yaml"}, {}, {}});
  complete_starts(configuration, origins);
  return configuration;
}

TEST_F(BatchTest, takes_starts_of_a_configuration_as_priors_also_without_their_sigma) {
  const RunConfiguration plain = configuration;
  configuration = with_starts(plain, "x_m: 0.0, y_m: 0.0", "y_m: 40.0", folder);
  EXPECT_EQ(configuration.robots[0].start.sigma_m, 0.5);
  const Report report = run("out");
  ASSERT_EQ(report.team.verdicts.size(), 1u);
  ASSERT_TRUE(report.team.verdicts[0].prior);
  EXPECT_NEAR(report.team.verdicts[0].prior->a_from_b.y, 40.0, 1.0);
  EXPECT_TRUE(report.team.verdicts[0].prior->is_contradicted);
  EXPECT_THAT(in_words(report, "out"), HasSubstr("the prior is contradicted"));
  // As a team merged again knows it, and as the printed configuration says it.
  WorkerPool pool(1);
  const Report again = run_merge({}, {folder / "out"}, {folder / "again", false}, pool, *silent);
  ASSERT_TRUE(again.team.verdicts.at(0).prior);
  EXPECT_EQ(again.team.verdicts[0].prior->a_from_b.y, report.team.verdicts[0].prior->a_from_b.y);
  RunConfiguration printed;
  complete_starts(printed, load(printed, {{folder / "out/config.yaml"}, {}, {}}));
  EXPECT_EQ(printed.robots[1].start.sigma_m, 0.5);
}

TEST_F(BatchTest, says_that_one_start_alone_says_nothing) {
  configuration = with_starts(configuration, "", "x_m: 3.0, y_m: 1.0", folder);
  EXPECT_EQ(configuration.robots[0].start.sigma_m, 0.0);
  const Report report = run("out");
  EXPECT_THAT(report.notes, testing::Contains(HasSubstr("where beta began is known, but of no other robot")));
  EXPECT_FALSE(report.team.verdicts.at(0).prior);
  RunConfiguration printed;
  complete_starts(printed, load(printed, {{folder / "out/config.yaml"}, {}, {}}));
  EXPECT_EQ(printed.robots[0].start.sigma_m, 0.0) << "what was not said stays unknown";
}

TEST_F(BatchTest, leaves_the_files_of_the_contract) {
  const Report report = run("out");
  EXPECT_EQ(entries(folder.path()), "out ");
  for (const char* file : {"config.yaml", "manifest.json", "summary.json", "merges.json"})
    EXPECT_TRUE(fs::exists(folder / "out" / file)) << file;
  for (const char* map : {"robots/alpha", "robots/beta", "edges/north", "edges/south", "team"})
    for (const char* file : {"map.mwdb", "map.png", "map.color.png", "map.pgm", "map.yaml", "map.pcd"})
      EXPECT_TRUE(fs::exists(folder / "out" / map / file)) << map << "/" << file;
  for (const char* trajectory : {"robots/alpha/trajectory.tum", "edges/south/trajectory.tum",
                                 "team/trajectories/alpha.tum", "team/trajectories/beta.tum"})
    EXPECT_TRUE(fs::exists(folder / "out" / trajectory)) << trajectory;
  ASSERT_EQ(report.robots.size(), 2u);
  EXPECT_EQ(report.robots[0].id, RobotId("alpha"));
  EXPECT_GT(report.robots[0].scans, 10u);
  const json summary = parsed(folder / "out/summary.json");
  EXPECT_EQ(summary["team"]["components"], report.team.components.size());
  EXPECT_GT(summary["peak_rss_bytes"], 1000000);
  EXPECT_EQ(parsed(folder / "out/manifest.json")["inputs"].size(), 2u);
}

TEST_F(BatchTest, leaves_the_same_bytes_for_any_number_of_threads_and_any_order_of_robots) {
  configuration.team.frame = "alpha";
  run("one", 1);
  std::reverse(configuration.robots.begin(), configuration.robots.end());
  run("two", 2);
  json one = parsed(folder / "one/manifest.json"), two = parsed(folder / "two/manifest.json");
  for (json* manifest : {&one, &two}) (*manifest)["outputs"].erase("config.yaml");  // robots as they were listed
  EXPECT_EQ(one["outputs"], two["outputs"]);
  EXPECT_GT(one["outputs"].size(), 30u);
  EXPECT_EQ(one["inputs"], two["inputs"]);
  json merges[] = {parsed(folder / "one/merges.json"), parsed(folder / "two/merges.json")};
  for (json& list : merges)
    for (json& merge : list) merge.erase("seconds");
  EXPECT_EQ(merges[0], merges[1]);
}

TEST_F(BatchTest, sends_each_place_once_and_makes_nearly_the_map_of_whole_maps) {
  const Report thin = run("thin");
  configuration.cloud.maps.thin = false;
  const Report whole = run("whole");
  ASSERT_EQ(thin.team.components, whole.team.components);
  EXPECT_LT(thin.work.edges[0].bytes, whole.work.edges[0].bytes);
  const json edge = parsed(folder / "thin/summary.json")["timeline"]["edges"][0];
  EXPECT_GT(edge["sent_scans"], 0);
  EXPECT_LT(edge["sent_scans"], edge["scans"]);
  EXPECT_LT(edge["walls_left_out"], 0.1);
  EXPECT_EQ(parsed(folder / "whole/summary.json")["timeline"]["edges"][0]["sent_scans"], 0);
  EXPECT_THAT(in_words(thin, "thin"), HasSubstr("scans to the cloud"));
  std::ifstream one(folder / "thin/team/trajectories/beta.tum"), other(folder / "whole/team/trajectories/beta.tum");
  std::size_t poses = 0;
  for (double a[8], b[8]; one >> a[0] && other >> b[0]; ++poses) {
    for (int i = 1; i < 8; ++i) {
      one >> a[i];
      other >> b[i];
    }
    ASSERT_EQ(a[0], b[0]) << "every pose is there";
    ASSERT_LT(std::hypot(a[1] - b[1], a[2] - b[2]), 0.05);
  }
  EXPECT_GT(poses, 20u);
}

TEST_F(BatchTest, makes_the_same_maps_whoever_maps_and_joins) {
  configuration.cloud.maps.thin = false;
  const Report by_edges = run("offload");
  configuration.mode = Mode::onboard;
  const Report by_robots = run("onboard");
  configuration.mode = Mode::cloud_only;
  const Report by_cloud = run("cloud-only");
  for (const char* other : {"onboard", "cloud-only"})
    for (const char* file : {"robots/alpha/map.mwdb", "robots/beta/map.mwdb", "team/map.mwdb", "team/map.pgm",
                             "team/trajectories/beta.tum"})
      EXPECT_EQ(read_file(folder / "offload" / file), read_file(folder / other / file)) << other << " " << file;
  ASSERT_EQ(by_cloud.team.verdicts.size(), by_edges.team.verdicts.size());
  EXPECT_EQ(by_cloud.team.verdicts[0].decision, by_edges.team.verdicts[0].decision);
  EXPECT_EQ(by_cloud.team.verdicts[0].witnesses, by_edges.team.verdicts[0].witnesses);
  EXPECT_FALSE(fs::exists(folder / "cloud-only/edges"));
  const json offloaded = parsed(folder / "offload/summary.json")["timeline"]["robots"][0];
  EXPECT_GT(offloaded["sensed_bytes"], 1000);
  EXPECT_GT(offloaded["packing_cpu_seconds"], 0.0);
  EXPECT_EQ(parsed(folder / "onboard/summary.json")["timeline"]["robots"][0]["sensed_bytes"], 0);
  EXPECT_GT(by_cloud.work.robots[0].map_bytes, 1000U);
  EXPECT_EQ(by_cloud.work.robots[0].map_bytes, by_robots.work.robots[0].map_bytes);
}

TEST_F(BatchTest, maps_again_what_its_own_config_says) {
  run("first");
  const RunConfiguration before = configuration;
  configuration = {};
  const Origins origins = load(configuration, {{folder / "first/config.yaml"}, {}, {}});
  run("again");
  EXPECT_EQ(parsed(folder / "first/manifest.json")["outputs"], parsed(folder / "again/manifest.json")["outputs"]);
}

TEST_F(BatchTest, ends_with_nothing_written_when_a_log_is_cut) {
  break_log("beta");
  try {
    run("out");
    FAIL() << "did not end";
  } catch (const Error& error) {
    EXPECT_EQ(exit_code(error.code()), ExitCode::bad_input);
    EXPECT_THAT(error.what(), HasSubstr("beta.rawlog"));
  }
  EXPECT_EQ(entries(folder.path()), "beta.rawlog ");
}

TEST_F(BatchTest, keeps_what_came_before_the_cut_and_the_others_when_asked_to) {
  break_log("beta");
  const Report report = run("out", 2, true);
  EXPECT_EQ(report.exit_code(), ExitCode::bad_input);
  EXPECT_FALSE(report.robots[0].trouble);
  ASSERT_TRUE(report.robots[1].trouble);
  EXPECT_TRUE(report.robots[1].mapped);
  EXPECT_TRUE(fs::exists(folder / "out/robots/alpha/map.mwdb"));
  EXPECT_TRUE(fs::exists(folder / "out/robots/beta/map.mwdb"));
  EXPECT_THAT(parsed(folder / "out/summary.json")["robots"][1]["trouble"].get<std::string>(), HasSubstr("beta.rawlog"));
}

TEST_F(BatchTest, goes_on_without_a_robot_whose_log_is_empty_when_asked_to) {
  write_file(folder / "empty.rawlog", "");
  configuration.robots[1].log = folder / "empty.rawlog";
  const Report report = run("out", 1, true);
  EXPECT_EQ(report.exit_code(), ExitCode::bad_input);
  EXPECT_FALSE(report.robots[1].mapped);
  EXPECT_TRUE(fs::exists(folder / "out/team/map.mwdb"));
  EXPECT_FALSE(fs::exists(folder / "out/robots/beta"));
}

TEST_F(BatchTest, goes_on_without_a_robot_whose_log_cannot_be_read_only_when_asked_to) {
  break_log("beta");
  const RunPlan plan = make_plan(configuration, {});
  fs::remove(folder / "beta.rawlog");  // after the plan was made
  WorkerPool pool(1);
  EXPECT_THROW(run_batch(configuration, plan, {folder / "out", false, false}, pool, *silent), Error);
  EXPECT_EQ(entries(folder.path()), "");
  const Report report = run_batch(configuration, plan, {folder / "out", false, true}, pool, *silent);
  ASSERT_TRUE(report.robots[1].trouble);
  EXPECT_THAT(report.robots[1].trouble->what(), HasSubstr("beta.rawlog"));
  EXPECT_TRUE(fs::exists(folder / "out/robots/alpha/map.mwdb"));
  EXPECT_EQ(parsed(folder / "out/manifest.json")["inputs"].size(), 1u);
}

TEST_F(BatchTest, makes_a_helper_that_cannot_start_the_trouble_of_its_robot) {
  configuration.laser.engine = laser::Engine::icp;
  configuration.laser.external.helper = folder / "missing";
  EXPECT_THROW(run("out"), Error);
  EXPECT_EQ(entries(folder.path()), "");
  const Report report = run("out", 1, true);
  for (const auto& robot : report.robots) {
    ASSERT_TRUE(robot.trouble);
    EXPECT_EQ(robot.trouble->code(), ErrorCode::kMissing);
  }
}

TEST_F(BatchTest, saves_robots_that_are_finished_when_interrupted) {
  InterruptAt interrupt("robot beta");
  const Report report = run("out", 1, false, &interrupt);
  EXPECT_EQ(report.exit_code(), ExitCode::interrupted);
  EXPECT_TRUE(fs::exists(folder / "out/robots/alpha/map.mwdb"));
  EXPECT_FALSE(fs::exists(folder / "out/robots/beta"));
  EXPECT_FALSE(fs::exists(folder / "out/team"));
  EXPECT_EQ(parsed(folder / "out/summary.json")["interrupted"], true);
}

// Ends it once so many records of a log were read.
class InterruptAfter : public Progress {
 public:
  explicit InterruptAfter(int records) : left_(records) {}
  int begin(std::string_view, std::uint64_t, std::string_view) override { return 0; }
  void advance(int, std::uint64_t) override {
    if (left_-- == 0) request_interrupt();
  }
  void end(int) override {}
  void say(std::string_view) override {}

 private:
  int left_;
};

TEST_F(BatchTest, slam_that_is_interrupted_saves_what_it_has_and_says_that_it_is_cut_short) {
  configuration.robots.resize(1);
  const RunPlan plan = make_plan(configuration, {});
  WorkerPool pool(1);
  const Report whole = run_slam(configuration, plan, {folder / "whole", false, false}, pool, *silent);
  InterruptAfter interrupt(40);
  const Report part = run_slam(configuration, plan, {folder / "part", false, false}, pool, interrupt);
  EXPECT_EQ(part.exit_code(), ExitCode::interrupted);
  EXPECT_GT(part.robots[0].scans, 5u);
  EXPECT_LT(part.robots[0].scans, whole.robots[0].scans);
  const json summary = parsed(folder / "part/summary.json");
  EXPECT_EQ(summary["interrupted"], true);
  EXPECT_EQ(summary["robots"][0]["cut_short"], true);
  EXPECT_EQ(parsed(folder / "part/manifest.json")["interrupted"], true);
  EXPECT_FALSE(parsed(folder / "whole/manifest.json").contains("interrupted"));
  EXPECT_TRUE(fs::exists(folder / "part/map.pgm"));
  EXPECT_THAT(in_words(part, "part"), HasSubstr("robot alpha: its log is cut short by an interruption after "));
  EXPECT_EQ(mapdb::read_store(folder / "part/map.mwdb").maps.front().nodes.empty(), false);
  EXPECT_TRUE(mapdb::summarize_store(folder / "part/map.mwdb").metadata.count("cut_short"));
}

TEST_F(BatchTest, slam_that_is_interrupted_before_it_has_anything_writes_nothing) {
  configuration.robots.resize(1);
  InterruptAt interrupt("robot alpha");
  WorkerPool pool(1);
  EXPECT_THROW(run_slam(configuration, make_plan(configuration, {}), {folder / "out", false, false}, pool, interrupt),
               Interrupted);
  EXPECT_EQ(entries(folder.path()), "");
}

TEST_F(BatchTest, what_is_interrupted_replaces_no_whole_result_but_stands_beside_it) {
  configuration.robots.resize(1);
  const RunPlan plan = make_plan(configuration, {});
  WorkerPool pool(1);
  run_slam(configuration, plan, {folder / "out", false, false}, pool, *silent);
  const std::string manifest = read_file(folder / "out/manifest.json");
  for (const char* beside : {"out.interrupted", "out.interrupted-2"}) {
    InterruptAfter interrupt(40);
    const Report part = run_slam(configuration, plan, {folder / "out", true, false}, pool, interrupt);
    EXPECT_EQ(part.exit_code(), ExitCode::interrupted);
    EXPECT_EQ(read_file(folder / "out/manifest.json"), manifest);
    EXPECT_TRUE(fs::exists(folder / beside / "map.mwdb"));
    EXPECT_THAT(in_words(part, "out"), HasSubstr("results: " + (folder / beside).string()));
  }
  EXPECT_EQ(entries(folder.path()), "out out.interrupted out.interrupted-2 ");
  // A part gives way to another part, and to the whole.
  InterruptAfter interrupt(40);
  run_slam(configuration, plan, {folder / "out.interrupted", true, false}, pool, interrupt);
  run_slam(configuration, plan, {folder / "out.interrupted-2", true, false}, pool, *silent);
  EXPECT_EQ(entries(folder.path()), "out out.interrupted out.interrupted-2 ");
  EXPECT_EQ(parsed(folder / "out.interrupted/manifest.json")["interrupted"], true);
  EXPECT_FALSE(parsed(folder / "out.interrupted-2/manifest.json").contains("interrupted"));
}

TEST_F(BatchTest, writes_nothing_when_interrupted_before_anything_is_finished) {
  InterruptAt interrupt("robot alpha");
  try {
    run("out", 1, false, &interrupt);
    FAIL() << "did not end";
  } catch (const Interrupted& interrupted) {
    EXPECT_THAT(interrupted.message(), HasSubstr("nothing was written"));
  }
  EXPECT_EQ(entries(folder.path()), "");
}

TEST_F(BatchTest, makes_a_helper_that_fails_the_trouble_of_its_robot) {
  configuration.laser.engine = laser::Engine::icp;
  configuration.laser.external.helper = "/bin/false";
  try {
    run("out");
    FAIL() << "did not end";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kHelperFailed);
    EXPECT_THAT(error.what(), HasSubstr("mrpt_mapper"));
  }
  EXPECT_EQ(entries(folder.path()), "");
}

TEST_F(BatchTest, leaves_old_results_alone_unless_forced) {
  fs::create_directories(folder / "out");
  write_file(folder / "out" / "precious.txt", "mine");
  EXPECT_THROW(run("out"), Error);
  EXPECT_EQ(entries(folder / "out"), "precious.txt ");
}

TEST_F(BatchTest, leaves_nothing_when_files_cannot_grow) {
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit old_limit{};
  getrlimit(RLIMIT_FSIZE, &old_limit);
  rlimit small = old_limit;
  small.rlim_cur = 2000;
  setrlimit(RLIMIT_FSIZE, &small);
  std::optional<Error> error;
  try {
    run("out");
  } catch (const Error& thrown) {
    error = thrown;
  }
  setrlimit(RLIMIT_FSIZE, &old_limit);
  std::signal(SIGXFSZ, old_handler);
  ASSERT_TRUE(error);
  EXPECT_EQ(error->code(), ErrorCode::kCannotWrite);
  EXPECT_EQ(entries(folder.path()), "");
}

TEST_F(BatchTest, slam_leaves_the_files_of_the_contract_in_one_folder) {
  WorkerPool pool(1);
  configuration.robots.resize(1);
  const Report report =
      run_slam(configuration, make_plan(configuration, {}), {folder / "out", false, false}, pool, *silent);
  EXPECT_EQ(report.exit_code(), ExitCode::done);
  EXPECT_EQ(entries(folder / "out"),
            "config.yaml manifest.json map.color.png map.mwdb map.pcd map.pgm map.png map.yaml report.html "
            "robot.sources.csv robot.tum summary.json trajectory.tum ");
}

}  // namespace
}  // namespace mapweave::runtime
