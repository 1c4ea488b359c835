#include "sqlite_whole_pages.h"

#include <sqlite3.h>

#include <array>
#include <new>

namespace mapweave {
namespace {

constexpr const char* kName = "mapweave-whole-pages";

// Those of the file, but for its size and its end.
struct Methods : sqlite3_io_methods {
  const sqlite3_io_methods* given = nullptr;
};

const sqlite3_io_methods& given_methods(sqlite3_file* file) {
  return *static_cast<const Methods*>(file->pMethods)->given;
}

int whole_size(sqlite3_file* file, sqlite3_int64* bytes) {
  constexpr sqlite3_int64 kPageSizeAt = 16, kLeastPage = 512, kMostPage = 65536;  // the most is written as 1
  const int code = given_methods(file).xFileSize(file, bytes);
  std::array<unsigned char, 2> digits{};
  if (code != SQLITE_OK || given_methods(file).xRead(file, digits.data(), 2, kPageSizeAt) != SQLITE_OK) return code;
  const sqlite3_int64 page = digits[0] << 8 | digits[1];
  if (page == 1 || page >= kLeastPage) *bytes -= *bytes % (page == 1 ? kMostPage : page);
  return code;
}

int close_file(sqlite3_file* file) {
  const auto* methods = static_cast<const Methods*>(file->pMethods);
  const int code = methods->given->xClose(file);
  delete methods;
  return code;
}

int open_file(sqlite3_vfs*, const char* name, sqlite3_file* file, int flags, int* flags_then) {
  sqlite3_vfs* plain = sqlite3_vfs_find(nullptr);
  const int code = plain->xOpen(plain, name, file, flags, flags_then);
  if (file->pMethods == nullptr) return code;
  auto* methods = new (std::nothrow) Methods;
  if (methods == nullptr) {
    file->pMethods->xClose(file);
    file->pMethods = nullptr;
    return SQLITE_NOMEM;
  }
  static_cast<sqlite3_io_methods&>(*methods) = *file->pMethods;
  methods->given = file->pMethods;
  methods->xFileSize = whole_size;
  methods->xClose = close_file;
  file->pMethods = methods;
  return code;
}

}  // namespace

const char* whole_pages_of_files() {
  static sqlite3_vfs files = [] {
    sqlite3_initialize();
    sqlite3_vfs made = *sqlite3_vfs_find(nullptr);
    made.pNext = nullptr;
    made.zName = kName;
    made.xOpen = open_file;
    return made;
  }();
  static const int registered = sqlite3_vfs_register(&files, 0);
  return registered == SQLITE_OK ? kName : nullptr;
}

}  // namespace mapweave
