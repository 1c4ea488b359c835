// A camera map server that is killed again and again, with a journal of what it received.
#include <support/received_updates.h>

#include <mapweave/mapdb/update_journal.h>
#include <support/killed.h>
#include <support/temporary_folder.h>

#include <gmock/gmock.h>
#include <random>

namespace mapweave::tiers {
namespace {

using test::hello_of;
using test::received_updates;
using test::ReceivedUpdate;

// A server begins with what its journal holds.
void restore(VisualServer& server, mapdb::UpdateJournal& journal) {
  journal.replay([&](const mapdb::JournalEntry& entry) {
    server.greet(hello_of(entry.from));
    server.receive(entry.from, entry.update);
  });
}

// Clients say hello and repeat what is not stored; a byte on `acknowledged` for each update that is.
void serve(const std::filesystem::path& path, int acknowledged) {
  mapdb::UpdateJournal journal(path);
  VisualServer server(TierId("edge"), {}, {});
  restore(server, journal);
  int appended = 0;
  for (const ReceivedUpdate& one : received_updates()) {
    const MapUpdate update = decode_map_update(one.bytes, "test");
    std::uint64_t stored = 0;
    for (const Receipt& receipt : server.greet(hello_of(one.from)))
      if (receipt.origin.map == update.origin.map) stored = receipt.stored;
    if (update.sequence <= stored) continue;
    std::vector<mapdb::JournalEntry> entries;
    for (const std::string& bytes : server.receive(one.from, one.bytes).stored) entries.push_back({one.from, bytes});
    journal.append(entries);
    if (write(acknowledged, ".", 1) != 1) return;
    if (++appended % 7 == 0) {
      std::vector<mapdb::JournalEntry> all;
      for (auto& [from, bytes] : server.snapshot()) all.push_back({from, bytes});
      journal.replace(all);
    }
  }
}

TEST(StoredServer, ends_with_the_same_map_however_often_it_is_killed) {
  const test::TemporaryFolder folder;
  const auto path = folder.path() / "edge.mwj";
  VisualServer whole(TierId("edge"), {}, {});
  for (const ReceivedUpdate& one : received_updates()) {
    whole.greet(hello_of(one.from));
    whole.receive(one.from, one.bytes);
  }
  std::mt19937 random(11);
  std::size_t acknowledged = 0;
  for (int kill = 0; kill < 20; ++kill) {
    const std::size_t most = random() % 4;
    acknowledged += test::killed([&](int out) { serve(path, out); }, most, static_cast<unsigned>(random() % 20000));
    mapdb::UpdateJournal journal(path);
    VisualServer server(TierId("edge"), {}, {});
    restore(server, journal);
    std::uint64_t stored = 0;
    for (const ReceivedUpdate& one : received_updates()) {
      const MapUpdate update = decode_map_update(one.bytes, "test");
      for (const Receipt& receipt : server.greet(hello_of(one.from)))
        stored += receipt.origin.map == update.origin.map && update.sequence <= receipt.stored;
    }
    EXPECT_GE(stored, acknowledged) << "what was acknowledged is there";
  }
  int nobody[2];
  ASSERT_EQ(pipe(nobody), 0);
  serve(path, nobody[1]);
  close(nobody[0]);
  close(nobody[1]);
  mapdb::UpdateJournal journal(path);
  VisualServer server(TierId("edge"), {}, {});
  restore(server, journal);
  EXPECT_EQ(test::sealed(server), test::sealed(whole));
}

}  // namespace
}  // namespace mapweave::tiers
