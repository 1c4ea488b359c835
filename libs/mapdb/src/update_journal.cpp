#include "packed_blob.h"

#include <mapweave/core/sqlite.h>
#include <mapweave/core/sqlite_file.h>
#include <mapweave/mapdb/update_journal.h>

#include <stdlib.h>

#include <cerrno>
#include <optional>
#include <system_error>

namespace mapweave::mapdb {
namespace {

constexpr std::int64_t kApplicationId = 0x4d57444a;  // "MWDJ"
constexpr std::int64_t kSchema = 2;
constexpr const char* kKind = "journal";
constexpr const char* kTable =
    "CREATE TABLE updates (number INTEGER PRIMARY KEY, robot TEXT NOT NULL, sensor TEXT NOT NULL, run INTEGER NOT "
    "NULL, bytes INTEGER NOT "
    "NULL, sha256 BLOB NOT NULL, zstd BLOB NOT NULL) STRICT";

constexpr const char* kVetoTable =
    "CREATE TABLE vetoes (judgement BLOB PRIMARY KEY) STRICT, WITHOUT ROWID";  // from schema 2 on

// A journal and its write-ahead log in a folder of their own, until the end.
class Copy {
 public:
  explicit Copy(const std::filesystem::path& journal) {
    std::error_code error;
    folder_ = (std::filesystem::temp_directory_path(error) / "mapweave-XXXXXX").string();
    if (!error && ::mkdtemp(folder_.data()) == nullptr)
      error = std::error_code(errno, std::generic_category());
    else
      for (const char* suffix : {"", "-wal"})
        if (!error) std::filesystem::copy_file(journal.string() + suffix, path().string() + suffix, error);
    if (!error) return;
    remove();
    throw Error(ErrorCode::kCannotWrite, "the journal of a server that was killed cannot be copied: " + error.message(),
                folder_, "free some space, or name another folder in TMPDIR");
  }
  ~Copy() { remove(); }
  Copy(const Copy&) = delete;
  Copy& operator=(const Copy&) = delete;
  std::filesystem::path path() const { return std::filesystem::path(folder_) / "copy.mwj"; }

 private:
  void remove() const {
    std::error_code ignored;
    std::filesystem::remove_all(folder_, ignored);
  }
  std::string folder_;
};

}  // namespace

struct UpdateJournal::State {
  std::optional<Copy> copy;
  Database database;
  std::filesystem::path path;
  std::uint64_t bytes = 0;

  explicit State(const std::filesystem::path& file) : database(file, Database::Use::append, file, kKind), path(file) {
    begin();
  }
  // To read it alone.
  State(const std::filesystem::path& file, bool has_log)
      : copy(has_log ? std::make_optional<Copy>(file) : std::nullopt),
        database(copy ? copy->path() : file, copy ? Database::Use::append : Database::Use::read, file, kKind),
        path(file) {
    expect_journal();
  }

  void begin() {
    // One process alone, and a commit is on the disk when it returns.
    database.run("PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL");
    Transaction beginning(database);
    if (database.number("SELECT count(*) FROM sqlite_schema") == 0 && database.number("PRAGMA application_id") == 0) {
      database.run("PRAGMA application_id = " + std::to_string(kApplicationId) +
                   "; PRAGMA user_version = " + std::to_string(kSchema));
      database.run(kTable);
      database.run(kVetoTable);
    } else if (database.number("PRAGMA application_id") == kApplicationId && !has_vetoes()) {
      database.run(std::string(kVetoTable) + "; PRAGMA user_version = " + std::to_string(kSchema));
    }
    expect_journal();
    beginning.commit();
  }

  void expect_journal() {
    if (database.number("PRAGMA application_id") != kApplicationId)
      database.corrupt("it is an SQLite file of another program");
    if (const std::int64_t schema = database.number("PRAGMA user_version"); schema > kSchema)
      throw Error(ErrorCode::kUnsupported,
                  "the journal has schema " + std::to_string(schema) + "; this program knows schemas up to " +
                      std::to_string(kSchema),
                  path.string(), "go on with a newer mapweave, or begin another journal");
    std::vector<std::string> tables, expected{kTable};
    if (has_vetoes()) expected.push_back(kVetoTable);
    for (Statement found(database, "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name"); found.step();)
      tables.push_back(found.text(0));
    if (tables != expected) database.corrupt("its tables are not those of a journal");
    bytes = static_cast<std::uint64_t>(database.number("SELECT coalesce(sum(length(zstd)), 0) FROM updates"));
  }

  bool has_vetoes() { return database.number("PRAGMA user_version") != 1; }  // those of schema 1 had none

  std::uint64_t insert(const std::vector<JournalEntry>& entries) {
    std::uint64_t inserted = 0;
    Statement statement(database,
                        "INSERT INTO updates (robot, sensor, run, bytes, sha256, zstd) VALUES (?, ?, ?, ?, ?, ?)");
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
UpdateJournal::UpdateJournal(std::unique_ptr<State> state) : state_(std::move(state)) {}
UpdateJournal::~UpdateJournal() = default;
UpdateJournal::UpdateJournal(UpdateJournal&&) noexcept = default;
UpdateJournal& UpdateJournal::operator=(UpdateJournal&&) noexcept = default;

UpdateJournal UpdateJournal::left_behind(const std::filesystem::path& path) {
  if (is_locked(path))
    throw Error(ErrorCode::kBadInput, "a server has it open", path.string(),
                "end that one first, or take a copy that it left behind");
  const auto files = files_of(path);
  expect_sqlite_file(path, kKind, ".mwj", files.size() == 1);
  return UpdateJournal(std::make_unique<State>(path, files.size() > 1));
}

std::vector<std::filesystem::path> UpdateJournal::files_of(const std::filesystem::path& path) {
  const std::filesystem::path log = path.string() + "-wal";
  std::error_code error;
  const auto bytes = std::filesystem::file_size(log, error);
  return !error && bytes > 0 ? std::vector{path, log} : std::vector{path};
}

void UpdateJournal::append(const std::vector<JournalEntry>& entries) {
  if (entries.empty()) return;
  Transaction transaction(state_->database);
  const std::uint64_t inserted = state_->insert(entries);
  transaction.commit();
  state_->bytes += inserted;
}

void UpdateJournal::replay(const std::function<void(const JournalEntry&)>& visit) {
  if (state_->has_vetoes())
    for (Statement vetoes(state_->database, "SELECT judgement FROM vetoes ORDER BY judgement"); vetoes.step();) {
      const std::optional<Hash> judgement = hash_from_column(vetoes.bytes(0));
      if (!judgement) state_->database.corrupt("a veto of it names no judgement");
      visit({{}, {}, judgement});
    }
  Statement rows(state_->database,
                 "SELECT number, robot, sensor, run, bytes, sha256, zstd FROM updates ORDER BY number");
  while (rows.step()) {
    const std::string where = state_->path.string() + ", update " + std::to_string(rows.integer(0));
    const std::string robot = rows.text(1), sensor = rows.text(2);
    const std::optional<Hash> hash = hash_from_column(rows.bytes(5));
    if (!is_valid_name(robot) || !is_valid_name(sensor) || !hash)
      state_->database.corrupt("update " + std::to_string(rows.integer(0)) + " has no valid name or hash");
    visit(
        {{{RobotId(robot), SensorId(sensor)}, rows.integer(3)}, unpack(rows.bytes(6), rows.integer(4), *hash, where)});
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
