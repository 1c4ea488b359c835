#include <mapweave/core/sqlite_file.h>

#include <fcntl.h>
#include <mapweave/core/error.h>
#include <unistd.h>

#include <fstream>
#include <numeric>

namespace mapweave {

namespace fs = std::filesystem;

namespace {

constexpr std::size_t kHeaderBytes = 100;

}

void expect_sqlite_file(const fs::path& path, const std::string& kind, const std::string& ending, bool whole) {
  std::error_code error;
  const auto status = fs::status(path, error);
  const auto corrupt = [&](const std::string& what) {
    return Error(ErrorCode::kCorrupt, what, path.string(), "make it again, or take an undamaged copy");
  };
  if (!fs::exists(status))
    throw Error(ErrorCode::kMissing, "the " + kind + " does not exist", path.string(),
                "check its name; a " + kind + " is kept in a file named *" + ending);
  if (fs::is_directory(status))
    throw Error(ErrorCode::kBadInput, "it is a folder; a " + kind + " is a file", path.string(),
                "name the *" + ending + " file in it");
  if (!fs::is_regular_file(status))
    throw Error(ErrorCode::kBadInput, "it is not a regular file", path.string(), "name a *" + ending + " file");
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw Error(ErrorCode::kMissing, "the " + kind + " cannot be opened", path.string(), "check that you may read it");
  std::string header(kHeaderBytes, '\0');
  file.read(header.data(), static_cast<std::streamsize>(header.size()));
  if (file.gcount() == 0) throw corrupt("it is empty; a " + kind + " is expected");
  if (file.gcount() < static_cast<std::streamsize>(kHeaderBytes) ||
      header.compare(0, 16, std::string("SQLite format 3\0", 16)) != 0)
    throw corrupt("it is no SQLite file; a " + kind + " (" + ending + ") is expected");
  const SqliteFileBytes bytes = sqlite_file_bytes(path);
  if (whole && bytes.is_cut())
    throw corrupt("it is cut short: it needs " + std::to_string(bytes.needed) + " bytes, " +
                  std::to_string(bytes.there) + " are there");
}

SqliteFileBytes sqlite_file_bytes(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::string header(kHeaderBytes, '\0');
  file.read(header.data(), static_cast<std::streamsize>(header.size()));
  const auto big_endian = [&](std::size_t at, std::size_t size) {
    return std::accumulate(header.begin() + static_cast<std::ptrdiff_t>(at),
                           header.begin() + static_cast<std::ptrdiff_t>(at + size), std::uint64_t{0},
                           [](std::uint64_t sum, char byte) { return sum << 8 | static_cast<std::uint8_t>(byte); });
  };
  const std::uint64_t page = big_endian(16, 2) == 1 ? 65536 : big_endian(16, 2);
  std::error_code ignored;
  const auto there = fs::file_size(path, ignored);
  return {ignored ? 0 : there, page * big_endian(28, 4)};
}

bool is_locked(const fs::path& path) {
  constexpr off_t kSharedLock = 0x40000002, kSharedLocks = 510;  // SQLite, os_unix.c: who writes locks these bytes
  const int file = ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);  // of a pipe too
  if (file < 0) return false;
  struct flock lock {};
  lock.l_type = F_RDLCK;
  lock.l_whence = SEEK_SET;
  lock.l_start = kSharedLock;
  lock.l_len = kSharedLocks;
  const bool locked = ::fcntl(file, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
  ::close(file);
  return locked;
}

}  // namespace mapweave
