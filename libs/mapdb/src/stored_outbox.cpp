#include "packed_blob.h"

#include <mapweave/core/sqlite.h>
#include <mapweave/mapdb/stored_outbox.h>

#include <algorithm>
#include <limits>
#include <map>
#include <set>

namespace mapweave::mapdb {
namespace {

constexpr std::int64_t kApplicationId = 0x4d57444f;  // "MWDO"
constexpr std::int64_t kSchema = 1;
constexpr const char* kKind = "outbox";
constexpr const char* kMessageTable =
    "CREATE TABLE messages (position INTEGER PRIMARY KEY, subject TEXT NOT NULL, sender TEXT NOT NULL, sequence "
    "INTEGER "
    "NOT NULL, last_counts INTEGER NOT NULL, bytes INTEGER NOT NULL, sha256 BLOB NOT NULL, zstd BLOB NOT NULL, "
    "UNIQUE (sender, sequence)) STRICT";
constexpr const char* kSenderTable =
    "CREATE TABLE senders (sender TEXT PRIMARY KEY, last INTEGER NOT NULL) STRICT, WITHOUT ROWID";

using Sequence = std::int64_t;  // SQLite has no larger numbers

Sequence sequence_of(std::uint64_t number) {
  return static_cast<Sequence>(std::min<std::uint64_t>(number, std::numeric_limits<Sequence>::max()));
}

}  // namespace

// The messages are in the file alone; what is known of each is in memory, too.
struct StoredOutbox::State {
  using Position = std::int64_t;
  struct Kept {
    std::size_t bytes = 0, plain_bytes = 0;
    std::string sender;
    Sequence sequence = 0;
  };

  Database database;
  std::filesystem::path path;
  std::uint64_t most_bytes = 0;
  std::map<Position, Kept> kept;
  std::map<std::string, std::map<Sequence, Position>> positions;
  std::map<std::string, Sequence> last;
  std::set<Position> due;
  std::map<std::string, Sequence> to_delete;  // up to there, what could not be deleted yet
  std::size_t bytes = 0;

  State(const std::filesystem::path& file, std::uint64_t most)
      : database(file, Database::Use::append, file, kKind), path(file), most_bytes(most) {
    // One process alone, and a commit is on the disk when it returns.
    database.run(
        "PRAGMA locking_mode = EXCLUSIVE; PRAGMA journal_mode = WAL; PRAGMA synchronous = FULL; PRAGMA "
        "journal_size_limit = 16777216");
    Transaction beginning(database);
    if (database.number("SELECT count(*) FROM sqlite_schema") == 0 && database.number("PRAGMA application_id") == 0) {
      database.run("PRAGMA application_id = " + std::to_string(kApplicationId) +
                   "; PRAGMA user_version = " + std::to_string(kSchema));
      database.run(kMessageTable);
      database.run(kSenderTable);
    }
    expect_outbox();
    beginning.commit();
    read();
  }

  void expect_outbox() {
    if (database.number("PRAGMA application_id") != kApplicationId)
      database.corrupt("it is an SQLite file of another program");
    if (const std::int64_t schema = database.number("PRAGMA user_version"); schema > kSchema)
      throw Error(ErrorCode::kUnsupported,
                  "the outbox has schema " + std::to_string(schema) + "; this program knows schemas up to " +
                      std::to_string(kSchema),
                  path.string(), "go on with a newer mapweave, or begin another outbox");
    std::vector<std::string> tables;
    for (Statement found(database, "SELECT sql FROM sqlite_schema WHERE sql IS NOT NULL ORDER BY name"); found.step();)
      tables.push_back(found.text(0));
    if (tables != std::vector<std::string>{kMessageTable, kSenderTable})
      database.corrupt("its tables are not those of an outbox");
  }

  void read() {
    for (Statement rows(database, "SELECT sender, last FROM senders"); rows.step();)
      last[rows.text(0)] = rows.integer(1);
    for (Statement rows(database, "SELECT position, sender, sequence, bytes, length(zstd) FROM messages");
         rows.step();) {
      const Position position = rows.integer(0);
      Kept one{static_cast<std::size_t>(rows.integer(4)), 0, rows.text(1), rows.integer(2)};
      const auto sender = last.find(one.sender);
      if (one.sequence < 1 || rows.integer(3) < 0 || sender == last.end() || one.sequence > sender->second)
        database.corrupt("message " + std::to_string(position) + " has an impossible number or size");
      one.plain_bytes = static_cast<std::size_t>(rows.integer(3));
      add(position, std::move(one));
    }
  }

  void add(Position position, Kept one) {
    bytes += one.bytes;
    positions[one.sender][one.sequence] = position;
    due.insert(position);
    kept.emplace(position, std::move(one));
  }

  // Within a transaction.
  void delete_forgotten() {
    Statement statement(database, "DELETE FROM messages WHERE sender = ? AND sequence <= ?");
    for (const auto& [sender, up_to] : to_delete) statement.bind_text(sender).bind(up_to).run();
  }
  // After it.
  void drop_forgotten() {
    for (const auto& [sender, up_to] : to_delete) {
      const auto known = positions.find(sender);
      if (known == positions.end()) continue;
      auto& numbers = known->second;
      for (auto one = numbers.begin(); one != numbers.end() && one->first <= up_to; one = numbers.erase(one)) {
        const auto there = kept.find(one->second);
        bytes -= there->second.bytes;
        kept.erase(there);
      }
      if (numbers.empty()) positions.erase(known);
    }
    to_delete.clear();
  }

  transport::Envelope message(Position position) {
    Statement row(
        database,
        "SELECT subject, sender, sequence, last_counts, bytes, sha256, zstd FROM messages WHERE position = ?");
    row.bind(position);
    const std::string name = "message " + std::to_string(position);
    if (!row.step()) database.corrupt(name + " is gone");
    const std::optional<Hash> hash = hash_from_column(row.bytes(5));
    if (!hash) database.corrupt(name + " has no valid hash");
    return {row.text(0), unpack(row.bytes(6), row.integer(4), *hash, path.string() + ", " + name), row.text(1),
            static_cast<std::uint64_t>(row.integer(2)), row.integer(3) != 0};
  }
};

StoredOutbox::StoredOutbox(const std::filesystem::path& path, std::uint64_t most_bytes)
    : state_(std::make_unique<State>(path, most_bytes)) {}
StoredOutbox::~StoredOutbox() = default;
StoredOutbox::StoredOutbox(StoredOutbox&&) noexcept = default;
StoredOutbox& StoredOutbox::operator=(StoredOutbox&&) noexcept = default;

bool StoredOutbox::has_room() const { return state_->bytes < state_->most_bytes; }
std::size_t StoredOutbox::bytes() const { return state_->bytes; }

std::uint64_t StoredOutbox::last_number(const std::string& sender) const {
  const auto known = state_->last.find(sender);
  return known == state_->last.end() ? 0 : static_cast<std::uint64_t>(known->second);
}

void StoredOutbox::append(transport::Envelope envelope) {
  MAPWEAVE_EXPECT(envelope.sequence > last_number(envelope.sender) &&
                      envelope.sequence <= static_cast<std::uint64_t>(std::numeric_limits<Sequence>::max()),
                  "what is kept has a number, and numbers rise");
  const PackedBlob blob = pack(envelope.bytes);
  const Sequence sequence = sequence_of(envelope.sequence);
  Transaction transaction(state_->database);
  state_->delete_forgotten();
  Statement(state_->database,
            "INSERT INTO messages (subject, sender, sequence, last_counts, bytes, sha256, zstd) VALUES (?, ?, ?, ?, ?, "
            "?, ?)")
      .bind_text(envelope.subject)
      .bind_text(envelope.sender)
      .bind(sequence)
      .bind(std::int64_t{envelope.last_counts})
      .bind(blob.bytes)
      .bind_bytes(view_of(blob.sha256))
      .bind_bytes(blob.zstd)
      .run();
  const State::Position position = state_->database.number("SELECT last_insert_rowid()");
  Statement(state_->database, "INSERT OR REPLACE INTO senders VALUES (?, ?)")
      .bind_text(envelope.sender)
      .bind(sequence)
      .run();
  transaction.commit();
  state_->drop_forgotten();
  state_->last[envelope.sender] = sequence;
  state_->add(position, {blob.zstd.size(), envelope.bytes.size(), std::move(envelope.sender), sequence});
}

std::vector<transport::Envelope> StoredOutbox::take_due() {
  std::vector<transport::Envelope> taken;
  std::size_t bytes = 0;
  std::vector<State::Position> positions;
  try {
    while (!state_->due.empty()) {
      const State::Position position = *state_->due.begin();
      bytes += state_->kept.at(position).plain_bytes;
      if (!positions.empty() && bytes > kMostDueBytes) break;
      state_->due.erase(position);
      taken.push_back(state_->message(position));
      positions.push_back(position);
    }
  } catch (...) {  // those before it were not handed over
    state_->due.insert(positions.begin(), positions.end());
    throw;
  }
  return taken;
}

void StoredOutbox::repeat(const std::string& sender, std::uint64_t sequence) {
  const auto known = state_->positions.find(sender);
  if (known == state_->positions.end()) return;
  const auto one = known->second.find(sequence_of(sequence));
  const auto forgotten = state_->to_delete.find(sender);
  if (one == known->second.end() || (forgotten != state_->to_delete.end() && one->first <= forgotten->second)) return;
  state_->due.insert(one->second);
}

void StoredOutbox::repeat_all() {
  for (const auto& [sender, numbers] : state_->positions)
    for (const auto& [sequence, position] : numbers) repeat(sender, static_cast<std::uint64_t>(sequence));
}

void StoredOutbox::forget(const std::string& sender, std::uint64_t up_to) {
  const auto known = state_->positions.find(sender);
  if (known == state_->positions.end() || known->second.begin()->first > sequence_of(up_to)) return;
  for (auto one = known->second.begin(); one != known->second.end() && one->first <= sequence_of(up_to); ++one)
    state_->due.erase(one->second);
  Sequence& most = state_->to_delete[sender];
  most = std::max(most, sequence_of(up_to));
  try {
    Transaction transaction(state_->database);
    state_->delete_forgotten();
    transaction.commit();
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kCannotWrite) throw;
    return;
  }
  state_->drop_forgotten();
}

}  // namespace mapweave::mapdb
