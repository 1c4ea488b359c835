// The page of a program that runs.
#include "small_results.h"

#include <mapweave/report/live_page.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace mapweave::report {
namespace {

using test::Json;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;

NodeId node_of(const char* robot, std::uint32_t index) { return {{{RobotId(robot), SensorId("laser")}, 7}, index}; }

// Two robots that drive beside each other and know one place in common; and one whom the page does not know.
Map small_map() {
  Map map;
  for (const auto& [robot, y] : {std::pair("alpha", 0.0), std::pair("beta", 1.0), std::pair("ghost", 50.0)})
    for (std::uint32_t i = 0; i < 3; ++i) {
      Node node;
      node.id = node_of(robot, i);
      node.stamp = Stamp{1'000'000'000LL * i};
      node.map_from_node = spatial(Pose2{double(i), y, 0.0});
      map.nodes.set(node.id, node);
    }
  const Constraint join = planar_constraint({ConstraintKind::between_maps, node_of("alpha", 0), node_of("beta", 2), 0},
                                            Pose2(), Eigen::Matrix3d::Identity());
  map.constraints.set(join.id, join);
  return map;
}

OccupancyGrid small_grid() {
  OccupancyGrid grid;
  grid.resolution_m = 0.5;
  grid.columns = grid.rows = 4;
  grid.log_odds.assign(16, -100);
  return grid;
}

TEST(LivePage, draws_a_map_so_far_as_the_report_draws_maps) {
  const Json map = live_map("alpha + beta", small_map(), small_grid(), {"alpha", "beta"});
  EXPECT_EQ(map["title"], "alpha + beta");
  ASSERT_EQ(map["trajectories"].size(), 2u) << "a robot that is not known is left out";
  EXPECT_EQ(map["trajectories"][1]["robot"], 1);
  EXPECT_THAT(map["trajectories"][1]["x_mm"], ElementsAre(0, 1000, 1000));
  EXPECT_THAT(map["joins"], ElementsAre(Json::array({0, 0, 200, 100})));
  EXPECT_EQ(map["grid"]["levels"].size(), 1u);
  EXPECT_THAT(map["grid"]["levels"][0]["png"].get<std::string>(), HasSubstr("data:image/png;base64,"));
  EXPECT_THAT(map["view"], ElementsAre(0, 0, 2, 2));
}

TEST(LivePage, draws_trajectories_where_there_is_no_grid_and_nothing_where_there_is_no_map) {
  EXPECT_FALSE(live_map("alpha", small_map(), {}, {"alpha"}).contains("grid"));
  EXPECT_THAT(live_map("", {}, {}, {})["view"], ElementsAre(-1, -1, 1, 1));
}

TEST(LivePage, asks_its_own_server_alone_and_runs_no_text) {
  const std::string hostile = "</script><script>alert(1)</script>";
  const std::string page = live_page("mapweave <b>", {hostile}, {{"tiers", Json::array()}, {"name", hostile}});
  EXPECT_THAT(page, HasSubstr("default-src 'none'; img-src data:;"));
  EXPECT_THAT(page, HasSubstr("; connect-src 'self'\">"));
  EXPECT_THAT(page, HasSubstr("<title>mapweave &lt;b&gt;</title>"));
  EXPECT_THAT(page, HasSubstr("EventSource('events')"));
  EXPECT_THAT(page, Not(HasSubstr("alert(1)</script>")));
  EXPECT_EQ(test::count(page, "<script"), 2u);
  EXPECT_EQ(test::count(page, "http://") + test::count(page, "https://"), 1u) << "the name space of SVG";
  EXPECT_EQ(test::count(page, "innerHTML"), 0u);
  EXPECT_EQ(test::data_of(page)["status"]["name"], hostile);
}

}  // namespace
}  // namespace mapweave::report
