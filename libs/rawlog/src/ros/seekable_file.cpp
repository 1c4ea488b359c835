#include "seekable_file.h"

#include "../log_writer.h"

#include <fcntl.h>
#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <system_error>
#include <thread>
#include <utility>

namespace mapweave::rawlog::ros {
namespace {

Error no_access(const std::filesystem::path& path) {
  return Error(ErrorCode::kMissing, "cannot be read: " + std::generic_category().message(errno), path.string(),
               "check the path, and that you may read it");
}

}  // namespace

SeekableFile::SeekableFile(std::filesystem::path path) : path_(std::move(path)) {
  number_ = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK);
  if (number_ < 0) throw no_access(path_);
  struct stat found {};
  const bool is_known = ::fstat(number_, &found) == 0;
  bytes_ = is_known ? static_cast<std::uint64_t>(found.st_size) : 0;
  if (is_known && S_ISREG(found.st_mode) && bytes_ > 0) return;
  const Error error =
      !is_known ? no_access(path_)
      : S_ISREG(found.st_mode)
          ? Error(ErrorCode::kBadInput, "is empty (0 bytes); a recording was expected", path_.string(), "record again")
          : Error(ErrorCode::kBadInput, "is no file that can be read at any place; one was expected", path_.string(),
                  "name a file; save what a pipe brings to one first");
  ::close(number_);
  throw error;
}

SeekableFile::~SeekableFile() { ::close(number_); }

bool SeekableFile::read_at(std::uint64_t offset, void* to, std::size_t count) const {
  if (offset > bytes_ || count > bytes_ - offset) return false;
  auto* place = static_cast<char*>(to);
  while (count > 0) {
    const ssize_t got = ::pread(number_, place, count, static_cast<off_t>(offset));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) throw no_access(path_);
    if (got == 0) return false;  // it became shorter
    place += got;
    offset += static_cast<std::uint64_t>(got);
    count -= static_cast<std::size_t>(got);
  }
  return true;
}

bool SeekableFile::look_again() {
  const bool is_written = has_writer(number_);
  struct stat found {};
  if (::fstat(number_, &found) == 0) bytes_ = std::max(bytes_, static_cast<std::uint64_t>(found.st_size));
  return is_written;
}

void SeekableFile::await(std::uint64_t bytes) {
  constexpr std::chrono::milliseconds kBetweenLooks{5};
  while (bytes_ < bytes && look_again() && bytes_ < bytes) {
    throw_if_interrupted();
    std::this_thread::sleep_for(kBetweenLooks);
  }
}

std::string SeekableFile::place(std::uint64_t offset) const {
  return path_.string() + " at byte " + std::to_string(offset);
}

}  // namespace mapweave::rawlog::ros
