// Map stores (.mwdb): the file as it is, and content that its writer has sealed, whatever it is.

#include "fuzz_target.h"

#include <mapdb/stored.h>
#include <store_index.h>

namespace mapweave::fuzz {
namespace {

using namespace mapdb;

const StoredMaps& sound_maps() {
  static const StoredMaps maps = [] {
    StoredMaps made = some_maps(1, 12);
    made.members = {{MapId("team"), made.maps.front()}};
    return made;
  }();
  return maps;
}

void read_file_of_store(std::string_view bytes) {
  const auto path = scratch_file("input.mwdb", bytes);
  read_store(path);
}

constexpr BlobKind kKinds[] = {BlobKind::update, BlobKind::judgements, BlobKind::verdict, BlobKind::member};

const std::vector<BlobEntry>& entries_of(const StoreIndex& index, BlobKind kind) {
  switch (kind) {
    case BlobKind::update: return index.updates;
    case BlobKind::judgements: return index.judgements;
    case BlobKind::verdict: return index.verdicts;
    case BlobKind::member: break;
  }
  return index.members;
}

struct Content {
  StoreIndex index;
  std::vector<std::vector<std::string>> blobs;  // of each kind
};

const Content& sound_content() {
  static const Content content = [] {
    const auto path = scratch_folder() / "sound.mwdb";
    write_store(path, sound_maps());
    Database database(path, Database::Use::read, path);
    Content read{read_index(database, expect_tables(database)), {}};
    for (const BlobKind kind : kKinds) {
      read.blobs.emplace_back();
      for (const BlobEntry& entry : entries_of(read.index, kind))
        read.blobs.back().push_back(read_blob(database, kind, entry));
    }
    return read;
  }();
  return content;
}

// The first byte says which blob, the others are it.
void read_sealed(std::string_view bytes) {
  if (bytes.empty()) return;
  const Content& sound = sound_content();
  std::size_t replaced = static_cast<unsigned char>(bytes.front()) % 8;
  const auto path = scratch_file("sealed.mwdb", "");
  std::filesystem::remove(path);
  StoreIndex index;
  index.summary = sound.index.summary;
  {
    Database database(path, Database::Use::create, path);
    database.run("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF");
    create_tables(database, index.summary.schema);
    for (std::size_t kind = 0; kind < sound.blobs.size(); ++kind)
      for (std::size_t i = 0; i < sound.blobs[kind].size(); ++i)
        insert_blob(database, index, kKinds[kind], entries_of(sound.index, kKinds[kind])[i].owner,
                    replaced-- == 0 ? bytes.substr(1) : std::string_view(sound.blobs[kind][i]));
    write_index(database, index);
  }
  read_store(path);
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = [] {
    std::vector<std::string> sealed;
    for (const auto& blobs : sound_content().blobs)
      for (const std::string& blob : blobs) sealed.push_back(static_cast<char>(sealed.size()) + blob);
    return std::vector<Kind>{{read_file_of_store, {file_bytes(scratch_folder() / "sound.mwdb")}},
                             {read_sealed, sealed}};
  }();
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
