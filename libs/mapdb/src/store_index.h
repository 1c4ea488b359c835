#pragma once
// What a store holds beside its blobs: small, with one hash over all of it (table `seal` of the file format).

#include "packed_blob.h"

#include <mapweave/core/sqlite.h>
#include <mapweave/mapdb/map_store.h>

namespace mapweave::mapdb {

enum class BlobKind { update, judgements, verdict, member };

struct BlobEntry {
  std::int64_t owner = 0;     // of an update or a member: the map's place among the maps; else 0
  std::int64_t sequence = 0;  // from 1 per owner
  std::int64_t bytes = 0, stored_bytes = 0;
  Hash sha256;
};

struct StoreIndex {
  StoreSummary summary;
  std::vector<BlobEntry> updates, judgements, verdicts, members;
};

void create_tables(Database&, int schema);
// The schema. Throws unless the tables are those of it: kUnsupported where it is newer than this program's.
int expect_tables(Database&);

// Writes one blob and notes it in the index.
void insert_blob(Database&, StoreIndex&, BlobKind, std::int64_t owner, std::string_view plain);
// Its plain bytes, as its hash says.
std::string read_blob(Database&, BlobKind, const BlobEntry&);

// The rest, once all blobs are written.
void write_index(Database&, const StoreIndex&);
// Throws Error(kCorrupt) where its hash is another than the file says. Every name in it is valid, every blob's owner is
// a map.
StoreIndex read_index(Database&, int schema);

}  // namespace mapweave::mapdb
