#include "sqlite_whole_pages.h"

#include <mapweave/core/sqlite.h>
#include <sqlite3.h>

#include <cerrno>
#include <new>
#include <system_error>
#include <utility>

namespace mapweave {
namespace {

constexpr int kMostBytes = 1 << 30;  // of a text, a blob or a row

// As SQLite wants it to open a file in a certain way: RFC 3986.
std::string file_uri(const std::filesystem::path& path, const std::string& query) {
  constexpr char kDigits[] = "0123456789ABCDEF";
  std::string uri = "file://";
  for (const char letter : std::filesystem::absolute(path).string()) {
    const auto byte = static_cast<unsigned char>(letter);
    const bool is_plain = (byte >= 'a' && byte <= 'z') || (byte >= 'A' && byte <= 'Z') ||
                          (byte >= '0' && byte <= '9') || byte == '/' || byte == '.' || byte == '_' || byte == '-';
    if (is_plain)
      uri += letter;
    else
      uri += {'%', kDigits[byte >> 4], kDigits[byte & 15]};
  }
  return uri + "?" + query;
}

}  // namespace

Database::Database(const std::filesystem::path& path, Use use, std::filesystem::path shown, const char* kind)
    : use_(use), shown_(std::move(shown)), kind_(kind) {
  const bool is_new = use == Use::create || use == Use::append;
  const int flags = is_new ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE : SQLITE_OPEN_READONLY | SQLITE_OPEN_URI;
  const std::string name = is_new ? std::filesystem::absolute(path).string()
                                  : file_uri(path, use == Use::read_with_log ? "mode=ro" : "mode=ro&immutable=1");
  if (const int code = sqlite3_open_v2(name.c_str(), &handle_, flags | SQLITE_OPEN_NOMUTEX,
                                       use == Use::read_cut ? whole_pages_of_files() : nullptr);
      code != SQLITE_OK) {
    try {
      fail(code);
    } catch (...) {
      sqlite3_close(handle_);
      throw;
    }
  }
  sqlite3_extended_result_codes(handle_, 1);
  sqlite3_limit(handle_, SQLITE_LIMIT_LENGTH, kMostBytes);
  sqlite3_db_config(handle_, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  // SQLite opens a file that lacks pages only where its schema could be mended. That one is never written.
  if (use == Use::read_cut)
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_WRITABLE_SCHEMA, 1, nullptr);
  else
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
}

Database::~Database() { sqlite3_close_v2(handle_); }

void Database::close() {
  if (const int code = sqlite3_close(handle_); code != SQLITE_OK) fail(code);
  handle_ = nullptr;
}

void Database::fail(int sqlite_code) const {
  const int system = handle_ == nullptr ? 0 : sqlite3_system_errno(handle_);
  const std::string words = handle_ == nullptr ? sqlite3_errstr(sqlite_code) : sqlite3_errmsg(handle_);
  const int primary = sqlite_code & 0xff;
  const bool writes = use_ == Use::create || use_ == Use::append;
  // Damaged files are seen to ask for any amount of memory.
  if (primary == SQLITE_NOMEM && !writes) corrupt("it asks for more memory than can be had");
  if (primary == SQLITE_NOMEM) throw std::bad_alloc();
  if (use_ == Use::append && (primary == SQLITE_NOTADB || primary == SQLITE_CORRUPT)) corrupt(words);
  if (primary == SQLITE_BUSY || primary == SQLITE_LOCKED)
    throw Error(ErrorCode::kBadInput, "another process has it open", shown_.string(),
                "end that one first, or choose another file");
  if (writes) {
    if (primary != SQLITE_FULL && system != ENOSPC && system != EDQUOT)
      throw Error(ErrorCode::kCannotWrite,
                  "the " + kind_ + " cannot be written: " + words +
                      (system == 0 ? std::string() : " (" + std::generic_category().message(system) + ")"),
                  shown_.string(), "check that the folder exists and that you may write there");
    std::error_code ignored;
    const auto space = std::filesystem::space(std::filesystem::absolute(shown_).parent_path(), ignored);
    throw Error(
        ErrorCode::kCannotWrite,
        "the disk is full" + (ignored ? std::string() : " (" + std::to_string(space.available) + " bytes free)"),
        shown_.string(), "free some space or choose another folder");
  }
  if (use_ == Use::read_with_log && (primary == SQLITE_CANTOPEN || primary == SQLITE_READONLY))
    throw Error(
        ErrorCode::kBadInput,
        "the program that wrote it was ended in the midst, and what lies beside it (-wal or -journal) cannot be "
        "used here: " +
            words,
        shown_.string(), "copy it with the files beside it to a folder where you may write");
  if (primary == SQLITE_CANTOPEN || primary == SQLITE_PERM || primary == SQLITE_AUTH)
    throw Error(ErrorCode::kMissing, "the " + kind_ + " cannot be opened: " + words, shown_.string(),
                "check that you may read it");
  corrupt(words);
}

void Database::corrupt(const std::string& what) const {
  throw Error(ErrorCode::kCorrupt, "this is no " + kind_ + ", or it is damaged: " + what, shown_.string(),
              "make it again, or take an undamaged copy");
}

void Database::run(const std::string& sql) {
  if (const int code = sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr); code != SQLITE_OK) fail(code);
}

std::int64_t Database::number(const std::string& sql) {
  Statement statement(*this, sql.c_str());
  if (!statement.step()) corrupt("it does not answer '" + sql + "'");
  return statement.integer(0);
}

Statement::Statement(Database& database, const char* sql) : database_(database) {
  if (const int code = sqlite3_prepare_v2(database.handle(), sql, -1, &handle_, nullptr); code != SQLITE_OK)
    database.fail(code);
}

Statement::~Statement() { sqlite3_finalize(handle_); }

Statement& Statement::bind(std::int64_t number) {
  if (const int code = sqlite3_bind_int64(handle_, ++bound_, number); code != SQLITE_OK) database_.fail(code);
  return *this;
}

Statement& Statement::bind(double number) {
  if (const int code = sqlite3_bind_double(handle_, ++bound_, number); code != SQLITE_OK) database_.fail(code);
  return *this;
}

Statement& Statement::bind_text(std::string_view text) {
  const int code =
      sqlite3_bind_text64(handle_, ++bound_, text.empty() ? "" : text.data(), text.size(), nullptr, SQLITE_UTF8);
  if (code != SQLITE_OK) database_.fail(code);
  return *this;
}

Statement& Statement::bind_bytes(std::string_view bytes) {
  const int code = sqlite3_bind_blob64(handle_, ++bound_, bytes.empty() ? "" : bytes.data(), bytes.size(), nullptr);
  if (code != SQLITE_OK) database_.fail(code);
  return *this;
}

bool Statement::step() {
  const int code = sqlite3_step(handle_);
  if (code == SQLITE_ROW) return true;
  if (code != SQLITE_DONE) database_.fail(code);
  sqlite3_reset(handle_);
  sqlite3_clear_bindings(handle_);
  bound_ = 0;
  return false;
}

std::int64_t Statement::integer(int column) const {
  require_type(column, SQLITE_INTEGER);
  return sqlite3_column_int64(handle_, column);
}

double Statement::real(int column) const {
  require_type(column, SQLITE_FLOAT);
  return sqlite3_column_double(handle_, column);
}

std::string Statement::text(int column) const {
  require_type(column, SQLITE_TEXT);
  const auto* letters = reinterpret_cast<const char*>(sqlite3_column_text(handle_, column));
  if (letters == nullptr) database_.fail(sqlite3_errcode(database_.handle()));
  return {letters, static_cast<std::size_t>(sqlite3_column_bytes(handle_, column))};
}

std::string_view Statement::bytes(int column) const {
  require_type(column, SQLITE_BLOB);
  const auto* data = static_cast<const char*>(sqlite3_column_blob(handle_, column));
  const int size = sqlite3_column_bytes(handle_, column);
  if (data == nullptr && size > 0) database_.fail(sqlite3_errcode(database_.handle()));
  return {data, static_cast<std::size_t>(size)};
}

void Statement::require_type(int column, int type) const {
  if (sqlite3_column_type(handle_, column) != type)
    database_.corrupt("column '" + std::string(sqlite3_column_name(handle_, column)) + "' holds another type");
}

}  // namespace mapweave
