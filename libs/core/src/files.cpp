#include <fcntl.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>
#include <poll.h>
#include <signal.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <system_error>
#include <utility>

namespace mapweave {
namespace {

namespace fs = std::filesystem;

constexpr char kPartial[] = ".partial-";
constexpr int kWriterComes_ms = 1000;

std::string text_of(int error_number) { return std::generic_category().message(error_number); }

fs::path folder_of(const fs::path& path) { return path.has_parent_path() ? path.parent_path() : fs::path("."); }

[[noreturn]] void throw_cannot_write(const fs::path& path, const std::string& what, int error_number) {
  std::string remedy = "check that the folder exists and that you may write there";
  std::string problem = what + ": " + text_of(error_number);
  if (error_number == ENOSPC || error_number == EDQUOT) {
    std::error_code ignored;
    const auto space = fs::space(folder_of(path), ignored);
    if (!ignored) problem += " (" + std::to_string(space.available) + " bytes free)";
    remedy = "free some space or choose another folder";
  }
  throw Error(ErrorCode::kCannotWrite, problem, path.string(), remedy);
}

class Descriptor {
 public:
  explicit Descriptor(int number) : number_(number) {}
  ~Descriptor() { close(); }
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  explicit operator bool() const { return number_ >= 0; }
  int number() const { return number_; }
  int close() { return number_ < 0 ? 0 : ::close(std::exchange(number_, -1)); }

 private:
  int number_;
};

// Some file systems cannot sync folders; that is no reason to fail.
void sync_folder(const fs::path& folder) {
  const Descriptor descriptor(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (descriptor) ::fsync(descriptor.number());
}

void sync_tree(const fs::path& folder) {
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_directory() && !entry.is_symlink()) sync_folder(entry.path());
    if (!entry.is_regular_file() || entry.is_symlink()) continue;
    const Descriptor descriptor(::open(entry.path().c_str(), O_RDONLY | O_CLOEXEC));
    if (descriptor && ::fsync(descriptor.number()) != 0 && errno != EINVAL)
      throw_cannot_write(entry.path(), "cannot be written", errno);
  }
  sync_folder(folder);
}

bool is_empty_folder(const fs::path& path) { return fs::is_directory(path) && fs::is_empty(path); }

// Locked by the process that builds the folder. A folder without a lock whose maker is gone (or had our number: numbers
// return after a restart of a container) is left over from a crash.
// Where another process builds the folder, it is refused.
void expect_alone(const fs::path& goal) {
  const std::string prefix = goal.filename().string() + kPartial;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder_of(goal), ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.compare(0, prefix.size(), prefix) != 0 || !entry.is_directory(ignored) || entry.is_symlink(ignored))
      continue;
    const std::string digits = name.substr(prefix.size());
    if (digits.empty() || digits.size() > 9 || digits.find_first_not_of("0123456789") != std::string::npos) continue;
    const int process = std::stoi(digits);
    const bool gone = process == ::getpid() || (::kill(process, 0) != 0 && errno == ESRCH);
    const Descriptor lock(::open(entry.path().c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (!lock) continue;
    const bool is_free = ::flock(lock.number(), LOCK_EX | LOCK_NB) == 0;
    if (gone && is_free) fs::remove_all(entry.path(), ignored);
    if (!gone && !is_free && errno == EWOULDBLOCK)
      throw Error(ErrorCode::kCannotWrite, "another run (process " + digits + ") is writing its results there",
                  goal.string(), "wait for its end, or choose another folder");
  }
}

}  // namespace

bool is_file(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

bool is_folder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

ReadableFile::ReadableFile(fs::path path) : path_(std::move(path)) {
  const auto fail = [this](const std::string& what, const std::string& remedy) {
    if (number_ >= 0) ::close(number_);
    throw Error(ErrorCode::kMissing, what, path_.string(), remedy);
  };
  struct stat status {};
  if (::stat(path_.c_str(), &status) != 0) fail("cannot be read: " + text_of(errno), "check the path");
  if (S_ISDIR(status.st_mode)) fail("is a folder, not a file", "name the file in it");
  bytes_ = static_cast<std::uint64_t>(status.st_size);
  const bool is_pipe = S_ISFIFO(status.st_mode);
  number_ = ::open(path_.c_str(), O_RDONLY | O_CLOEXEC | (is_pipe ? O_NONBLOCK : 0));
  if (number_ < 0) fail("cannot be read: " + text_of(errno), "check its permissions");
  pollfd ready{number_, POLLIN, 0};
  char first = 0;
  if (!is_pipe || ::poll(&ready, 1, kWriterComes_ms) > 0) return;
  // Nothing came. A pipe with a writer answers that nothing is there yet, one without any answers its end.
  const ssize_t got = ::read(number_, &first, 1);
  if (got == 0) fail("is a pipe that nobody writes to", "name a file, or begin the program that writes first");
  if (got == 1) first_ = first;
}

ReadableFile::~ReadableFile() { ::close(number_); }

std::size_t ReadableFile::read(char* to, std::size_t count) {
  if (first_ && count > 0) {
    *to = *std::exchange(first_, std::nullopt);
    return 1;
  }
  for (;;) {
    const ssize_t got = ::read(number_, to, count);
    if (got >= 0) return static_cast<std::size_t>(got);
    if (errno != EINTR && errno != EAGAIN)
      throw Error(ErrorCode::kMissing, "reading stopped before the end of the file: " + text_of(errno), path_.string(),
                  "check the disk");
    pollfd ready{number_, POLLIN, 0};
    if (errno == EAGAIN) ::poll(&ready, 1, kWriterComes_ms);
    throw_if_interrupted();
  }
}

bool ReadableFile::rewind() { return ::lseek(number_, 0, SEEK_SET) == 0; }

std::string read_file(const fs::path& path, std::uint64_t most_bytes) {
  ReadableFile file(path);
  std::string bytes;
  constexpr std::size_t kBlock = 1 << 16;
  for (std::size_t got = 1; got > 0;) {
    const std::size_t before = bytes.size();
    bytes.resize(before + kBlock);
    got = file.read(&bytes[before], kBlock);
    bytes.resize(before + got);
    if (bytes.size() > most_bytes) {
      throw Error(ErrorCode::kBadInput,
                  "is larger than the " + std::to_string(most_bytes) + " bytes that such a file may have",
                  path.string());
    }
  }
  return bytes;
}

void write_file(const fs::path& path, std::string_view bytes) {
  static std::atomic<unsigned> count{0};
  fs::path partial = path;
  partial += kPartial + std::to_string(::getpid()) + "-" + std::to_string(count++);
  Descriptor file(::open(partial.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
  if (!file) throw_cannot_write(path, "cannot be created", errno);
  const auto give_up = [&](const std::string& what) {
    const int error_number = errno;
    file.close();
    ::unlink(partial.c_str());
    throw_cannot_write(path, what, error_number);
  };
  const std::string what = "cannot write " + std::to_string(bytes.size()) + " bytes";
  while (!bytes.empty()) {
    const ssize_t written = ::write(file.number(), bytes.data(), std::min<std::size_t>(bytes.size(), 1 << 30));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) give_up(what);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
  if (::fsync(file.number()) != 0 && errno != EINVAL) give_up(what);
  if (file.close() != 0) give_up(what);
  if (::rename(partial.c_str(), path.c_str()) != 0) give_up("cannot be replaced");
  sync_folder(folder_of(path));
}

void make_folder(const fs::path& folder, const std::string& remedy, const std::string& problem) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw Error(ErrorCode::kCannotWrite, problem + ": " + error.message(), folder.string(), remedy);
}

void expect_outside(const fs::path& out_folder, const std::vector<fs::path>& inputs) {
  const auto whole = [&](const fs::path& path) {
    std::error_code problem;
    fs::path result = fs::weakly_canonical(fs::absolute(path, problem), problem);
    if (problem && path == out_folder) throw_cannot_write(path, "cannot be written", problem.value());
    return result.has_filename() ? result : result.parent_path();
  };
  const fs::path folder = whole(out_folder);
  for (const fs::path& input : inputs) {
    const fs::path path = whole(input);
    if (!path.empty() && std::mismatch(folder.begin(), folder.end(), path.begin(), path.end()).first == folder.end())
      throw Error(ErrorCode::kUsage, "holds the input " + input.string() + ", which would be lost", out_folder.string(),
                  "choose another folder for the results");
  }
}

OutputFolder::OutputFolder(fs::path path, bool force) : goal_(path.lexically_normal()), force_(force) {
  MAPWEAVE_EXPECT(!path.empty(), "an output folder needs a name");
  try {
    if (!goal_.has_filename()) goal_ = goal_.parent_path();  // "out/"
    if (goal_.filename() == "." || goal_.filename() == ".." || fs::is_symlink(goal_))
      goal_ = fs::weakly_canonical(goal_);
    if (fs::is_symlink(goal_))
      throw Error(ErrorCode::kCannotWrite, "is a link to " + fs::read_symlink(goal_).string() + ", which is not there",
                  goal_.string(), "make that folder, or choose another one");
    if (fs::exists(goal_) && !is_empty_folder(goal_)) {
      if (!fs::is_directory(goal_)) {
        throw Error(ErrorCode::kCannotWrite, "is a file; results go to a folder", goal_.string(),
                    "choose another name");
      }
      if (!force_)
        throw Error(ErrorCode::kCannotWrite, "exists and is not empty", goal_.string(),
                    "choose another folder, or replace it with --force");
      if (!fs::exists(goal_ / "manifest.json")) {
        throw Error(ErrorCode::kCannotWrite, "has no manifest.json, so it is not a folder of results", goal_.string(),
                    "it is not replaced, even with --force; choose another folder");
      }
    }
    for (fs::path parent = folder_of(goal_); !fs::exists(parent); parent = folder_of(parent))
      made_parents_.push_back(parent);
    fs::create_directories(folder_of(goal_));
    expect_alone(goal_);
  } catch (const fs::filesystem_error& error) {
    remove_made_parents();
    throw_cannot_write(goal_, "cannot be written", error.code().value());
  }
  staging_ = goal_;
  staging_ += kPartial + std::to_string(::getpid());
  if (::mkdir(staging_.c_str(), 0777) != 0) {
    const int error_number = errno;
    remove_made_parents();
    throw_cannot_write(goal_, "cannot be created", error_number);
  }
  lock_ = ::open(staging_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (lock_ >= 0) ::flock(lock_, LOCK_EX | LOCK_NB);
}

OutputFolder::~OutputFolder() {
  if (!committed_) {
    std::error_code ignored;
    fs::remove_all(staging_, ignored);
    remove_made_parents();
  }
  if (lock_ >= 0) ::close(lock_);
}

void OutputFolder::remove_made_parents() {
  for (const auto& parent : made_parents_) ::rmdir(parent.c_str());  // innermost first; one that others use stays
}

bool OutputFolder::step_aside(const std::string& suffix) {
  std::error_code ignored;
  if (!fs::exists(goal_, ignored) || fs::is_empty(goal_, ignored)) return false;
  fs::path beside = goal_.string() + suffix;
  for (int number = 2; fs::exists(fs::symlink_status(beside, ignored)); ++number)
    beside = goal_.string() + suffix + "-" + std::to_string(number);
  goal_ = beside;
  return true;
}

void OutputFolder::commit() {
  MAPWEAVE_EXPECT(!committed_, "an output folder is committed once");
  try {
    sync_tree(staging_);
  } catch (const fs::filesystem_error& error) {
    throw_cannot_write(goal_, "cannot be read back", error.code().value());
  }
  fs::path old;  // what was at the goal before
  if (::rename(staging_.c_str(), goal_.c_str()) != 0) {
    const bool is_taken = errno == ENOTEMPTY || errno == EEXIST;
    if (is_taken && !force_)
      throw Error(ErrorCode::kCannotWrite, "somebody else has put files there since this run began", goal_.string(),
                  "choose another folder, or replace it with --force");
    if (!is_taken) throw_cannot_write(goal_, "cannot be put in place", errno);
    old = staging_;
    if (::renameat2(AT_FDCWD, staging_.c_str(), AT_FDCWD, goal_.c_str(), RENAME_EXCHANGE) != 0) {
      if (errno != EINVAL && errno != ENOSYS) throw_cannot_write(goal_, "cannot be replaced", errno);
      // A file system that cannot exchange: for a moment the old results have another name.
      old = goal_;
      old += ".replaced-" + std::to_string(::getpid());
      if (::rename(goal_.c_str(), old.c_str()) != 0) throw_cannot_write(goal_, "cannot be replaced", errno);
      if (::rename(staging_.c_str(), goal_.c_str()) != 0) {
        const int error_number = errno;
        ::rename(old.c_str(), goal_.c_str());
        throw_cannot_write(goal_, "cannot be put in place", error_number);
      }
    }
  }
  committed_ = true;
  sync_folder(folder_of(goal_));
  std::error_code ignored;
  if (!old.empty()) fs::remove_all(old, ignored);
}

}  // namespace mapweave
