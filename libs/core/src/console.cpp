#include "console.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <mutex>
#include <string>

namespace mapweave::console {
namespace {

struct Console {
  std::mutex mutex;
  std::string live;
};

// Never destroyed: destructors of static objects may still log.
Console& console() {
  static Console& instance = *new Console;
  return instance;
}

void write_all(std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(STDERR_FILENO, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written <= 0) return;  // nobody listens; nothing can be said about it
    text.remove_prefix(static_cast<std::size_t>(written));
  }
}

constexpr char kEraseLine[] = "\r\x1b[K";

}  // namespace

bool is_terminal() {
  static const bool terminal = ::isatty(STDERR_FILENO) == 1;
  return terminal;
}

int columns() {
  winsize size = {};
  return ::ioctl(STDERR_FILENO, TIOCGWINSZ, &size) == 0 && size.ws_col > 0 ? size.ws_col : 80;
}

void write_line(std::string_view line) {
  auto& [mutex, live] = console();
  const std::lock_guard lock(mutex);
  write_all((live.empty() ? std::string() : kEraseLine) + std::string(line) + "\n" + live);
}

void show_live(std::string_view line) {
  auto& [mutex, live] = console();
  const std::lock_guard lock(mutex);
  if (line.empty() && live.empty()) return;
  live = line;
  write_all(kEraseLine + live);
}

}  // namespace mapweave::console
