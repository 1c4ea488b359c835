#pragma once
// A log that is read while it is written (ReadOptions::follow): a lock on the file says that somebody writes it, and is
// gone with who did.

#include <cstdint>
#include <filesystem>
#include <string_view>

namespace mapweave::rawlog {

// Not thread-safe.
class GrowingLog {
 public:
  enum class Begin { new_file, existing_file };
  // Throws Error: kCannotWrite, also where a new file is there already, or another program writes it; kMissing where an
  // existing one is not there.
  GrowingLog(std::filesystem::path path, Begin begin);
  ~GrowingLog();
  GrowingLog(const GrowingLog&) = delete;
  GrowingLog& operator=(const GrowingLog&) = delete;

  const std::filesystem::path& path() const { return path_; }
  std::uint64_t bytes() const { return bytes_; }
  std::size_t read_at(std::uint64_t at, char* to, std::size_t count) const;  // how many there are
  // What stands behind it is cut off. Throws Error(kCannotWrite).
  void cut(std::uint64_t bytes);
  // In the file when it returns. Throws Error(kCannotWrite).
  void add(std::string_view bytes);
  // Who follows it reaches its end. Nothing may be added any more.
  void finish();
  bool is_finished() const { return file_ < 0; }

 private:
  std::filesystem::path path_;
  int file_ = -1;
  std::uint64_t bytes_ = 0;
};

// A file beside a robot's recording, LOG.unsent: not all of the recording is at the robot's edge yet. A program that is
// killed leaves it, and the next one goes on with the recording.
class UnsentMark {
 public:
  explicit UnsentMark(const std::filesystem::path& log) : path_(std::filesystem::path(log) += ".unsent") {}
  bool is_set() const;
  void set() const;  // makes its folder; throws Error(kCannotWrite)
  void clear() const;

 private:
  std::filesystem::path path_;
};

}  // namespace mapweave::rawlog
