#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/scheduling/problem.h>

#include <string>

namespace mapweave::scheduling {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

const std::string kEdges = R"("edges": [{"id": "e0", "bandwidth_bytes_per_s": 2.5e6, "speed": 1.0, "capacity": null}])";

std::string with(const std::string& robots, const std::string& overlaps, const std::string& rest = kEdges) {
  return "{\"robots\": " + robots + ", \"overlaps\": " + overlaps + (rest.empty() ? "" : ", " + rest) + "}";
}

// The message with which a text is refused; its code is checked.
std::string refusal(const std::string& json, ErrorCode code = ErrorCode::kBadInput) {
  try {
    parse_problem(json, "p.json");
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), code) << error.what();
    EXPECT_THAT(error.what(), HasSubstr("p.json"));
    return error.what();
  }
  ADD_FAILURE() << "accepted: " << json.substr(0, 200);
  return {};
}

TEST(Problem, is_read_whole) {
  const Problem problem =
      parse_problem(R"({"robots": ["r0", "r1", "r2"], "overlaps": [["r0", "r1", 0.31], ["r2", "r0", 0]],
    "edges": [{"id": "e0", "bandwidth_bytes_per_s": 2.5e6},
              {"id": "e1", "bandwidth_bytes_per_s": 1e6, "speed": 0.5, "capacity": 2, "delay_s": 0.1}],
    "cloud": {"speed": 4, "edges_judge": false}, "robot_scans": {"r1": 1200}, "links": [["r2", "e1", 1e6, 0.02]]})",
                    "p.json");
  EXPECT_THAT(problem.robots, ElementsAre(RobotId("r0"), RobotId("r1"), RobotId("r2")));
  EXPECT_EQ(problem.overlaps.weight(0, 1), 0.31);
  EXPECT_EQ(problem.overlaps.links(), 1u);
  EXPECT_EQ(problem.edges[0].speed, 1.0);
  EXPECT_FALSE(problem.edges[0].delay_s);
  EXPECT_EQ(problem.edges[1].delay_s, 0.1);
  EXPECT_EQ(problem.cloud.speed, 4.0);
  EXPECT_FALSE(problem.cloud.edges_judge);
  EXPECT_FALSE(problem.edges[0].capacity);
  EXPECT_EQ(problem.edges[1].capacity, 2u);
  EXPECT_EQ(problem.scans[1], 1200.0);
  EXPECT_FALSE(problem.scans[0]);
  EXPECT_EQ(problem.links.at({2, 1}).bytes_per_s, 1e6);
  EXPECT_EQ(problem.links.size(), 1u);
}

TEST(Problem, names_robots_that_are_unknown_and_the_nearest_known) {
  EXPECT_THAT(refusal(with(R"(["alpha", "beta"])", R"([["alpha", "btea", 0.1]])")),
              AllOf(HasSubstr("overlaps[0]"), HasSubstr("no robot 'btea'"), HasSubstr("did you mean 'beta'?")));
  EXPECT_THAT(refusal(with(R"(["a"])", "[]", kEdges + R"(, "robot_scans": {"b": 3})")), HasSubstr("robot_scans"));
  EXPECT_THAT(refusal(with(R"(["a"])", "[]", kEdges + R"(, "links": [["a", "e9", 1, 0]])")), HasSubstr("no edge 'e9'"));
}

TEST(Problem, refuses_weights_that_are_no_overlap) {
  EXPECT_THAT(refusal(with(R"(["a", "b"])", R"([["a", "b", -0.1]])")),
              AllOf(HasSubstr("overlaps[0]"), HasSubstr("-0.1")));
  EXPECT_THAT(refusal(with(R"(["a", "b"])", R"([["a", "b", null]])")),
              HasSubstr("a number from 0 to 1e+12 was expected, not null"));
  EXPECT_THAT(refusal(with(R"(["a", "b"])", R"([["a", "b", "0.1"]])")), HasSubstr("not string"));
  EXPECT_THAT(refusal(with(R"(["a", "b"])", R"([["a", "b", NaN]])"), ErrorCode::kCorrupt), HasSubstr("line 1"));
  EXPECT_THAT(refusal(with(R"(["a", "b"])", R"([["a", "b", 1e999]])"), ErrorCode::kCorrupt), HasSubstr("1e999"));
  EXPECT_THAT(refusal(with(R"(["a", "b"])", R"([["a", "b", 1e300]])")), HasSubstr("overlaps[0]"));
}

TEST(Problem, refuses_what_stands_there_twice) {
  EXPECT_THAT(refusal(with(R"(["a", "b", "a"])", "[]")), AllOf(HasSubstr("robots[2]"), HasSubstr("twice")));
  EXPECT_THAT(refusal(with(R"(["a", "b"])", R"([["a", "b", 0.1], ["b", "a", 0.1]])")),
              AllOf(HasSubstr("overlaps[1]"), HasSubstr("twice")));
  EXPECT_THAT(refusal(with(R"(["a", "b"])", R"([["a", "a", 0.1]])")), HasSubstr("overlaps with itself"));
  EXPECT_THAT(
      refusal(with(R"(["a"])", "[]",
                   R"("edges": [{"id": "e", "bandwidth_bytes_per_s": 1}, {"id": "e", "bandwidth_bytes_per_s": 1}])")),
      AllOf(HasSubstr("edges[1]"), HasSubstr("twice")));
  EXPECT_THAT(refusal(with(R"(["a"])", "[]", kEdges + ", " + kEdges)), AllOf(HasSubstr("edges"), HasSubstr("twice")));
  EXPECT_THAT(refusal(with(R"(["a"])", "[]", kEdges + R"(, "links": [["a", "e0", 1, 0], ["a", "e0", 2, 0]])")),
              HasSubstr("links[1]"));
}

TEST(Problem, refuses_robots_and_edges_that_are_not_there) {
  EXPECT_THAT(refusal(with("[]", "[]")), HasSubstr("no robots"));
  EXPECT_THAT(refusal(with(R"(["a"])", "[]", R"("edges": [])")), HasSubstr("no edges"));
  EXPECT_THAT(refusal(with(R"(["a"])", "[]", "")), HasSubstr("the key 'edges' is missing"));
  EXPECT_THAT(refusal(R"({"robots": {"a": 1}, "overlaps": [], )" + kEdges + "}"),
              HasSubstr("a list was expected, not object"));
}

TEST(Problem, refuses_a_cloud_that_cannot_be) {
  const auto cloud = [](const std::string& fields) {
    return with(R"(["a"])", "[]", kEdges + R"(, "cloud": )" + fields);
  };
  EXPECT_THAT(refusal(cloud("3")), HasSubstr("an object was expected"));
  EXPECT_THAT(refusal(cloud(R"({"speed": 0})")), HasSubstr("cloud.speed"));
  EXPECT_THAT(refusal(cloud(R"({"edges_judge": 1})")), HasSubstr("cloud.edges_judge"));
  EXPECT_THAT(refusal(cloud(R"({"edge_judges": true})")), HasSubstr("did you mean 'edges_judge'?"));
}

TEST(Problem, refuses_edges_that_cannot_be) {
  const auto edge = [](const std::string& fields) {
    return with(R"(["a", "b"])", "[]", R"("edges": [{)" + fields + "}]");
  };
  EXPECT_THAT(refusal(edge(R"("bandwidth_bytes_per_s": 1)")), HasSubstr("'id' is missing"));
  EXPECT_THAT(refusal(edge(R"("id": "e")")), HasSubstr("'bandwidth_bytes_per_s' is missing"));
  EXPECT_THAT(refusal(edge(R"("id": "e", "bandwidth_bytes_per_s": 0)")), HasSubstr("edges[0].bandwidth_bytes_per_s"));
  EXPECT_THAT(refusal(edge(R"("id": "e", "bandwidth_bytes_per_s": 1, "speed": -1)")), HasSubstr("edges[0].speed"));
  EXPECT_THAT(refusal(edge(R"("id": "e", "bandwidth_bytes_per_s": 1, "delay_s": -1)")), HasSubstr("edges[0].delay_s"));
  EXPECT_THAT(refusal(edge(R"("id": "e", "bandwidth_bytes_per_s": 1, "capacity": 1.5)")), HasSubstr("no whole number"));
  EXPECT_THAT(refusal(edge(R"("id": "../e", "bandwidth_bytes_per_s": 1)")), HasSubstr("is not a name"));
  EXPECT_THAT(refusal(edge(R"("id": "e", "bandwidth_bytes_per_s": 1, "capacity": 1)")),
              HasSubstr("capacities hold 1 of 2 robots"));
}

TEST(Problem, names_the_nearest_key_for_an_unknown_one) {
  EXPECT_THAT(refusal(with(R"(["a"])", "[]", kEdges + R"(, "robot_scan": {})")),
              HasSubstr("did you mean 'robot_scans'?"));
  EXPECT_THAT(refusal(with(R"(["a"])", "[]", R"("edges": [{"id": "e", "bandwidth_bytes_per_s": 1, "sped": 1}])")),
              AllOf(HasSubstr("edges[0]"), HasSubstr("did you mean 'speed'?")));
}

TEST(Problem, survives_what_is_no_json_cut_short_or_nested) {
  const std::string whole = with(R"(["a", "b"])", R"([["a", "b", 0.25]])");
  for (std::size_t length = 0; length < whole.size(); ++length) refusal(whole.substr(0, length), ErrorCode::kCorrupt);
  refusal(std::string("\xff\xfe\0\x01", 4), ErrorCode::kCorrupt);
  refusal(std::string(200'000, '['));
  refusal("[]");
  refusal("3");
  std::string nested;
  for (int i = 0; i < 100'000; ++i) nested += "{\"robots\":";
  refusal(nested);
  EXPECT_THAT(refusal(with(R"(["a", "b"])", R"([["a", "b"]])")), HasSubstr("overlaps[0]"));
  EXPECT_THAT(refusal(with(R"(["a", "b"])", R"([3])")), HasSubstr("overlaps[0]"));
}

Problem sized(std::size_t robots, std::vector<std::optional<std::uint32_t>> capacities) {
  Problem problem;
  for (std::size_t i = 0; i < robots; ++i) problem.robots.emplace_back("r" + std::to_string(i));
  for (std::size_t i = 0; i < capacities.size(); ++i)
    problem.edges.push_back({TierId("e" + std::to_string(i)), 1.0, 1.0, capacities[i]});
  return problem;
}

TEST(GroupSizes, differ_by_one_at_most_unless_capacities_forbid) {
  const auto none = std::nullopt;
  EXPECT_THAT(group_sizes(sized(10, {none, none, none})), ElementsAre(4, 3, 3));
  EXPECT_THAT(group_sizes(sized(10, {none, 2u, none})), ElementsAre(4, 4, 2));
  EXPECT_THAT(group_sizes(sized(10, {3u, 4u, 3u})), ElementsAre(4, 3, 3));
  EXPECT_THAT(group_sizes(sized(10, {1u, 100u, 2u})), ElementsAre(7, 2, 1));
  EXPECT_THAT(group_sizes(sized(2, {none, none, none})), ElementsAre(1, 1));  // more edges than robots
  EXPECT_THAT(group_sizes(sized(3, {0u, none})), ElementsAre(3));
  EXPECT_THROW(group_sizes(sized(4, {1u, 2u})), Error);
}

}  // namespace
}  // namespace mapweave::scheduling
