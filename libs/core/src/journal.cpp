#include <mapweave/core/journal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdlib>

namespace mapweave {

bool logs_to_journal() {
  const char* stream = std::getenv("JOURNAL_STREAM");
  struct stat of_stderr = {};
  if (stream == nullptr || ::fstat(STDERR_FILENO, &of_stderr) != 0) return false;
  return stream == std::to_string(of_stderr.st_dev) + ":" + std::to_string(of_stderr.st_ino);
}

std::string journal_prefix(LogLevel level) {
  if (!logs_to_journal()) return "";
  switch (level) {
    case LogLevel::debug: return "<7>";
    case LogLevel::info: return "<6>";
    case LogLevel::warning: return "<4>";
    case LogLevel::error: break;
  }
  return "<3>";
}

}  // namespace mapweave
