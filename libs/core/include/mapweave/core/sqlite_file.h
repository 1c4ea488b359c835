#pragma once
// A file before SQLite looks at it.

#include <cstdint>
#include <filesystem>
#include <string>

namespace mapweave {

// `kind`: what it should be ("map store"); `ending`: how such files are named (".mwdb"). Throws Error: kMissing for
// what is not there or cannot be read, kBadInput for a folder or another kind of file, kCorrupt for what is no SQLite
// file, or cut short. whole: it is cut short where it lacks pages that its header counts; off for one with a
// write-ahead log beside it.
void expect_sqlite_file(const std::filesystem::path& path, const std::string& kind, const std::string& ending,
                        bool whole = true);

// How many bytes an SQLite file has, and how many its header counts. Of another file `needed` means nothing.
struct SqliteFileBytes {
  std::uint64_t there = 0, needed = 0;
  bool is_cut() const { return there < needed; }
};
SqliteFileBytes sqlite_file_bytes(const std::filesystem::path& path);

// Whether a process has it open to write, this one too; that must not have it open afterwards: on Linux, looking at it
// undoes its lock.
bool is_locked(const std::filesystem::path& path);

}  // namespace mapweave
