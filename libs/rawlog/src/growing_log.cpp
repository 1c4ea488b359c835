#include "log_writer.h"

#include <fcntl.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/rawlog/growing_log.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>
#include <utility>

namespace mapweave::rawlog {
namespace {

Error no_write(const std::filesystem::path& path, const std::string& why) {
  return Error(ErrorCode::kCannotWrite, "the recording cannot be written: " + why, path.string(),
               "make room, or name another file");
}

std::string reason() { return std::generic_category().message(errno); }

}  // namespace

bool has_writer(int file) {
  struct flock lock {};
  lock.l_type = F_RDLCK;
  lock.l_whence = SEEK_SET;
  return ::fcntl(file, F_OFD_GETLK, &lock) == 0 && lock.l_type != F_UNLCK;
}

LogWriterWatch::LogWriterWatch(const std::filesystem::path& path) : file_(::open(path.c_str(), O_RDONLY | O_CLOEXEC)) {}

LogWriterWatch::~LogWriterWatch() {
  if (file_ >= 0) ::close(file_);
}

GrowingLog::GrowingLog(std::filesystem::path path, Begin begin) : path_(std::move(path)) {
  const bool is_new = begin == Begin::new_file;
  std::error_code ignored;
  if (is_new) std::filesystem::create_directories(path_.parent_path(), ignored);
  file_ = ::open(path_.c_str(), O_RDWR | O_CLOEXEC | (is_new ? O_CREAT | O_EXCL : 0), 0644);
  if (file_ < 0 && errno == ENOENT && !is_new)
    throw Error(ErrorCode::kMissing, "there is no recording", path_.string(), "check its path");
  if (file_ < 0 && errno == EEXIST)
    throw Error(ErrorCode::kCannotWrite, "is there already", path_.string(), "move it away, or name another file");
  if (file_ < 0) throw no_write(path_, reason());
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  struct stat found {};
  if (::fcntl(file_, F_OFD_SETLK, &lock) == 0 && ::fstat(file_, &found) == 0) {
    bytes_ = static_cast<std::uint64_t>(found.st_size);
    return;
  }
  ::close(file_);
  throw no_write(path_, "another program writes it");
}

GrowingLog::~GrowingLog() { finish(); }

std::size_t GrowingLog::read_at(std::uint64_t at, char* to, std::size_t count) const {
  const ssize_t got = ::pread(file_, to, count, static_cast<off_t>(at));
  return got < 0 ? 0 : static_cast<std::size_t>(got);
}

void GrowingLog::cut(std::uint64_t bytes) {
  if (::ftruncate(file_, static_cast<off_t>(bytes)) != 0) throw no_write(path_, reason());
  bytes_ = bytes;
}

void GrowingLog::add(std::string_view bytes) {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t put = ::pwrite(file_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(bytes_ + done));
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) throw no_write(path_, reason());
    done += static_cast<std::size_t>(put);
  }
  bytes_ += bytes.size();
}

void GrowingLog::finish() {
  if (file_ >= 0) ::close(std::exchange(file_, -1));
}

bool UnsentMark::is_set() const {
  std::error_code ignored;
  return std::filesystem::exists(path_, ignored);
}

void UnsentMark::set() const {
  std::error_code ignored;
  std::filesystem::create_directories(path_.parent_path(), ignored);
  write_file(path_, "Not all of the recording was sent yet: the robot goes on with it, and removes this file then.\n");
}

void UnsentMark::clear() const {
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

}  // namespace mapweave::rawlog
