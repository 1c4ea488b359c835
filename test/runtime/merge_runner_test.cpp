#include "simulated_team.h"

#include <support/carried_away.h>

#include <mapweave/runtime/merge_runner.h>

#include <gmock/gmock.h>
#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/mapdb/map_store.h>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

using test_support::simulated_team;
using testing::HasSubstr;
namespace fs = std::filesystem;

// A folder with a run's results, made once.
const fs::path& results() {
  static const test::TemporaryFolder folder;
  static const fs::path out = [] {
    WorkerPool pool(1);
    RunConfiguration configuration = simulated_team().configuration();
    configuration.cloud.maps.thin = false;
    run_batch(configuration, make_plan(configuration, {}), {folder / "run", false, false}, pool,
              *make_silent_progress());
    return folder / "run";
  }();
  return out;
}

struct MergeTest : testing::Test {
  Report merge(const std::vector<fs::path>& maps, const std::string& out = "out", const MergeRequests& requests = {}) {
    return run_merge(configuration, maps, {folder / out, false, requests}, pool, *progress);
  }
  test::TemporaryFolder folder;
  RunConfiguration configuration;
  WorkerPool pool{1};
  std::unique_ptr<Progress> progress = make_silent_progress();
};

TEST_F(MergeTest, joins_robots_maps_as_the_run_did_whatever_their_order) {
  configuration.team.frame = "alpha";  // the first one of the run
  merge({results() / "robots/beta/map.mwdb", results() / "robots/alpha/map.mwdb"});
  for (const char* file :
       {"team/map.png", "team/map.pcd", "team/trajectories/beta.tum", "robots/alpha/map.png", "robots/beta/map.png"})
    EXPECT_EQ(read_file(folder / "out" / file), read_file(results() / file)) << file;
  for (const char* file : {"config.yaml", "manifest.json", "summary.json", "merges.json", "team/map.mwdb"})
    EXPECT_TRUE(fs::exists(folder / "out" / file)) << file;
}

TEST_F(MergeTest, that_would_show_walls_twice_is_taken_apart_with_places_a_picture_and_exit_code_4) {
  const test::CarriedAway team;
  std::vector<fs::path> paths;
  for (const Map& map : team.maps) {
    mapdb::StoredMaps stored;
    stored.maps = {map};
    paths.push_back(folder / (map.id.str() + ".mwdb"));
    mapdb::write_store(paths.back(), stored);
  }
  MergeRequests requests;  // a prior that is right, and lifts the doubt that rooms of the flat look alike
  requests.anchors = {{"robot0", "robot1", team.first_from_second}};
  const Report report = merge({paths[0], paths[1]}, "out", requests);
  EXPECT_EQ(report.exit_code(), ExitCode::stayed_apart);
  EXPECT_TRUE(fs::exists(folder / "out/team-1/conflicts.png"));
  const auto merges = nlohmann::json::parse(read_file(folder / "out/merges.json"));
  ASSERT_EQ(merges.size(), 1U);
  EXPECT_EQ(merges[0]["reason"], "contradiction");
  EXPECT_TRUE(merges[0]["audit"]["taken_apart"]);
  EXPECT_GT(merges[0]["audit"]["contradicted_m"], 10.0);
  EXPECT_FALSE(merges[0]["audit"]["conflicts"].empty());
  const std::string text = in_words(report, "out");
  EXPECT_THAT(text, HasSubstr("robot0 + robot1: kept apart: one saw through walls of the other"));
  EXPECT_THAT(text, HasSubstr("merged, they would show walls twice"));
  EXPECT_THAT(text, HasSubstr("in the map of robot0 (conflicts.png)"));
  // Nothing is in doubt without it.
  EXPECT_EQ(merge({paths[0], paths[2]}, "two").exit_code(), ExitCode::done);
  EXPECT_FALSE(fs::exists(folder / "two/team-1/conflicts.png"));
}

TEST_F(MergeTest, takes_a_grid_among_the_maps) {
  fs::copy(results() / "robots/beta/map.yaml", folder / "map.yaml");
  fs::copy(results() / "robots/beta/map.pgm", folder / "map.pgm");
  fs::rename(folder / "map.yaml", folder / "hall.yaml");
  const Report report = merge({results() / "robots/alpha/map.mwdb", folder / "hall.yaml"});
  ASSERT_EQ(report.team.verdicts.size(), 1u);
  const auto merges = merges_json(report);
  EXPECT_EQ(merges[0]["kind"], "grid");
  EXPECT_EQ(merges[0]["b"], "map");
  EXPECT_EQ(merges[0]["a"], "hall");
}

TEST_F(MergeTest, calls_maps_by_their_folders_and_says_so) {
  const Report report = merge({results() / "robots/alpha/map.mwdb", results() / "robots/beta/map.mwdb"});
  ASSERT_EQ(report.notes.size(), 2u);
  EXPECT_THAT(report.notes[0], testing::AllOf(HasSubstr("alpha/map.mwdb"), HasSubstr("'alpha'")));
}

TEST_F(MergeTest, takes_a_team_map_among_the_maps) {
  const Report report = merge({results() / "team/map.mwdb"});
  EXPECT_EQ(report.team.components.size(), 1u);
  EXPECT_TRUE(fs::exists(folder / "out/team/map.png"));
}

TEST_F(MergeTest, that_is_interrupted_says_that_nothing_was_written_and_all_is_as_it_was) {
  const fs::path made = results();
  request_interrupt();
  try {
    merge({made / "robots/alpha/map.mwdb", made / "robots/beta/map.mwdb"});
    FAIL() << "did not end";
  } catch (const Interrupted& interrupted) {
    EXPECT_THAT(interrupted.message(), testing::AllOf(HasSubstr("while 2 maps were compared: nothing was written"),
                                                      HasSubstr("as they were")));
  }
  clear_interrupt();
  EXPECT_FALSE(fs::exists(folder / "out"));
}

TEST_F(MergeTest, that_is_interrupted_late_saves_what_was_found_until_then) {
  class InterruptAtDeciding : public Progress {
   public:
    int begin(std::string_view task, std::uint64_t, std::string_view) override {
      if (task == "deciding") request_interrupt();
      return 0;
    }
    void advance(int, std::uint64_t) override {}
    void end(int) override {}
    void say(std::string_view) override {}
  };
  const fs::path made = results();
  InterruptAtDeciding interrupting;
  const Report report = run_merge(configuration, {made / "robots/alpha/map.mwdb", made / "robots/beta/map.mwdb"},
                                  {folder / "out", false}, pool, interrupting);
  EXPECT_FALSE(interrupted()) << "the interruption was taken";
  EXPECT_EQ(report.exit_code(), ExitCode::interrupted);
  EXPECT_THAT(report.notes, testing::Contains(HasSubstr("merge again to compare the rest")));
  EXPECT_TRUE(fs::exists(folder / "out/team/map.png"));
}

TEST_F(MergeTest, refuses_what_is_no_map) {
  write_file(folder / "notes.txt", "nothing");
  EXPECT_THROW(merge({folder / "notes.txt"}), Error);
  write_file(folder / "broken.mwdb", "nothing");
  EXPECT_THROW(merge({folder / "broken.mwdb"}), Error);
  EXPECT_THROW(merge({folder / "absent.mwdb"}), Error);
  EXPECT_FALSE(fs::exists(folder / "out"));
}

}  // namespace
}  // namespace mapweave::runtime
