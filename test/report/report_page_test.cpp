#include "small_results.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/hash.h>
#include <support/temporary_folder.h>

namespace mapweave::report {
namespace {

using mapweave::test::TemporaryFolder;
using test::between;
using test::data_of;
using test::Json;
using test::write_results;
using test::write_text;

TEST(ReportPage, holds_maps_trajectories_and_pairs) {
  const TemporaryFolder folder;
  write_results(folder.path(), {"alpha", "beta"});
  const Json data = data_of(report_page(folder.path(), {"seed: 1\n", {}}));
  ASSERT_EQ(data["maps"].size(), 3u);
  EXPECT_EQ(data["maps"][0]["title"], "team map");
  ASSERT_EQ(data["maps"][0]["trajectories"].size(), 2u);
  EXPECT_EQ(data["maps"][0]["trajectories"][1]["robot"], 1);
  EXPECT_EQ(data["maps"][0]["trajectories"][1]["t_ms"].size(), 50u);
  EXPECT_EQ(data["maps"][0]["trajectories"][1]["x_mm"][1], 100);
  EXPECT_EQ(data["maps"][0]["grid"]["levels"][0]["columns"], 60);
  ASSERT_EQ(data["pairs"].size(), 1u);
  EXPECT_EQ(data["pairs"][0]["words"], "alpha + beta: merged");
  EXPECT_EQ(data["options"], Json::parse(R"([{"name": "seed", "value": "7", "default": "1"}])"));
  EXPECT_THAT(data["problems"], ::testing::IsEmpty());
}

TEST(ReportPage, is_the_same_for_the_same_folder_under_another_name) {
  const TemporaryFolder one, other;
  write_results(one.path(), {"alpha", "beta"});
  write_results(other.path(), {"alpha", "beta"});
  EXPECT_EQ(report_page(one.path(), {}), report_page(other.path(), {}));
}

TEST(ReportPage, allows_its_own_script_and_style_alone) {
  const TemporaryFolder folder;
  write_results(folder.path(), {"alpha"});
  const std::string page = report_page(folder.path(), {});
  EXPECT_THAT(page, ::testing::HasSubstr("default-src 'none'; img-src data:;"));
  EXPECT_EQ(test::count(page, "<script"), 2u);
  EXPECT_EQ(test::count(page, "http://") + test::count(page, "https://"), 1u) << "the name space of SVG";
  EXPECT_EQ(test::count(page, "innerHTML"), 0u);
}

TEST(ReportPage, never_lets_a_name_out_of_its_text) {
  const std::string hostile = "</script><script>alert(1)</script><!-- \"'& \xd8\xa7\xd9\x84 \xe2\x80\xa8";
  const TemporaryFolder folder;
  write_results(folder.path(), {"alpha", "beta"});
  Json summary = Json::parse(read_file(folder / "summary.json"));
  summary["robots"][0]["id"] = hostile;
  summary["notes"] = {hostile};
  write_text(folder / "summary.json", summary.dump());
  write_text(folder / "merges.json", Json::array({test::verdict(hostile, "beta")}).dump());
  const std::string page = report_page(folder.path(), {});
  EXPECT_EQ(test::count(page, "<script"), 2u);
  EXPECT_EQ(test::count(page, "<!--"), 0u);
  const Json data = data_of(page);
  EXPECT_EQ(data["summary"]["notes"][0], hostile);
  EXPECT_EQ(data["pairs"][0]["a"], hostile);
  EXPECT_THAT(between(page, "<title>", "</title>"), ::testing::HasSubstr("&lt;/script&gt;&lt;script&gt;alert(1)"));
}

TEST(ReportPage, thins_a_large_grid_without_opening_a_wall) {
  const TemporaryFolder folder;
  write_results(folder.path(), {"alpha"});
  test::write_map(folder / "team", 4100, 50);
  const Json levels = data_of(report_page(folder.path(), {}))["maps"][0]["grid"]["levels"];
  ASSERT_EQ(levels.size(), 2u);
  EXPECT_EQ(levels[0]["columns"], 820);
  EXPECT_EQ(levels[1]["columns"], 2050);
  EXPECT_DOUBLE_EQ(levels[1]["metres_per_pixel"].get<double>(), 0.1);
}

TEST(ReportPage, stays_below_two_megabytes_however_large_the_run_is) {
  const TemporaryFolder folder;
  std::vector<std::string> robots;
  for (int i = 0; i < 60; ++i) robots.push_back("robot" + std::to_string(i));
  write_results(folder.path(), robots, 2000);
  std::string points;
  for (int i = 0; i < 300'000; ++i) {
    const float place[4] = {0.01f * static_cast<float>(i % 500), 0.02f * static_cast<float>(i / 500), 1.0f, 0.0f};
    points.append(reinterpret_cast<const char*>(place), sizeof place);
  }
  write_text(folder / "team/map.pcd", "# .PCD\nFIELDS x y z rgb\nSIZE 4 4 4 4\nPOINTS 300000\nDATA binary\n" + points);
  const std::string page = report_page(folder.path(), {});
  const Json data = data_of(page);
  std::size_t pictures = 0;
  for (const Json& map : data["maps"])
    for (const Json& level : map["grid"]["levels"]) pictures += level["png"].get<std::string>().size();
  EXPECT_LE(page.size() - pictures, kMostPageBytes);
  EXPECT_EQ(data["pairs"].size(), 1770u);
  EXPECT_GT(data["maps"][0]["trajectories"][59]["t_ms"].size(), 100u);
  EXPECT_GT(data["maps"][0]["points"]["count"], 1000);
}

TEST(ReportPage, compares_with_a_reference_that_covers_a_tenth_of_the_run) {
  const TemporaryFolder folder, truth;
  write_results(folder.path(), {"alpha", "beta"}, 200);
  write_text(truth / "alpha.truth.tum", test::straight_tum(20, 0.5, 100));
  const Json data = data_of(report_page(folder.path(), {{}, truth.path()}));
  ASSERT_EQ(data["errors"].size(), 2u);
  EXPECT_EQ(data["errors"][0]["problem"], "no reference");
  EXPECT_EQ(data["errors"][1]["pairs"], 20);
  EXPECT_EQ(data["errors"][1]["poses"], 200);
  EXPECT_LT(data["errors"][1]["ate_rmse_m"], 0.01);
  EXPECT_EQ(data["maps"][0]["references"].size(), 1u);
}

TEST(ReportPage, refuses_one_reference_of_several_robots) {
  const TemporaryFolder folder;
  write_results(folder.path(), {"alpha", "beta"});
  write_text(folder / "truth.tum", test::straight_tum(20));
  EXPECT_THROW(report_page(folder.path(), {{}, folder / "truth.tum"}), Error);
  EXPECT_THROW(report_page(folder.path(), {{}, folder / "nowhere"}), Error);
}

}  // namespace
}  // namespace mapweave::report
