#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <support/random_map.h>

namespace mapweave {
namespace {

using test::RandomMaps;

// Everything a map holds, bit for bit.
std::string bytes_of(const Map& map) { return encode(difference({}, map)); }

void expect_misfit(const Map& map, const MapUpdate& update, const std::string& words) {
  try {
    updated(map, update);
    ADD_FAILURE() << "expected: " << words;
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), ::testing::HasSubstr(words));
    EXPECT_FALSE(error.remedy().empty());
  }
}

class MapUpdateTest : public ::testing::Test {
 protected:
  RandomMaps random_{7};
  Map map_ = random_.map("alpha", 40);
  MapUpdate nothing_ = difference(map_, map_);
};

TEST_F(MapUpdateTest, of_a_map_and_itself_is_empty) {
  EXPECT_TRUE(nothing_.nodes.empty() && nothing_.moved.empty() && nothing_.submaps.empty() &&
              nothing_.constraints.empty());
  EXPECT_TRUE(nothing_.removed_nodes.empty() && nothing_.removed_submaps.empty() &&
              nothing_.removed_constraints.empty());
  EXPECT_EQ(bytes_of(updated(map_, nothing_)), bytes_of(map_));
}

TEST_F(MapUpdateTest, leads_from_any_state_of_a_map_to_any_other) {
  Map newer = random_.map("alpha", 60);
  for (auto& [id, node] : map_.nodes) {  // of another session: all of it goes, all of the other comes
    (void)id;
    EXPECT_FALSE(newer.nodes.contains(node.id));
  }
  EXPECT_EQ(bytes_of(updated(map_, difference(map_, newer))), bytes_of(newer));
  EXPECT_EQ(bytes_of(updated(newer, difference(newer, map_))), bytes_of(map_));
}

TEST_F(MapUpdateTest, sends_moved_poses_and_no_content_after_the_first) {
  Map newer = map_;
  for (auto& [id, node] : newer.nodes)
    if (id.index >= 30) node.map_from_node = random_.pose(true);
  const MapUpdate light = difference(map_, newer);
  EXPECT_TRUE(light.nodes.empty());
  EXPECT_EQ(light.moved.size(), 10U);
  EXPECT_EQ(bytes_of(updated(map_, light)), bytes_of(newer));
}

TEST_F(MapUpdateTest, grows_and_freezes_a_submap) {
  Map older = map_;
  Submap& last = (older.submaps.end() - 1)->second;
  ASSERT_FALSE(last.frozen);
  last.submap_from_node.pop_back();
  Map newer = map_;
  Submap& grown = (newer.submaps.end() - 1)->second;
  grown.frozen = true;
  grown.content = content_hash(grown, newer.nodes);
  const MapUpdate update = difference(older, newer);
  EXPECT_EQ(update.submaps.size(), 1U);
  EXPECT_EQ(bytes_of(updated(older, update)), bytes_of(newer));
}

TEST_F(MapUpdateTest, takes_nodes_between_those_it_has) {
  Map both = random_.map("beta", 20);
  both.id = MapId("team");
  Map with_alpha = both;
  for (const auto& [id, node] : map_.nodes) with_alpha.nodes.set(id, node);
  for (const auto& [id, node] : random_.map("beta-before", 3).nodes) with_alpha.nodes.set(id, node);
  const Map result = updated(both, difference(both, with_alpha));
  EXPECT_EQ(bytes_of(result), bytes_of(with_alpha));
  EXPECT_TRUE(std::is_sorted(result.nodes.begin(), result.nodes.end(),
                             [](const auto& a, const auto& b) { return a.first < b.first; }));
}

TEST_F(MapUpdateTest, may_come_twice) {
  const MapUpdate whole = difference({}, map_);
  EXPECT_EQ(bytes_of(updated(updated({}, whole), whole)), bytes_of(map_));
}

TEST_F(MapUpdateTest, is_refused_by_another_map) {
  nothing_.origin.map = MapId("beta");
  expect_misfit(map_, nothing_, "applied to map 'alpha'");
}

TEST_F(MapUpdateTest, is_refused_when_it_changes_content) {
  Node node = map_.nodes.begin()->second;
  node.payload = random_.scan(random_.geometry(20));
  nothing_.nodes = {node};
  expect_misfit(map_, nothing_, "known with other content");
}

TEST_F(MapUpdateTest, is_refused_when_it_names_nodes_that_nobody_knows) {
  const NodeId stranger{map_.nodes.front().first.session, 999};
  MapUpdate update = nothing_;
  update.moved = {{stranger, {}}};
  expect_misfit(map_, update, "moves an unknown node");

  update = nothing_;
  update.removed_nodes = {stranger};
  expect_misfit(map_, update, "removes something that is not there");

  update = nothing_;
  update.constraints = {map_.constraints.begin()->second};
  update.constraints[0].id.to = stranger;
  expect_misfit(map_, update, "ends at an unknown node");

  update = nothing_;
  update.submaps = {(map_.submaps.end() - 1)->second};
  update.submaps[0].submap_from_node.emplace_back(stranger, Pose3{});
  expect_misfit(map_, update, "holds an unknown node");
}

TEST_F(MapUpdateTest, is_refused_when_it_leaves_something_hanging) {
  nothing_.removed_nodes = {map_.nodes.front().first};
  expect_misfit(map_, nothing_, "unknown node");
}

TEST_F(MapUpdateTest, is_refused_when_it_changes_a_frozen_submap) {
  nothing_.submaps = {map_.submaps.begin()->second};
  ASSERT_TRUE(nothing_.submaps[0].frozen);
  nothing_.submaps[0].submap_from_node.pop_back();
  expect_misfit(map_, nothing_, "is frozen and would change");
}

TEST_F(MapUpdateTest, is_refused_when_a_frozen_submap_is_not_what_its_hash_says) {
  MapUpdate whole = difference({}, map_);
  whole.submaps[0].content.bytes[0] ^= 1;
  expect_misfit({}, whole, "other content than its hash says");
}

TEST_F(MapUpdateTest, is_refused_when_a_submap_holds_a_bare_pose) {
  Node bare = map_.nodes.begin()->second;
  bare.id.index = 500;
  bare.payload = nullptr;
  nothing_.nodes = {bare};
  nothing_.submaps = {(map_.submaps.end() - 1)->second};
  nothing_.submaps[0].submap_from_node.emplace_back(bare.id, Pose3{});
  expect_misfit(map_, nothing_, "without content");
}

TEST_F(MapUpdateTest, of_two_maps_or_of_changed_content_breaks_the_contract) {
  EXPECT_THROW(difference(map_, random_.map("beta", 3)), ContractViolation);
  Map changed = map_;
  changed.nodes.find(map_.nodes.front().first)->payload = nullptr;
  EXPECT_THROW(difference(map_, changed), ContractViolation);
}

}  // namespace
}  // namespace mapweave
