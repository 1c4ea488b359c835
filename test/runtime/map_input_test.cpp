#include <mapweave/core/error.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/mapdb/update_journal.h>
#include <mapweave/runtime/map_input.h>
#include <mapweave/runtime/merge_runner.h>
#include <support/killed.h>
#include <support/received_updates.h>
#include <support/temporary_folder.h>

#include <gmock/gmock.h>
#include <mapweave/core/files.h>

namespace mapweave::runtime {
namespace {

using test::received_updates;
using test::ReceivedUpdate;
namespace fs = std::filesystem;

std::vector<mapdb::JournalEntry> entries() {
  std::vector<mapdb::JournalEntry> result;
  for (const ReceivedUpdate& one : received_updates()) result.push_back({one.from, one.bytes});
  return result;
}

std::vector<Map> maps_of_the_server() {
  tiers::VisualServer server(TierId("edge"), {}, {});
  for (const ReceivedUpdate& one : received_updates()) {
    server.greet(test::hello_of(one.from));
    server.receive(one.from, one.bytes);
  }
  return server.maps();
}

Hash identity_of(std::vector<Map> maps) { return mapdb::identity({std::move(maps), {}, {}, {}, {}}); }

struct JournalAsInput : testing::Test {
  std::string refusal(ErrorCode expected) const {
    try {
      read_map_input(path, MapId("edge"));
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), expected) << error.what();
      EXPECT_NE(std::string(error.what()).find("edge.mwj"), std::string::npos) << error.what();
      return error.what();
    }
    ADD_FAILURE() << "was read";
    return {};
  }
  test::TemporaryFolder folder;
  fs::path path = folder / "edge.mwj";
};

TEST(GridAsInput, names_the_file_where_every_cell_is_unknown) {
  const test::TemporaryFolder folder;
  write_file(folder / "hall.pgm", "P5\n40 30\n255\n" + std::string(1200, static_cast<char>(205)));
  write_file(folder / "hall.yaml", "image: hall.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n");
  try {
    read_map_input(folder / "hall.yaml", MapId("hall"));
    ADD_FAILURE() << "was read";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), testing::AllOf(testing::HasSubstr("hall.yaml: every cell of the grid is unknown"),
                                             testing::HasSubstr("thresholds")));
  }
  write_file(folder / "hall.pgm", "P5\n40 30\n255\n" + std::string(1200, static_cast<char>(0)));
  EXPECT_THAT(read_map_input(folder / "hall.yaml", MapId("hall")).notes,
              testing::ElementsAre(testing::HasSubstr("hall.yaml shows no free space")));
}

TEST_F(JournalAsInput, gives_the_maps_that_the_server_had) {
  mapdb::UpdateJournal(path).append(entries());
  const MapInput input = read_map_input(path, MapId("edge"));
  EXPECT_EQ(input.maps.size(), 2U);
  EXPECT_EQ(identity_of(input.maps), identity_of(maps_of_the_server()));
  EXPECT_THAT(input.files, testing::ElementsAre(path));
}

TEST_F(JournalAsInput, gives_all_that_a_killed_server_had_kept) {
  const std::vector<mapdb::JournalEntry> all = entries();
  ASSERT_EQ(test::killed(
                [&](int out) {
                  mapdb::UpdateJournal journal(path);
                  journal.append(all);
                  if (write(out, ".", 1) == 1) pause();
                },
                1, 0),
            1U);
  const MapInput input = read_map_input(path, MapId("edge"));
  EXPECT_EQ(identity_of(input.maps), identity_of(maps_of_the_server()));
  EXPECT_THAT(input.files, testing::ElementsAre(path, folder / "edge.mwj-wal"));
}

// More than a server holds in memory by default, of which the client forgot all but one.
TEST_F(JournalAsInput, gives_what_the_server_kept_on_its_disk) {
  const ReceivedUpdate& begun = received_updates().front();
  MapUpdate many = decode_map_update(begun.bytes, "test");
  Node keyframe = many.nodes.front();
  KeyframeFeatures features = *keyframe_of(keyframe);
  features.points.clear();
  features.descriptors.clear();
  keyframe.payload = std::make_shared<const Payload>(std::move(features));
  const auto count = static_cast<std::uint32_t>(tiers::ServerOptions().keyframes + 300);
  many.nodes.clear();
  many.landmarks.clear();
  for (keyframe.id.index = 0; keyframe.id.index < count; ++keyframe.id.index) {
    many.nodes.push_back(keyframe);
    if (keyframe.id.index + 1 < count) many.forgotten_nodes.push_back(keyframe.id);
  }
  mapdb::UpdateJournal(path).append({{begun.from, encode(many)}});
  const MapInput input = read_map_input(path, MapId("edge"));
  ASSERT_EQ(input.maps.size(), 1U);
  EXPECT_EQ(input.maps.front().nodes.size(), count);
}

TEST_F(JournalAsInput, is_merged_as_a_store_of_the_same_maps_is) {
  mapdb::UpdateJournal(path).append(entries());
  fs::create_directory(folder / "store");
  mapdb::write_store(folder / "store/edge.mwdb", {maps_of_the_server(), {}, {}, {}, {}});
  WorkerPool pool(1);
  const auto merge = [&](const fs::path& input, const std::string& out) {
    const Report report = run_merge({}, {input}, {folder / out, false}, pool, *make_silent_progress());
    EXPECT_EQ(report.team.components.size(), 1U);
    EXPECT_EQ(report.team.verdicts.size(), 1U);
    return read_file(folder / out / "team/map.mwdb");
  };
  EXPECT_EQ(merge(path, "of-journal"), merge(folder / "store/edge.mwdb", "of-store"));
}

TEST_F(JournalAsInput, keeps_apart_what_its_server_did_not_believe) {
  mapdb::UpdateJournal(path).append(entries());
  WorkerPool pool(1);
  const auto merge = [&](const std::string& out, bool forgets = false) {
    return run_merge({}, {path}, {folder / out, false, {}, forgets}, pool, *make_silent_progress()).team;
  };
  merge("joined");
  std::vector<mapdb::JournalEntry> vetoes;
  for (const Judgement& judgement : mapdb::read_store(folder / "joined/team/map.mwdb").judgements)
    vetoes.push_back({{}, {}, judgement.id});
  ASSERT_FALSE(vetoes.empty());
  mapdb::UpdateJournal(path).append(vetoes);
  EXPECT_EQ(read_map_input(path, MapId("edge")).vetoed.size(), vetoes.size());
  const auto apart = merge("apart");
  EXPECT_EQ(apart.components.size(), 2U);
  EXPECT_EQ(apart.verdicts.at(0).reason, Reason::vetoed);
  EXPECT_EQ(merge("forgotten", true).components.size(), 1U);
}

TEST_F(JournalAsInput, is_refused_where_it_is_damaged) {
  mapdb::UpdateJournal(path).append(entries());
  fs::resize_file(path, fs::file_size(path) / 2);
  EXPECT_THAT(refusal(ErrorCode::kCorrupt), testing::HasSubstr("cut short"));
}

TEST_F(JournalAsInput, is_refused_where_it_is_a_store) {
  mapdb::write_store(path, {maps_of_the_server(), {}, {}, {}, {}});
  EXPECT_THAT(refusal(ErrorCode::kCorrupt), testing::HasSubstr("of another program"));
}

TEST_F(JournalAsInput, is_refused_where_no_server_could_have_kept_it) {
  auto all = entries();
  for (auto& entry : all) entry.from = all.front().from;  // the other's map as one's own
  mapdb::UpdateJournal(path).append(all);
  EXPECT_THAT(refusal(ErrorCode::kCorrupt), testing::HasSubstr("does not fit"));
}

TEST_F(JournalAsInput, is_refused_where_nobody_published_anything) {
  { mapdb::UpdateJournal begun(path); }
  EXPECT_THAT(refusal(ErrorCode::kBadInput), testing::HasSubstr("no map in it"));
}

}  // namespace
}  // namespace mapweave::runtime
