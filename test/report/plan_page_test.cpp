#include "small_results.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/report/plan_page.h>
#include <support/temporary_folder.h>

namespace mapweave::report {
namespace {

using mapweave::test::TemporaryFolder;
using test::data_of;
using test::Json;

const std::string kProblem = R"({"robots": ["r0", "r1", "r2", "r3"],
  "overlaps": [["r0", "r1", 0.4], ["r2", "r3", 0.3], ["r1", "r2", 0.05]],
  "edges": [{"id": "north", "bandwidth_bytes_per_s": 2.5e6},
            {"id": "south", "bandwidth_bytes_per_s": 1e6, "capacity": 2}],
  "robot_scans": {"r0": 2000}, "links": [["r0", "north", 1e6, 0.25], ["r0", "south", 1e6, 0.25]]})";

std::string page_of(const std::string& problem_text, scheduling::PlanOptions options = {},
                    const std::string& file = "problem.json") {
  const TemporaryFolder folder;
  test::write_text(folder / file, problem_text);
  const scheduling::Problem problem = scheduling::read_problem(folder / file);
  return plan_page(problem, options, scheduling::make_plan(problem, options), {folder / file, {}, "0.1.0"});
}

TEST(PlanPage, holds_groups_overlaps_times_and_links) {
  const Json data = data_of(page_of(kProblem));
  ASSERT_EQ(data["robots"].size(), 4u);
  EXPECT_EQ(data["robots"][0]["edge"], data["robots"][1]["edge"]);
  EXPECT_EQ(data["robots"][2]["edge"], data["robots"][3]["edge"]);
  EXPECT_EQ(data["overlaps"], Json::parse("[[0, 1, 0.4], [2, 3, 0.3], [1, 2, 0.05]]"));
  EXPECT_EQ(data["edges"][1]["name"], "south");
  EXPECT_EQ(data["edges"][1]["capacity"], 2);
  EXPECT_EQ(data["edges"][0]["capacity"], nullptr);
  EXPECT_NEAR(data["cut_weight"].get<double>(), 0.05, 1e-9);
  EXPECT_GE(data["predicted_seconds"], data["lower_bound_seconds"]);
  EXPECT_EQ(data["method"], "default");
  EXPECT_EQ(data["inputs"][0]["sha256"].get<std::string>().size(), 64u);
}

// The parts that are drawn as bars end when the plan says that all is done.
TEST(PlanPage, draws_times_that_end_as_predicted) {
  const Json data = data_of(page_of(kProblem)), timeline = data["timeline"];
  double edges_done = 0.0;
  for (const Json& edge : timeline["edges"]) {
    double ready = 0.0;
    for (const Json& robot : timeline["robots"])
      if (robot["edge"] == edge["id"]) ready = std::max(ready, robot["mapped_seconds"].get<double>());
    EXPECT_NEAR(edge["ready_seconds"].get<double>(), ready, 1e-5);
    edges_done = std::max(edges_done, edge["arrived_seconds"].get<double>());
  }
  EXPECT_NEAR(edges_done + timeline["cloud"]["fusing_cpu_seconds"].get<double>(),
              data["predicted_seconds"].get<double>(), 1e-5);
  const Json& robot = timeline["robots"][data["robots"][0]["edge"] == 0 ? 0 : 2];
  EXPECT_EQ(robot["id"], "r0");
  EXPECT_EQ(robot["sensed_bytes"], 1'200'000);
  EXPECT_EQ(robot["bytes_per_s"], 1e6);
  EXPECT_NEAR(robot["arrived_seconds"].get<double>() - robot["packed_seconds"].get<double>(), 1.2 + 0.25, 1e-5);
}

TEST(PlanPage, shows_each_edge_that_a_robot_sends_its_data_to) {
  scheduling::PlanOptions options;
  options.edges_per_robot = 2;
  std::string problem = kProblem;
  problem.replace(problem.find(R"(, "capacity": 2)"), 15, "");
  const Json data = data_of(page_of(problem, options));
  EXPECT_EQ(data["timeline"]["robots"].size(), 8u);
  EXPECT_EQ(data["robots"][0]["further"].size(), 1u);
  EXPECT_THAT(data["commands"][0].get<std::string>(), ::testing::HasSubstr("--edges-per-robot 2"));
}

// Robots and edges have plain names; files have any.
TEST(PlanPage, never_lets_a_file_s_name_out_of_its_text) {
  const std::string hostile = "<script>alert(1)<!-- \"'& \xd8\xa7\xd9\x84";
  const std::string page = page_of(kProblem, {}, hostile);
  EXPECT_EQ(test::count(page, "<script"), 2u);
  EXPECT_EQ(test::count(page, "<!--"), 0u);
  EXPECT_EQ(test::count(page, "innerHTML"), 0u);
  EXPECT_THAT(data_of(page)["inputs"][0]["path"].get<std::string>(), ::testing::EndsWith(hostile));
  EXPECT_THAT(data_of(page)["commands"][0].get<std::string>(), ::testing::HasSubstr("\"'\\''& "));
}

TEST(PlanPage, stays_below_two_megabytes_for_thousands_of_robots) {
  Json problem = {{"robots", Json::array()}, {"overlaps", Json::array()}, {"edges", Json::array()}};
  for (int i = 0; i < 4000; ++i) problem["robots"].push_back("robot" + std::to_string(i));
  for (int i = 0; i < 4000; ++i)
    for (int j = 1; j <= 3; ++j)
      if (i + j < 4000)
        problem["overlaps"].push_back({problem["robots"][i], problem["robots"][i + j], 0.001 * (1 + i % 400)});
  for (int i = 0; i < 20; ++i)
    problem["edges"].push_back({{"id", "edge" + std::to_string(i)}, {"bandwidth_bytes_per_s", 1e6}});
  scheduling::PlanOptions options;
  options.method = scheduling::PlanMethod::random;
  const std::string page = page_of(problem.dump(), options);
  EXPECT_LE(page.size(), kMostPageBytes);
  EXPECT_EQ(data_of(page)["overlaps"].size(), 4000u);
  EXPECT_EQ(data_of(page)["overlap_count"], 11994);
}

}  // namespace
}  // namespace mapweave::report
