#pragma once
// One SQLite file (.mwdb) keeps maps and what is believed about them. A store is written whole and never changed.

#include <mapweave/core/hash.h>
#include <mapweave/maps/judgement.h>
#include <mapweave/maps/map.h>

#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace mapweave::mapdb {

// PRAGMA user_version. Schema 1, which knew no keyframes, is read too; schema 2 is written where there are no members.
inline constexpr int kSchemaVersion = 3;

// One robot's own map, beside a team map of the same store that it is part of.
struct MemberMap {
  MapId team;
  Map own;
};

struct StoredMaps {
  std::vector<Map> maps;              // ids differ
  std::vector<MemberMap> members;     // of those maps; ids differ. Takes little more room than the poses of their nodes
  std::vector<Judgement> judgements;  // ids differ
  std::vector<Verdict> verdicts;      // their `seconds` are not kept
  std::map<std::string, std::string>
      metadata;  // whatever the writer wants to be known: versions, options, checksums; UTF-8
};

// The canonical identity of maps (content and belief), judgements and verdicts. Knows neither their order, nor
// metadata, nor SQLite.
Hash identity(const StoredMaps&);

// Writes beside `path`, syncs and renames: whatever happens, `path` is the old file, the new one, or not there. Equal
// contents give equal bytes, with one version of SQLite and zstd. Maps and judgements come in order of their ids,
// verdicts of (a, b, by). Throws Error(kCannotWrite), with the free space when the disk is full, and leaves nothing
// behind; ContractViolation for maps that have no byte form (maps/map_update.h), or for two of one id.
void write_store(const std::filesystem::path& path, const StoredMaps&);

// Opens read-only and leaves no trace, so a store may lie in a folder that cannot be written. Everything is checked
// against the hashes in the file. Throws Error: kMissing; kBadInput for a folder; kUnsupported for a newer schema;
// kCorrupt for what is not a store, or damaged.
StoredMaps read_store(const std::filesystem::path& path);

struct SessionSummary {
  SessionId id;
  std::uint64_t nodes = 0;
};

struct StoredMapSummary {
  MapId id;
  std::uint64_t nodes = 0, contents = 0;       // contents: nodes that hold a scan, grid or keyframe
  std::uint64_t keyframes = 0, landmarks = 0;  // keyframes: nodes that hold one
  std::uint64_t submaps = 0, constraints = 0;
  Stamp first, last;  // of the nodes; zero where there are none, as the following
  double min_x_m = 0, min_y_m = 0, max_x_m = 0, max_y_m = 0;  // of the nodes' poses, in the map's frame
  std::vector<SessionSummary> sessions;                       // sorted
  Hash content;                                               // content_hash(map)
  std::uint64_t bytes = 0, stored_bytes = 0;                  // of its encoded updates, plain and compressed
};

// Of a map that is in no store: all but bytes and stored_bytes.
StoredMapSummary summary_of(const Map&);

struct StoreSummary {
  int schema = 0;
  std::uint64_t file_bytes = 0;
  std::vector<StoredMapSummary> maps;
  std::uint64_t judgements = 0, verdicts = 0, members = 0;
  std::map<std::string, std::string> metadata;
  Hash identity;  // of the StoredMaps
};

// What a store says of itself, without reading the maps: quick however large they are. Throws as read_store.
StoreSummary summarize_store(const std::filesystem::path& path);

}  // namespace mapweave::mapdb
