#include <gtest/gtest.h>
#include <mapweave/core/nearest_name.h>

namespace mapweave {
namespace {

TEST(EditDistance, counts_letters_changed_and_neighbours_swapped) {
  EXPECT_EQ(edit_distance("", ""), 0u);
  EXPECT_EQ(edit_distance("", "abc"), 3u);
  EXPECT_EQ(edit_distance("kitten", "sitting"), 3u);
  EXPECT_EQ(edit_distance("sedd", "seed"), 1u);
  EXPECT_EQ(edit_distance("grpah", "graph"), 1u);
  EXPECT_EQ(edit_distance("graph", "grpah"), 1u);
}

TEST(NearestName, is_the_one_with_the_fewest_edits) {
  EXPECT_EQ(nearest_name("search_radius", {"search_yaw_rad", "search_radius_m", "min_score"}), "search_radius_m");
  EXPECT_EQ(nearest_name("grpah", {"graph", "rbpf", "icp"}), "graph");
  EXPECT_EQ(nearest_name("ab", {"aa", "bb"}), "aa");
}

TEST(NearestName, is_none_where_nothing_is_near) {
  EXPECT_EQ(nearest_name("telescope", {"graph", "rbpf", "icp"}), std::nullopt);
  EXPECT_EQ(nearest_name("", {"graph"}), std::nullopt);
  EXPECT_EQ(nearest_name("graph", {}), std::nullopt);
  EXPECT_EQ(nearest_name(std::string(1'000'000, 'x'), {"graph"}), std::nullopt);
}

}  // namespace
}  // namespace mapweave
