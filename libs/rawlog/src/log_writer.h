#pragma once

#include <filesystem>

namespace mapweave::rawlog {

// Whether a GrowingLog writes the file, which is open for reading.
bool has_writer(int file);

class LogWriterWatch {
 public:
  explicit LogWriterWatch(const std::filesystem::path& path);
  ~LogWriterWatch();
  LogWriterWatch(const LogWriterWatch&) = delete;
  LogWriterWatch& operator=(const LogWriterWatch&) = delete;
  bool has_writer() const { return file_ >= 0 && rawlog::has_writer(file_); }

 private:
  int file_;  // negative where it cannot be opened
};

}  // namespace mapweave::rawlog
