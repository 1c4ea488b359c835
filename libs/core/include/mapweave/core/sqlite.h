#pragma once
// SQLite with our errors: every failure is thrown as Error, with the file.

#include <mapweave/core/error.h>

#include <filesystem>
#include <string>
#include <string_view>

struct sqlite3;
struct sqlite3_stmt;

namespace mapweave {

class Database {
 public:
  enum class Use { create, append, read, read_with_log, read_cut };
  // create: a new file for one writer. append: the same, or one that is there. read: never writes nor locks, also where
  // the folder or disk is read-only; what the file's schema says is not trusted. read_with_log: as read,
  // of a file with a write-ahead log beside it, which a process that was killed left; needs a folder that may be
  // written. read_cut: as read, of a file that lacks pages at its end: what needs one of them is Error(kCorrupt).
  // `shown`, `kind`: the file that messages speak of, and what it should be.
  Database(const std::filesystem::path& path, Use use, std::filesystem::path shown, const char* kind = "map store");
  ~Database();
  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  void run(const std::string& sql);
  std::int64_t number(const std::string& sql);  // of the first column of the only row
  void close();                                 // throws where the destructor would be silent

  [[noreturn]] void fail(int sqlite_code) const;
  [[noreturn]] void corrupt(const std::string& what) const;
  const std::filesystem::path& shown() const { return shown_; }
  sqlite3* handle() const { return handle_; }

 private:
  sqlite3* handle_ = nullptr;
  Use use_;
  std::filesystem::path shown_;
  std::string kind_;
};

// A prepared statement. Parameters are bound from the left; columns are read from 0, and are of the type asked for, or
// Error(kCorrupt).
class Statement {
 public:
  Statement(Database& database, const char* sql);
  ~Statement();
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  Statement& bind(std::int64_t number);
  Statement& bind(double number);
  Statement& bind_text(std::string_view text);    // must live until run() or the last step()
  Statement& bind_bytes(std::string_view bytes);  // as bind_text
  bool step();  // to the next row; false: there is none, and the statement can be bound again
  void run() {
    while (step()) {}
  }

  std::int64_t integer(int column) const;
  double real(int column) const;
  std::string text(int column) const;
  std::string_view bytes(int column) const;  // until the next step()

 private:
  void require_type(int column, int type) const;
  Database& database_;
  sqlite3_stmt* handle_ = nullptr;
  int bound_ = 0;
};

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
  void commit() {
    database_.run("COMMIT");
    open_ = false;
  }

 private:
  Database& database_;
  bool open_ = true;
};

}  // namespace mapweave
