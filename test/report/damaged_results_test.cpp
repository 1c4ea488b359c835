#include "small_results.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <support/temporary_folder.h>

namespace mapweave::report {
namespace {

using mapweave::test::TemporaryFolder;
using test::data_of;
using test::Json;
using test::write_results;
using test::write_text;
using ::testing::Contains;
using ::testing::HasSubstr;

TEST(ReportPage, refuses_what_is_no_folder_of_results) {
  const TemporaryFolder folder;
  EXPECT_THROW(report_page(folder.path(), {}), Error);
  EXPECT_THROW(report_page(folder / "nowhere", {}), Error);
}

TEST(ReportPage, names_each_file_that_is_missing_and_shows_the_others) {
  for (const char* file : {"summary.json", "merges.json", "manifest.json", "config.yaml"}) {
    const TemporaryFolder folder;
    write_results(folder.path(), {"alpha", "beta"});
    std::filesystem::remove(folder / file);
    const Json data = data_of(report_page(folder.path(), {}));
    EXPECT_THAT(data["missing"].get<std::vector<std::string>>(), Contains(file));
    EXPECT_EQ(data["maps"].size(), 3u) << file;
    EXPECT_EQ(data["robots"].size(), 2u) << file;
  }
}

TEST(ReportPage, shows_maps_without_papers) {
  const TemporaryFolder folder;
  write_results(folder.path(), {"alpha", "beta"});
  for (const char* file : {"summary.json", "merges.json", "manifest.json", "config.yaml"})
    std::filesystem::remove(folder / file);
  EXPECT_EQ(data_of(report_page(folder.path(), {}))["maps"][0]["trajectories"].size(), 2u);
}

TEST(ReportPage, shows_one_robot_s_map_without_papers) {
  const TemporaryFolder folder;
  write_results(folder.path(), {"alpha"});
  const Json data = data_of(report_page(folder / "robots/alpha", {}));
  ASSERT_EQ(data["maps"].size(), 1u);
  EXPECT_EQ(data["maps"][0]["trajectories"].size(), 1u);
}

TEST(ReportPage, names_each_file_that_is_damaged_and_shows_the_others) {
  const std::vector<std::string> files = {"summary.json",  "merges.json",   "manifest.json",
                                          "config.yaml",   "team/map.yaml", "team/map.pgm",
                                          "team/map.mwdb", "team/map.pcd",  "team/trajectories/beta.tum"};
  const std::vector<std::string> damages = {"", "{", "[1, 2", "\xff\xfe", "a: [", "1 2 3 x"};
  for (const std::string& file : files)
    for (const std::string& damage : damages) {
      const TemporaryFolder folder;
      write_results(folder.path(), {"alpha", "beta"});
      write_text(folder / file, damage);
      const Json data = data_of(report_page(folder.path(), {}));
      EXPECT_GE(data["maps"].size(), 2u) << file << ": " << damage;
    }
}

// Valid JSON of the wrong shape is as hostile as bytes that are none.
TEST(ReportPage, takes_papers_whose_values_are_of_other_kinds) {
  const std::vector<std::string> shapes = {
      "7",
      "[]",
      "{}",
      "null",
      "\"text\"",
      "[7]",
      "[[]]",
      "[null]",
      R"({"robots": 7, "team": 7, "verb": 7, "inputs": 7})",
      R"({"robots": [7, {"id": 7}], "team": {"members": 7}})",
      R"({"robots": [{"id": "alpha", "cameras": 7}], "team": {"members": [7]}})",
      R"([{"a": 7, "b": [], "tier": "cloud", "audit": {"conflicts": 7}}])",
      R"([{"a": "alpha", "hypotheses": {"x": 7}, "prior": {"because": 7}}])",
      R"({"verb": "merge", "inputs": [7, {"path": 7}], "coordinator": {"decisions": 7}})"};
  for (const char* file : {"summary.json", "merges.json", "manifest.json"})
    for (const std::string& shape : shapes) {
      const TemporaryFolder folder;
      write_results(folder.path(), {"alpha", "beta"});
      write_text(folder / file, shape);
      EXPECT_NO_THROW(data_of(report_page(folder.path(), {}))) << file << ": " << shape;
    }
}

TEST(ReportPage, says_of_a_robot_without_scans_that_it_has_no_map) {
  const TemporaryFolder folder;
  write_results(folder.path(), {"alpha", "beta"});
  Json summary = Json::parse(read_file(folder / "summary.json"));
  summary["robots"].push_back({{"id", "gamma"}, {"scans", 0}, {"mapped", false}});
  write_text(folder / "summary.json", summary.dump());
  const Json data = data_of(report_page(folder.path(), {}));
  ASSERT_EQ(data["robots"].size(), 3u);
  EXPECT_EQ(data["robots"][2]["mapped"], false);
  EXPECT_EQ(data["maps"].size(), 3u);
}

TEST(ReportPage, quotes_what_a_shell_would_take_apart) {
  const TemporaryFolder folder;
  write_results(folder.path(), {"alpha"});
  const Json inputs = {{{"path", "it's $(here).rawlog"}, {"sha256", ""}}};
  write_text(folder / "manifest.json", Json({{"verb", "slam"}, {"inputs", inputs}}).dump());
  EXPECT_EQ(data_of(report_page(folder.path(), {"seed: 7\n", {}}))["commands"][0],
            "mapweave slam 'it'\\''s $(here).rawlog' --out again");
}

}  // namespace
}  // namespace mapweave::report
