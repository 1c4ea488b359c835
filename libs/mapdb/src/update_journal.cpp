#include "packed_blob.h"
#include "sqlite.h"

#include <mapweave/mapdb/update_journal.h>

#include <algorithm>

namespace mapweave::mapdb {
namespace {

constexpr std::int64_t kApplicationId = 0x4d57444a;  // "MWDJ"
constexpr std::int64_t kSchema = 2;
constexpr const char* kTable =
    "CREATE TABLE updates (number INTEGER PRIMARY KEY, robot TEXT NOT NULL, sensor TEXT NOT NULL, run INTEGER NOT NULL, bytes INTEGER NOT "
    "NULL, sha256 BLOB NOT NULL, zstd BLOB NOT NULL) STRICT";

constexpr const char* kVetoTable = "CREATE TABLE vetoes (judgement BLOB PRIMARY KEY) STRICT, WITHOUT ROWID";  // from schema 2 on

std::string_view view_of(const Hash& hash) { return {reinterpret_cast<const char*>(hash.bytes.data()), hash.bytes.size()}; }

std::optional<Hash> hash_of(std::string_view bytes) {
  Hash hash;
  if (bytes.size() != hash.bytes.size()) return std::nullopt;
  std::copy(bytes.begin(), bytes.end(), hash.bytes.begin());
  return hash;
}

// Undone unless it is committed.
class Transaction {
 public:
  explicit Transaction(Database& database) : database_(database) { database_.run("BEGIN IMMEDIATE"); }
  ~Transaction() {
    if (open_) try {
        database_.run("ROLLBACK");
      } catch (const Error&) {  // SQLite has rolled back itself
      }
  }
  void commit() { database_.run("COMMIT"), open_ = false; }

 private:
  Database& database_;
  bool open_ = true;
};

}  // namespace

struct UpdateJournal::State {
  Database database;
  std::filesystem::path path;
  std::uint64_t bytes = 0;

  explicit State(const std::filesystem::path& file) : database(file, Database::Use::append, file), path(file) {
    // One process alone, and a commit is on the disk when it returns.
    database.run("PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL");
    Transaction beginning(database);
    if (database.number("SELECT count(*) FROM sqlite_schema") == 0 && database.number("PRAGMA application_id") == 0) {
      database.run("PRAGMA application_id = " + std::to_string(kApplicationId) + "; PRAGMA user_version = " + std::to_string(kSchema));
      database.run(kTable), database.run(kVetoTable);
    }
    if (database.number("PRAGMA application_id") != kApplicationId) database.corrupt("it is an SQLite file of another program");
    if (const std::int64_t schema = database.number("PRAGMA user_version"); schema > kSchema)
      throw Error(ErrorCode::kUnsupported,
                  "the journal has schema " + std::to_string(schema) + "; this program knows schemas up to " + std::to_string(kSchema),
                  file.string(), "go on with a newer mapweave, or begin another journal");
    if (database.number("PRAGMA user_version") == 1)
      database.run(std::string(kVetoTable) + "; PRAGMA user_version = " + std::to_string(kSchema));
    std::vector<std::string> tables;
    for (Statement found(database, "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name"); found.step();)
      tables.push_back(found.text(0));
    if (tables != std::vector<std::string>{kTable, kVetoTable}) database.corrupt("its tables are not those of a journal");
    bytes = static_cast<std::uint64_t>(database.number("SELECT coalesce(sum(length(zstd)), 0) FROM updates"));
    beginning.commit();
  }

  std::uint64_t insert(const std::vector<JournalEntry>& entries) {
    std::uint64_t inserted = 0;
    Statement statement(database, "INSERT INTO updates (robot, sensor, run, bytes, sha256, zstd) VALUES (?, ?, ?, ?, ?, ?)");
    for (const JournalEntry& entry : entries) {
      if (entry.vetoed) {
        Statement(database, "INSERT OR IGNORE INTO vetoes VALUES (?)").bind_bytes(view_of(*entry.vetoed)).run();
        continue;
      }
      const PackedBlob blob = pack(entry.update);
      statement.bind_text(entry.from.client.robot.str()).bind_text(entry.from.client.sensor.str()).bind(entry.from.run);
      statement.bind(blob.bytes).bind_bytes(view_of(blob.sha256)).bind_bytes(blob.zstd).run();
      inserted += blob.zstd.size();
    }
    return inserted;
  }
};

UpdateJournal::UpdateJournal(const std::filesystem::path& path) : state_(new State(path)) {}
UpdateJournal::~UpdateJournal() = default;
UpdateJournal::UpdateJournal(UpdateJournal&&) noexcept = default;
UpdateJournal& UpdateJournal::operator=(UpdateJournal&&) noexcept = default;

void UpdateJournal::append(const std::vector<JournalEntry>& entries) {
  if (entries.empty()) return;
  Transaction transaction(state_->database);
  const std::uint64_t inserted = state_->insert(entries);
  transaction.commit();
  state_->bytes += inserted;
}

void UpdateJournal::replay(const std::function<void(const JournalEntry&)>& visit) {
  for (Statement vetoes(state_->database, "SELECT judgement FROM vetoes ORDER BY judgement"); vetoes.step();) {
    const std::optional<Hash> judgement = hash_of(vetoes.bytes(0));
    if (!judgement) state_->database.corrupt("a veto of it names no judgement");
    visit({{}, {}, judgement});
  }
  Statement rows(state_->database, "SELECT number, robot, sensor, run, bytes, sha256, zstd FROM updates ORDER BY number");
  while (rows.step()) {
    const std::string where = state_->path.string() + ", update " + std::to_string(rows.integer(0));
    const std::string robot = rows.text(1), sensor = rows.text(2);
    const std::optional<Hash> hash = hash_of(rows.bytes(5));
    if (!is_valid_name(robot) || !is_valid_name(sensor) || !hash)
      state_->database.corrupt("update " + std::to_string(rows.integer(0)) + " has no valid name or hash");
    visit({{{RobotId(robot), SensorId(sensor)}, rows.integer(3)}, unpack(rows.bytes(6), rows.integer(4), *hash, where)});
  }
}

void UpdateJournal::replace(const std::vector<JournalEntry>& entries) {
  Transaction transaction(state_->database);
  state_->database.run("DELETE FROM updates; DELETE FROM vetoes");
  const std::uint64_t inserted = state_->insert(entries);
  transaction.commit();
  state_->bytes = inserted;
  state_->database.run("PRAGMA wal_checkpoint(TRUNCATE)");
}

std::uint64_t UpdateJournal::bytes() const { return state_->bytes; }

}  // namespace mapweave::mapdb
