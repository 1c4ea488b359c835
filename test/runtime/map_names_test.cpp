#include <mapweave/runtime/map_names.h>

#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/maps/map_update.h>
#include <support/fake_mapper.h>
#include <support/random_map.h>

namespace mapweave::runtime {
namespace {

using testing::ElementsAre;

std::vector<std::string> texts(const std::vector<MapId>& names) {
  std::vector<std::string> result;
  for (const MapId name : names) result.push_back(name.str());
  return result;
}

TEST(MapNames, are_the_files_stems) {
  EXPECT_THAT(texts(names_of({"x/alpha.mwdb", "y/hall.yaml"})), ElementsAre("alpha", "hall"));
}

TEST(MapNames, are_the_folders_names_where_stems_are_alike) {
  EXPECT_THAT(texts(names_of({"robots/beta/map.mwdb", "robots/alpha/map.mwdb", "hall.yaml"})),
              ElementsAre("beta", "alpha", "hall"));
}

TEST(MapNames, are_the_stem_with_a_number_where_one_folder_holds_both) {
  EXPECT_THAT(texts(names_of({"gg/r0.mwdb", "gg/r0.yaml"})), ElementsAre("r0", "r0-2"));
}

TEST(MapNames, are_numbered_where_folders_are_alike_too_whatever_the_order) {
  EXPECT_THAT(texts(names_of({"b/alpha/map.mwdb", "a/alpha/map.mwdb"})), ElementsAre("alpha-2", "alpha"));
  EXPECT_THAT(texts(names_of({"a/alpha/map.mwdb", "b/alpha/map.mwdb"})), ElementsAre("alpha", "alpha-2"));
}

TEST(MapNames, are_cut_where_a_number_would_make_them_too_long) {
  const std::string longest(64, 'x');
  EXPECT_THAT(texts(names_of({"a/" + longest + "/map.mwdb", "b/" + longest + "/map.mwdb"})),
              ElementsAre(longest, std::string(62, 'x') + "-2"));
}

TEST(MapNames, refuse_a_file_given_twice) { EXPECT_THROW(names_of({"a/map.mwdb", "a/../a/map.mwdb"}), Error); }

TEST(Rekeyed, keeps_content_and_belief) {
  const Map map = test::make_map("alpha", 5);
  const Map other = rekeyed(map, MapId("hall"), [](RobotId) { return RobotId("gamma"); });
  EXPECT_THAT(other.robots(), ElementsAre(RobotId("gamma")));
  EXPECT_EQ(other.id, MapId("hall"));
  ASSERT_EQ(other.nodes.size(), map.nodes.size());
  for (auto a = map.nodes.begin(), b = other.nodes.begin(); a != map.nodes.end(); ++a, ++b) {
    EXPECT_EQ(a->second.payload, b->second.payload);
    EXPECT_EQ(a->second.map_from_node.t, b->second.map_from_node.t);
  }
  const Map back = rekeyed(other, map.id, [](RobotId) { return RobotId("alpha"); });
  EXPECT_EQ(encode(difference(Map{}, back)), encode(difference(Map{}, map)));
}

TEST(Rekeyed, renames_landmarks_and_who_saw_them) {
  const Map map = test::RandomMaps(1).keyframe_map("alpha", 10);
  const Map other = rekeyed(map, MapId("hall"), [](RobotId) { return RobotId("gamma"); });
  ASSERT_EQ(other.landmarks.size(), map.landmarks.size());
  EXPECT_EQ(other.landmarks.front().second.seen.front().node.session.client.robot, RobotId("gamma"));
  const Map back = rekeyed(other, map.id, [](RobotId) { return RobotId("alpha"); });
  EXPECT_EQ(encode(difference(Map{}, back)), encode(difference(Map{}, map)));
}

TEST(RobotsApart, renames_robots_that_two_maps_share_and_says_so) {
  Map monday = test::make_map("alpha", 3), tuesday = test::make_map("alpha", 4, 900.0),
      other = test::make_map("beta", 2);
  monday.id = MapId("monday");
  tuesday.id = MapId("tuesday");
  std::vector<std::string> notes;
  const auto maps = with_robots_apart({tuesday, other, monday}, notes);
  ASSERT_EQ(maps.size(), 3u);
  EXPECT_THAT(maps[0].robots(), ElementsAre(RobotId("beta")));
  EXPECT_THAT(maps[1].robots(), ElementsAre(RobotId("monday")));
  EXPECT_THAT(maps[2].robots(), ElementsAre(RobotId("tuesday")));
  EXPECT_EQ(notes.size(), 2u);
}

TEST(RobotsApart, cuts_names_that_would_be_too_long) {
  Map first = test::make_map("alpha", 3), second = test::make_map("alpha", 4, 900.0);
  first.id = MapId(std::string(64, 'x'));
  second.id = MapId(std::string(63, 'x') + "y");
  const Map beta = rekeyed(test::make_map("alpha", 2), first.id, [](RobotId) { return RobotId("beta"); });
  for (Map* map : {&first, &second})  // two robots each
    for (const auto& [id, node] : beta.nodes) map->nodes.set(id, Node(node));
  std::vector<std::string> notes;
  const auto maps = with_robots_apart({first, second}, notes);
  const std::string base(62, 'x');
  EXPECT_THAT(maps[0].robots(), testing::UnorderedElementsAre(RobotId(base + "xx"), RobotId(base + "-2")));
  EXPECT_THAT(maps[1].robots(), testing::UnorderedElementsAre(RobotId(base + "xy"), RobotId(base + "-3")));
  EXPECT_EQ(notes.size(), 4u);
}

TEST(RobotsApart, leaves_a_map_alone_that_is_called_as_its_robot) {
  Map alpha = test::make_map("alpha", 3), other = test::make_map("alpha", 4, 900.0);
  other.id = MapId("tuesday");
  std::vector<std::string> notes;
  const auto maps = with_robots_apart({alpha, other}, notes);
  EXPECT_THAT(maps[0].robots(), ElementsAre(RobotId("alpha")));
  EXPECT_THAT(maps[1].robots(), ElementsAre(RobotId("tuesday")));
}

}  // namespace
}  // namespace mapweave::runtime
