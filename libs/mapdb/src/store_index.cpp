#include "store_index.h"

#include <algorithm>
#include <iterator>
#include <limits>

namespace mapweave::mapdb {
namespace {

constexpr std::int64_t kApplicationId = 0x4d574442;  // "MWDB"

constexpr const char* kMapsOfSchema1 =
    "CREATE TABLE maps (place INTEGER PRIMARY KEY, id TEXT NOT NULL, nodes INTEGER NOT NULL, contents INTEGER NOT "
    "NULL, submaps INTEGER "
    "NOT NULL, "
    "constraints INTEGER NOT NULL, first_ns INTEGER NOT NULL, last_ns INTEGER NOT NULL, min_x_m REAL NOT NULL, min_y_m "
    "REAL NOT NULL, "
    "max_x_m REAL NOT NULL, max_y_m REAL NOT NULL, content BLOB NOT NULL) STRICT";

// Schema 3; in schema 2 the last was not there, in schema 1 the first was without keyframes and landmarks. WITHOUT
// ROWID where rows are small and found by their key.
constexpr const char* kTables[] = {
    "CREATE TABLE maps (place INTEGER PRIMARY KEY, id TEXT NOT NULL, nodes INTEGER NOT NULL, contents INTEGER NOT "
    "NULL, submaps INTEGER "
    "NOT NULL, "
    "constraints INTEGER NOT NULL, first_ns INTEGER NOT NULL, last_ns INTEGER NOT NULL, min_x_m REAL NOT NULL, min_y_m "
    "REAL NOT NULL, "
    "max_x_m REAL NOT NULL, max_y_m REAL NOT NULL, content BLOB NOT NULL, keyframes INTEGER NOT NULL, landmarks "
    "INTEGER NOT NULL) STRICT",
    "CREATE TABLE sessions (map INTEGER NOT NULL, robot TEXT NOT NULL, sensor TEXT NOT NULL, run_ns INTEGER NOT NULL, "
    "nodes INTEGER NOT "
    "NULL, "
    "PRIMARY KEY (map, robot, sensor, run_ns)) STRICT, WITHOUT ROWID",
    "CREATE TABLE updates (map INTEGER NOT NULL, sequence INTEGER NOT NULL, bytes INTEGER NOT NULL, sha256 BLOB NOT "
    "NULL, zstd BLOB NOT "
    "NULL, "
    "PRIMARY KEY (map, sequence)) STRICT",
    "CREATE TABLE judgements (sequence INTEGER PRIMARY KEY, bytes INTEGER NOT NULL, sha256 BLOB NOT NULL, zstd BLOB "
    "NOT NULL) STRICT",
    "CREATE TABLE verdicts (sequence INTEGER PRIMARY KEY, bytes INTEGER NOT NULL, sha256 BLOB NOT NULL, zstd BLOB NOT "
    "NULL) STRICT",
    "CREATE TABLE metadata (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT, WITHOUT ROWID",
    "CREATE TABLE seal (identity BLOB NOT NULL, judgements INTEGER NOT NULL, verdicts INTEGER NOT NULL, sha256 BLOB "
    "NOT NULL) STRICT",
    "CREATE TABLE members (map INTEGER NOT NULL, sequence INTEGER NOT NULL, bytes INTEGER NOT NULL, sha256 BLOB NOT "
    "NULL, zstd BLOB NOT "
    "NULL, "
    "PRIMARY KEY (map, sequence)) STRICT"};
constexpr int kSchemaWithMembers = 3;

// How many of the tables a schema has.
std::size_t tables_of(int schema) { return std::size(kTables) - (schema < kSchemaWithMembers ? 1 : 0); }

std::string_view bytes_of(const Hash& hash) {
  return {reinterpret_cast<const char*>(hash.bytes.data()), hash.bytes.size()};
}

std::int64_t number(std::uint64_t count) { return static_cast<std::int64_t>(count); }

Hash hash_from(std::string_view bytes, const Database& database) {
  Hash hash;
  if (bytes.size() != hash.bytes.size())
    database.corrupt("a hash of " + std::to_string(bytes.size()) + " bytes; 32 are expected");
  std::copy(bytes.begin(), bytes.end(), hash.bytes.begin());
  return hash;
}

std::uint64_t count_from(std::int64_t number, const Database& database) {
  if (number < 0) database.corrupt("a count is " + std::to_string(number));
  return static_cast<std::uint64_t>(number);
}

std::string name_from(const std::string& text, const Database& database) {
  if (!is_valid_name(text)) database.corrupt("a map, robot or sensor has no valid name");
  return text;
}

// Whether SQLite and readers of the metadata see the same letters (RFC 3629).
bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto first = static_cast<std::uint8_t>(text[i]);
    const std::size_t length = first < 0x80                    ? 1
                               : first >= 0xc2 && first < 0xe0 ? 2
                               : first >= 0xe0 && first < 0xf0 ? 3
                               : first >= 0xf0 && first < 0xf5 ? 4
                                                               : 0;
    if (length == 0 || length > text.size() - i) return false;
    std::uint32_t letter = length == 1 ? first : first & (0x7f >> length);
    for (std::size_t k = 1; k < length; ++k) {
      const auto next = static_cast<std::uint8_t>(text[i + k]);
      if ((next & 0xc0) != 0x80) return false;
      letter = letter << 6 | (next & 0x3f);
    }
    if ((length == 3 && (letter < 0x800 || (letter >= 0xd800 && letter < 0xe000))) ||
        (length == 4 && (letter < 0x10000 || letter > 0x10ffff)))
      return false;
    i += length;
  }
  return true;
}

void add(Hasher& hasher, const std::vector<BlobEntry>& blobs) {
  hasher.add(number(blobs.size()));
  for (const BlobEntry& blob : blobs) hasher.add(blob.owner).add(blob.sequence).add(blob.bytes).add(blob.sha256);
}

// Over everything that the tables hold, but for the compressed bytes, which have their own hashes. The file format
// keeps it in a table that is called `seal`.
Hash index_hash_of(const StoreIndex& index) {
  const StoreSummary& summary = index.summary;
  Hasher hasher;
  hasher.add("store")
      .add(std::int64_t{summary.schema})
      .add(summary.identity)
      .add(number(summary.judgements))
      .add(number(summary.verdicts));
  hasher.add(number(summary.maps.size()));
  for (const StoredMapSummary& map : summary.maps) {
    hasher.add(map.id.str())
        .add(number(map.nodes))
        .add(number(map.contents))
        .add(number(map.submaps))
        .add(number(map.constraints));
    if (summary.schema > 1) hasher.add(number(map.keyframes)).add(number(map.landmarks));
    hasher.add(map.first.ns)
        .add(map.last.ns)
        .add(map.min_x_m)
        .add(map.min_y_m)
        .add(map.max_x_m)
        .add(map.max_y_m)
        .add(map.content);
    hasher.add(number(map.sessions.size()));
    for (const SessionSummary& session : map.sessions)
      hasher.add(session.id.client.robot.str())
          .add(session.id.client.sensor.str())
          .add(session.id.run)
          .add(number(session.nodes));
  }
  add(hasher, index.updates);
  add(hasher, index.judgements);
  add(hasher, index.verdicts);
  if (summary.schema >= kSchemaWithMembers) add(hasher, index.members);
  for (const auto& [key, value] : summary.metadata) hasher.add(key).add(value);
  return hasher.finish();
}

std::vector<BlobEntry>& entries_of(StoreIndex& index, BlobKind kind) {
  switch (kind) {
    case BlobKind::update: return index.updates;
    case BlobKind::judgements: return index.judgements;
    case BlobKind::verdict: return index.verdicts;
    case BlobKind::member: break;
  }
  return index.members;
}

std::vector<BlobEntry> read_entries(Database& database, const char* sql) {
  std::vector<BlobEntry> entries;
  Statement rows(database, sql);
  while (rows.step()) {
    BlobEntry entry{rows.integer(0), rows.integer(1), rows.integer(2), rows.integer(3),
                    hash_from(rows.bytes(4), database)};
    const bool follows = !entries.empty() && entries.back().owner == entry.owner;
    if (entry.sequence != (follows ? entries.back().sequence + 1 : 1))
      database.corrupt("blob " + std::to_string(entry.sequence) + " does not follow the one before");
    entries.push_back(entry);
  }
  return entries;
}

}  // namespace

StoredMapSummary summary_of(const Map& map) {
  StoredMapSummary summary;
  summary.id = map.id;
  summary.nodes = map.nodes.size();
  summary.submaps = map.submaps.size();
  summary.constraints = map.constraints.size();
  summary.landmarks = map.landmarks.size();
  summary.content = content_hash(map);
  if (map.empty()) return summary;
  summary.first = summary.last = map.nodes.front().second.stamp;
  summary.min_x_m = summary.min_y_m = std::numeric_limits<double>::infinity();
  summary.max_x_m = summary.max_y_m = -std::numeric_limits<double>::infinity();
  for (const auto& [id, node] : map.nodes) {
    if (summary.sessions.empty() || summary.sessions.back().id != id.session)
      summary.sessions.push_back({id.session, 0});
    ++summary.sessions.back().nodes;
    if (node.payload != nullptr) ++summary.contents;
    if (std::get_if<KeyframeFeatures>(node.payload.get()) != nullptr) ++summary.keyframes;
    summary.first = std::min(summary.first, node.stamp);
    summary.last = std::max(summary.last, node.stamp);
    summary.min_x_m = std::min(summary.min_x_m, node.map_from_node.t.x());
    summary.min_y_m = std::min(summary.min_y_m, node.map_from_node.t.y());
    summary.max_x_m = std::max(summary.max_x_m, node.map_from_node.t.x());
    summary.max_y_m = std::max(summary.max_y_m, node.map_from_node.t.y());
  }
  for (double* bound : {&summary.min_x_m, &summary.min_y_m, &summary.max_x_m, &summary.max_y_m})
    *bound += 0.0;  // SQLite keeps no negative zero
  return summary;
}

void create_tables(Database& database, int schema) {
  database.run("PRAGMA application_id = " + std::to_string(kApplicationId) +
               "; PRAGMA user_version = " + std::to_string(schema));
  for (std::size_t i = 0; i < tables_of(schema); ++i) database.run(kTables[i]);
}

int expect_tables(Database& database) {
  if (database.number("PRAGMA application_id") != kApplicationId)
    database.corrupt("it is an SQLite file of another program");
  const std::int64_t version = database.number("PRAGMA user_version");
  if (version > kSchemaVersion)
    throw Error(ErrorCode::kUnsupported,
                "the map store has schema " + std::to_string(version) + "; this program knows schemas up to " +
                    std::to_string(kSchemaVersion),
                database.shown().string(), "read it with a newer mapweave, or make it again with this one");
  if (version < 1) database.corrupt("its schema is " + std::to_string(version));
  Statement rows(database, "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY rowid");
  for (std::size_t i = 0; i < tables_of(static_cast<int>(version)); ++i)
    if (!rows.step() || rows.text(0) != (version == 1 && i == 0 ? kMapsOfSchema1 : kTables[i]))
      database.corrupt("its tables are not those of schema " + std::to_string(version));
  if (rows.step()) database.corrupt("it holds more tables than those of schema " + std::to_string(version));
  return static_cast<int>(version);
}

void insert_blob(Database& database, StoreIndex& index, BlobKind kind, std::int64_t owner, std::string_view plain) {
  std::vector<BlobEntry>& entries = entries_of(index, kind);
  const bool follows = !entries.empty() && entries.back().owner == owner;
  const PackedBlob blob = pack(plain);
  entries.push_back(
      {owner, follows ? entries.back().sequence + 1 : 1, blob.bytes, number(blob.zstd.size()), blob.sha256});
  const BlobEntry& entry = entries.back();
  if (kind == BlobKind::update || kind == BlobKind::member) {
    Statement insert(database, kind == BlobKind::update ? "INSERT INTO updates VALUES (?, ?, ?, ?, ?)"
                                                        : "INSERT INTO members VALUES (?, ?, ?, ?, ?)");
    insert.bind(owner)
        .bind(entry.sequence)
        .bind(entry.bytes)
        .bind_bytes(bytes_of(entry.sha256))
        .bind_bytes(blob.zstd)
        .run();
  } else {
    Statement insert(database, kind == BlobKind::judgements ? "INSERT INTO judgements VALUES (?, ?, ?, ?)"
                                                            : "INSERT INTO verdicts VALUES (?, ?, ?, ?)");
    insert.bind(entry.sequence).bind(entry.bytes).bind_bytes(bytes_of(entry.sha256)).bind_bytes(blob.zstd).run();
  }
}

void write_index(Database& database, const StoreIndex& index) {
  const StoreSummary& summary = index.summary;
  Statement insert_map(database, "INSERT INTO maps VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
  Statement insert_session(database, "INSERT INTO sessions VALUES (?, ?, ?, ?, ?)");
  for (std::size_t place = 0; place < summary.maps.size(); ++place) {
    const StoredMapSummary& map = summary.maps[place];
    insert_map.bind(number(place))
        .bind_text(map.id.str())
        .bind(number(map.nodes))
        .bind(number(map.contents))
        .bind(number(map.submaps));
    insert_map.bind(number(map.constraints))
        .bind(map.first.ns)
        .bind(map.last.ns)
        .bind(map.min_x_m)
        .bind(map.min_y_m)
        .bind(map.max_x_m)
        .bind(map.max_y_m);
    insert_map.bind_bytes(bytes_of(map.content)).bind(number(map.keyframes)).bind(number(map.landmarks)).run();
    for (const SessionSummary& session : map.sessions) {
      insert_session.bind(number(place))
          .bind_text(session.id.client.robot.str())
          .bind_text(session.id.client.sensor.str());
      insert_session.bind(session.id.run).bind(number(session.nodes)).run();
    }
  }
  Statement insert_metadata(database, "INSERT INTO metadata VALUES (?, ?)");
  for (const auto& [key, value] : summary.metadata) {
    MAPWEAVE_EXPECT(is_utf8(key) && is_utf8(value), "metadata are UTF-8: " + key);
    insert_metadata.bind_text(key).bind_text(value).run();
  }
  const Hash hash = index_hash_of(index);
  Statement insert_hash(database, "INSERT INTO seal VALUES (?, ?, ?, ?)");
  insert_hash.bind_bytes(bytes_of(summary.identity))
      .bind(number(summary.judgements))
      .bind(number(summary.verdicts))
      .bind_bytes(bytes_of(hash))
      .run();
}

StoreIndex read_index(Database& database, int schema) {
  StoreIndex index;
  StoreSummary& summary = index.summary;
  summary.schema = schema;
  Statement maps(database, "SELECT * FROM maps ORDER BY place");
  while (maps.step()) {
    if (maps.integer(0) != number(summary.maps.size())) database.corrupt("a map is missing");
    StoredMapSummary map;
    map.id = MapId(name_from(maps.text(1), database));
    map.nodes = count_from(maps.integer(2), database);
    map.contents = count_from(maps.integer(3), database);
    map.submaps = count_from(maps.integer(4), database);
    map.constraints = count_from(maps.integer(5), database);
    map.first.ns = maps.integer(6);
    map.last.ns = maps.integer(7);
    map.min_x_m = maps.real(8);
    map.min_y_m = maps.real(9);
    map.max_x_m = maps.real(10);
    map.max_y_m = maps.real(11);
    map.content = hash_from(maps.bytes(12), database);
    if (schema > 1) {
      map.keyframes = count_from(maps.integer(13), database);
      map.landmarks = count_from(maps.integer(14), database);
    }
    if (!summary.maps.empty() && !(summary.maps.back().id < map.id)) database.corrupt("the maps are not in order");
    summary.maps.push_back(std::move(map));
  }
  const auto map_of = [&](std::int64_t place) -> StoredMapSummary& {
    if (place < 0 || place >= number(summary.maps.size()))
      database.corrupt("it speaks of map " + std::to_string(place) + " of " + std::to_string(summary.maps.size()));
    return summary.maps[static_cast<std::size_t>(place)];
  };
  Statement sessions(database, "SELECT * FROM sessions ORDER BY map, robot, sensor, run_ns");
  while (sessions.step()) {
    const SessionId id{
        {RobotId(name_from(sessions.text(1), database)), SensorId(name_from(sessions.text(2), database))},
        sessions.integer(3)};
    map_of(sessions.integer(0)).sessions.push_back({id, count_from(sessions.integer(4), database)});
  }
  index.updates =
      read_entries(database, "SELECT map, sequence, bytes, length(zstd), sha256 FROM updates ORDER BY map, sequence");
  index.judgements =
      read_entries(database, "SELECT 0, sequence, bytes, length(zstd), sha256 FROM judgements ORDER BY sequence");
  index.verdicts =
      read_entries(database, "SELECT 0, sequence, bytes, length(zstd), sha256 FROM verdicts ORDER BY sequence");
  if (schema >= kSchemaWithMembers)
    index.members =
        read_entries(database, "SELECT map, sequence, bytes, length(zstd), sha256 FROM members ORDER BY map, sequence");
  summary.members = index.members.size();
  for (const BlobEntry& entry : index.members) map_of(entry.owner);
  for (const BlobEntry& entry : index.updates) {
    StoredMapSummary& map = map_of(entry.owner);
    map.bytes += count_from(entry.bytes, database);
    map.stored_bytes += count_from(entry.stored_bytes, database);
  }
  Statement metadata(database, "SELECT key, value FROM metadata ORDER BY key");
  while (metadata.step()) {
    const std::string key = metadata.text(0), value = metadata.text(1);
    if (!is_utf8(key) || !is_utf8(value)) database.corrupt("its metadata are not UTF-8");
    summary.metadata[key] = value;
  }
  Statement stored(database, "SELECT * FROM seal");
  if (!stored.step()) database.corrupt("it was not finished");
  summary.identity = hash_from(stored.bytes(0), database);
  summary.judgements = count_from(stored.integer(1), database);
  summary.verdicts = count_from(stored.integer(2), database);
  if (hash_from(stored.bytes(3), database) != index_hash_of(index))
    database.corrupt("its tables do not match the hash in its table 'seal'");
  return index;
}

std::string read_blob(Database& database, BlobKind kind, const BlobEntry& entry) {
  const char* sql = kind == BlobKind::update       ? "SELECT zstd FROM updates WHERE sequence = ? AND map = ?"
                    : kind == BlobKind::member     ? "SELECT zstd FROM members WHERE sequence = ? AND map = ?"
                    : kind == BlobKind::judgements ? "SELECT zstd FROM judgements WHERE sequence = ?"
                                                   : "SELECT zstd FROM verdicts WHERE sequence = ?";
  Statement row(database, sql);
  row.bind(entry.sequence);
  if (kind == BlobKind::update || kind == BlobKind::member) row.bind(entry.owner);
  if (!row.step()) database.corrupt("a blob is missing");
  return unpack(row.bytes(0), entry.bytes, entry.sha256, database.shown().string());
}

}  // namespace mapweave::mapdb
