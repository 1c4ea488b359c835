#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/scheduling/overlap_graph.h>

#include <limits>

namespace mapweave::scheduling {
namespace {

TEST(OverlapGraph, knows_each_link_from_both_sides) {
  const OverlapGraph graph(4, {{2, 0, 0.3}, {0, 1, 0.1}, {3, 1, 0.0}});
  EXPECT_EQ(graph.size(), 4u);
  EXPECT_EQ(graph.links(), 2u);
  EXPECT_DOUBLE_EQ(graph.total_weight(), 0.4);
  EXPECT_EQ(graph.weight(0, 2), 0.3);
  EXPECT_EQ(graph.weight(2, 0), 0.3);
  EXPECT_EQ(graph.weight(1, 2), 0.0);
  EXPECT_EQ(graph.neighbours(3).size(), 0u);  // a link of weight 0 is none
  std::vector<std::uint32_t> of_zero;
  for (const Neighbour& neighbour : graph.neighbours(0)) of_zero.push_back(neighbour.vertex);
  EXPECT_THAT(of_zero, testing::ElementsAre(1, 2));
}

TEST(OverlapGraph, refuses_links_that_cannot_be) {
  EXPECT_THROW(OverlapGraph(2, {{0, 2, 0.1}}), ContractViolation);
  EXPECT_THROW(OverlapGraph(2, {{1, 1, 0.1}}), ContractViolation);
  EXPECT_THROW(OverlapGraph(2, {{0, 1, 0.1}, {1, 0, 0.1}}), ContractViolation);
  EXPECT_THROW(OverlapGraph(2, {{0, 1, -0.1}}), ContractViolation);
  EXPECT_THROW(OverlapGraph(2, {{0, 1, std::numeric_limits<double>::quiet_NaN()}}), ContractViolation);
}

TEST(OverlapGraph, may_be_empty) {
  EXPECT_EQ(OverlapGraph().size(), 0u);
  EXPECT_EQ(OverlapGraph(3, {}).links(), 0u);
}

}  // namespace
}  // namespace mapweave::scheduling
