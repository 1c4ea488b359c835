#include <gmock/gmock.h>
#include <mapweave/maps/map_update.h>
#include <sqlite3.h>

#include "stored.h"

namespace mapweave::mapdb {
namespace {

using test::RandomMaps;
using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

void make_from_sql(const std::filesystem::path& path, const std::string& sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(path.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(database);
  sqlite3_close(database);
}

std::string bytes_of(const Map& map) { return encode(difference({}, map)); }

TEST(MapStore, gives_back_what_it_was_given) {
  const TemporaryFolder folder;
  const StoredMaps stored = some_maps();
  write_store(folder / "team.mwdb", stored);
  const StoredMaps again = read_store(folder / "team.mwdb");
  ASSERT_EQ(again.maps.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(again.maps[i].id, stored.maps[i].id);
    EXPECT_EQ(bytes_of(again.maps[i]), bytes_of(stored.maps[i]));
  }
  ASSERT_EQ(again.judgements.size(), 5U);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(encode(again.judgements[i]), encode(stored.judgements[i]));
  ASSERT_EQ(again.verdicts.size(), 1U);
  EXPECT_EQ(encode(again.verdicts[0]), encode(stored.verdicts[0]));
  EXPECT_EQ(again.metadata, stored.metadata);
  EXPECT_EQ(identity(again), identity(stored));
}

TEST(MapStore, keeps_maps_of_more_nodes_than_one_update_holds) {
  const TemporaryFolder folder;
  StoredMaps stored;
  stored.maps = {RandomMaps(2).map("alpha", 4321, 4)};
  write_store(folder / "map.mwdb", stored);
  EXPECT_EQ(bytes_of(read_store(folder / "map.mwdb").maps.at(0)), bytes_of(stored.maps[0]));
}

TEST(MapStore, keeps_nothing_and_maps_of_nothing) {
  const TemporaryFolder folder;
  write_store(folder / "nothing.mwdb", {});
  EXPECT_TRUE(read_store(folder / "nothing.mwdb").maps.empty());
  StoredMaps stored;
  stored.maps.resize(1);
  stored.maps[0].id = MapId("empty");
  write_store(folder / "empty.mwdb", stored);
  EXPECT_EQ(read_store(folder / "empty.mwdb").maps.at(0).id, MapId("empty"));
  EXPECT_EQ(summarize_store(folder / "empty.mwdb").maps.at(0).nodes, 0U);
}

TEST(MapStore, has_the_same_bytes_for_the_same_content_in_any_order) {
  const TemporaryFolder folder;
  StoredMaps stored = some_maps(3, 200);
  stored.verdicts.push_back(RandomMaps(9).verdict(MapId("alpha"), MapId("team")));
  write_store(folder / "one.mwdb", stored);
  std::reverse(stored.maps.begin(), stored.maps.end());
  std::reverse(stored.judgements.begin(), stored.judgements.end());
  std::reverse(stored.verdicts.begin(), stored.verdicts.end());
  stored.verdicts[0].seconds = 12.5;
  write_store(folder / "two.mwdb", stored);
  write_store(folder / "two.mwdb", read_store(folder / "two.mwdb"));
  EXPECT_TRUE(read_file(folder / "one.mwdb") == read_file(folder / "two.mwdb"));
}

TEST(MapStore, has_another_identity_for_any_other_content_or_belief) {
  const StoredMaps stored = some_maps();
  std::set<Hash> identities = {identity(stored)};
  const auto changed = [&](const std::function<void(StoredMaps&)>& change) {
    StoredMaps copy = stored;
    change(copy);
    identities.insert(identity(copy));
  };
  changed([](StoredMaps& s) { (s.maps[0].nodes.begin() + 3)->second.map_from_node.t.x() += 1e-12; });
  changed([](StoredMaps& s) { (s.maps[0].nodes.begin() + 3)->second.stamp.ns += 1; });
  changed([](StoredMaps& s) { s.maps[0].constraints.erase(s.maps[0].constraints.front().first); });
  changed([](StoredMaps& s) { s.maps[1].id = MapId("gamma"); });
  changed([](StoredMaps& s) { s.maps.pop_back(); });
  changed([](StoredMaps& s) { s.judgements[0].probability /= 2; });
  changed([](StoredMaps& s) { s.verdicts.clear(); });
  EXPECT_EQ(identities.size(), 8U);
  changed([](StoredMaps& s) { s.metadata["note"] = "metadata are beside the point"; });
  EXPECT_EQ(identities.size(), 8U);
}

TEST(MapStore, leaves_one_file_that_any_sqlite_opens_without_writing) {
  const TemporaryFolder folder;
  write_store(folder / "map.mwdb", some_maps());
  EXPECT_EQ(count_files(folder.path()), 1U);
  const std::string bytes = read_file(folder / "map.mwdb");
  EXPECT_EQ(bytes[18], 1) << "not in write-ahead mode";
  EXPECT_EQ(bytes[19], 1);
  EXPECT_EQ(bytes.substr(68, 4), "MWDB") << "the application id";
  read_store(folder / "map.mwdb");
  summarize_store(folder / "map.mwdb");
  EXPECT_EQ(count_files(folder.path()), 1U);
  EXPECT_TRUE(read_file(folder / "map.mwdb") == bytes);
}

TEST(MapStore, keeps_keyframes_and_landmarks) {
  const TemporaryFolder folder;
  StoredMaps stored;
  RandomMaps random(5);
  stored.maps = {random.keyframe_map("alpha", 40), random.map("beta", 12)};
  write_store(folder / "map.mwdb", stored);
  const StoredMaps again = read_store(folder / "map.mwdb");
  ASSERT_EQ(again.maps.size(), 2U);
  EXPECT_EQ(bytes_of(again.maps[0]), bytes_of(stored.maps[0]));
  EXPECT_EQ(again.maps[0].landmarks.size(), 90U);
  const StoreSummary summary = summarize_store(folder / "map.mwdb");
  EXPECT_EQ(summary.maps[0].contents, 30U);
  EXPECT_EQ(summary.maps[0].keyframes, 30U);
  EXPECT_EQ(summary.maps[0].landmarks, 90U);
  EXPECT_EQ(summary.maps[1].keyframes, 0U);
  EXPECT_EQ(summary.maps[1].landmarks, 0U);
}

TEST(MapStore, keeps_keyframes_of_more_bytes_than_one_update_holds) {
  const TemporaryFolder folder;
  StoredMaps stored;
  stored.maps = {RandomMaps(2).keyframe_map("alpha", 150, 2000)};
  write_store(folder / "map.mwdb", stored);
  EXPECT_EQ(bytes_of(read_store(folder / "map.mwdb").maps.at(0)), bytes_of(stored.maps[0]));
}

TEST(MapStore, has_another_identity_when_landmarks_move_or_are_seen_elsewhere) {
  StoredMaps stored;
  stored.maps = {RandomMaps(5).keyframe_map("alpha", 8)};
  std::set<Hash> identities = {identity(stored)};
  Landmark& landmark = stored.maps[0].landmarks.begin()->second;
  landmark.point_units.z() += 1;
  identities.insert(identity(stored));
  landmark.seen[0].v ^= 1;
  identities.insert(identity(stored));
  stored.maps[0].landmarks.erase(landmark.id);
  identities.insert(identity(stored));
  EXPECT_EQ(identities.size(), 4U);
}

// Written before there were keyframes: identity and bytes of what it holds are as they were.
TEST(MapStore, of_schema_1_is_read_and_rewritten) {
  const TemporaryFolder folder;
  const auto path = folder / "old.mwdb";
  make_from_sql(path, read_file(MAPWEAVE_TEST_DATA "/store_of_schema_1.sql"));
  const StoreSummary summary = summarize_store(path);
  EXPECT_EQ(summary.schema, 1);
  ASSERT_EQ(summary.maps.size(), 1U);
  EXPECT_EQ(summary.maps[0].nodes, 6U);
  EXPECT_EQ(summary.maps[0].contents, 4U);
  EXPECT_EQ(summary.maps[0].keyframes, 0U);
  EXPECT_EQ(summary.maps[0].landmarks, 0U);
  const StoredMaps stored = read_store(path);
  EXPECT_EQ(identity(stored), summary.identity);
  EXPECT_EQ(stored.maps[0].nodes.size(), 6U);
  EXPECT_EQ(stored.judgements.size(), 1U);
  EXPECT_EQ(stored.verdicts.size(), 1U);
  EXPECT_EQ(stored.metadata.at("program"), "mapweave 0.1.0");
  write_store(path, stored);
  EXPECT_EQ(summarize_store(path).schema, 2);
  EXPECT_EQ(summarize_store(path).identity, summary.identity);
}

TEST(MapStore, of_schema_1_is_believed_no_more_than_others) {
  const TemporaryFolder folder;
  const auto path = folder / "old.mwdb";
  const std::string sql = read_file(MAPWEAVE_TEST_DATA "/store_of_schema_1.sql");
  for (const char* change :
       {"UPDATE maps SET nodes = 7", "PRAGMA user_version = 2", "ALTER TABLE maps ADD COLUMN keyframes INTEGER"}) {
    std::filesystem::remove(path);
    make_from_sql(path, sql + change);
    const auto error = error_of([&] { summarize_store(path); });
    ASSERT_TRUE(error) << change;
    EXPECT_EQ(error->code(), ErrorCode::kCorrupt) << error->what();
  }
}

TEST(MapStore, gives_back_the_own_maps_of_a_teams_members) {
  const TemporaryFolder folder;
  StoredMaps stored = some_maps(5, 60);
  const std::vector<Map> own{stored.maps[0], stored.maps[1]};
  Map& team = stored.maps[2];
  const NodeId lacking = own[1].nodes.front().first;  // what the team map lacks comes from the member
  team.nodes.erase(lacking);
  for (const Map& map : own) {
    for (const auto& [id, submap] : map.submaps)
      if (submap.anchor() != lacking) team.submaps.set(id, submap);
    for (const auto& [id, constraint] : map.constraints)
      if (id.from != lacking && id.to != lacking) team.constraints.set(id, constraint);
  }
  for (auto& [id, node] : team.nodes) node.map_from_node = compose(spatial(Pose2{3.0, -1.0, 0.4}), node.map_from_node);
  stored.maps = {team};
  const Hash before = identity(stored);
  write_store(folder / "before.mwdb", stored);
  for (const Map& map : own) stored.members.push_back({team.id, map});
  EXPECT_NE(identity(stored), before);
  write_store(folder / "team.mwdb", stored);
  const StoredMaps again = read_store(folder / "team.mwdb");
  EXPECT_EQ(identity(again), identity(stored));
  ASSERT_EQ(again.members.size(), 2U);
  for (std::size_t i = 0; i < 2; ++i) {
    StoredMaps expected, found;
    expected.maps = {own[i]};
    found.maps = {again.members[i].own};
    EXPECT_EQ(again.members[i].team, team.id);
    EXPECT_EQ(identity(found), identity(expected)) << i;
  }
  const StoreSummary summary = summarize_store(folder / "team.mwdb");
  EXPECT_EQ(summary.schema, kSchemaVersion);
  EXPECT_EQ(summary.members, 2U);
}

TEST(MapStore, takes_any_file_name) {
  const TemporaryFolder folder;
  const auto path = folder / "a b?mode=memory#100%\xc3\xa4.mwdb";
  write_store(path, some_maps());
  EXPECT_EQ(read_store(path).maps.size(), 3U);
}

TEST(MapStore, replaces_an_old_store) {
  const TemporaryFolder folder;
  write_store(folder / "map.mwdb", some_maps(1));
  write_store(folder / "map.mwdb", some_maps(2));
  EXPECT_EQ(summarize_store(folder / "map.mwdb").identity, identity(some_maps(2)));
  EXPECT_EQ(count_files(folder.path()), 1U);
}

TEST(MapStore, is_summarised_without_reading_the_maps) {
  const TemporaryFolder folder;
  const StoredMaps stored = some_maps(4, 40);
  write_store(folder / "map.mwdb", stored);
  const StoreSummary summary = summarize_store(folder / "map.mwdb");
  EXPECT_EQ(summary.schema, 2);
  EXPECT_EQ(summary.file_bytes, std::filesystem::file_size(folder / "map.mwdb"));
  EXPECT_EQ(summary.judgements, 5U);
  EXPECT_EQ(summary.verdicts, 1U);
  EXPECT_EQ(summary.metadata, stored.metadata);
  EXPECT_EQ(summary.identity, identity(stored));
  ASSERT_EQ(summary.maps.size(), 3U);
  const Map& alpha = stored.maps[0];
  const StoredMapSummary& map = summary.maps[0];
  EXPECT_EQ(map.id, MapId("alpha"));
  EXPECT_EQ(map.nodes, 40U);
  EXPECT_EQ(map.contents,
            static_cast<std::uint64_t>(std::count_if(alpha.nodes.begin(), alpha.nodes.end(),
                                                     [](const auto& e) { return e.second.payload != nullptr; })));
  EXPECT_EQ(map.submaps, alpha.submaps.size());
  EXPECT_EQ(map.constraints, alpha.constraints.size());
  EXPECT_EQ(map.first, alpha.nodes.front().second.stamp);
  EXPECT_EQ(map.last, alpha.nodes.back().second.stamp);
  EXPECT_EQ(map.content, content_hash(alpha));
  EXPECT_LT(map.stored_bytes, map.bytes);
  for (const auto& [id, node] : alpha.nodes) {
    EXPECT_TRUE(node.map_from_node.t.x() >= map.min_x_m && node.map_from_node.t.x() <= map.max_x_m);
    EXPECT_TRUE(node.map_from_node.t.y() >= map.min_y_m && node.map_from_node.t.y() <= map.max_y_m);
  }
  ASSERT_EQ(map.sessions.size(), 1U);
  EXPECT_EQ(map.sessions[0].id, alpha.sessions()[0]);
  EXPECT_EQ(map.sessions[0].nodes, 40U);
  ASSERT_EQ(summary.maps[2].sessions.size(), 2U);
  EXPECT_EQ(summary.maps[2].sessions[1].nodes, 20U);
}

TEST(MapStore, expects_maps_that_can_be_kept) {
  const TemporaryFolder folder;
  const auto refuses = [&](const std::function<void(StoredMaps&)>& spoil) {
    StoredMaps stored = some_maps();
    spoil(stored);
    EXPECT_THROW(write_store(folder / "map.mwdb", stored), ContractViolation);
  };
  refuses([](StoredMaps& s) { s.maps[1].id = s.maps[0].id; });
  refuses([](StoredMaps& s) { s.maps[1].id = MapId("../beta"); });
  refuses([](StoredMaps& s) { s.judgements.push_back(s.judgements[0]); });
  refuses([](StoredMaps& s) { s.maps[0].nodes.begin()->second.map_from_node.t.x() = NAN; });
  refuses([](StoredMaps& s) { s.maps[0].submaps.begin()->second.content.bytes[0] ^= 1; });
  refuses([](StoredMaps& s) { s.metadata["name"] = "M\xe1laga"; });
  EXPECT_EQ(count_files(folder.path()), 0U);
}

TEST(MapStore, says_where_it_cannot_write) {
  const TemporaryFolder folder;
  const auto no_folder = error_of([&] { write_store(folder / "nowhere/map.mwdb", some_maps()); });
  ASSERT_TRUE(no_folder);
  EXPECT_EQ(no_folder->code(), ErrorCode::kCannotWrite);
  EXPECT_THAT(no_folder->what(), ::testing::AllOf(HasSubstr("nowhere/map.mwdb"), HasSubstr("No such file"),
                                                  HasSubstr("check that the folder exists")));
  const auto is_folder = error_of([&] { write_store(folder.path(), some_maps()); });
  ASSERT_TRUE(is_folder);
  EXPECT_EQ(is_folder->code(), ErrorCode::kCannotWrite);
}

}  // namespace
}  // namespace mapweave::mapdb
