#include "console.h"
#include "progress_lines.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <mutex>
#include <utility>

namespace mapweave {
namespace {

constexpr double kLivePeriod_s = 0.1;
constexpr double kPlainPeriod_s = 10.0;

// "850", "12.3k", "4.56M": three digits that matter.
std::string short_number(double value) {
  const char* suffix = "";
  for (const char* next : {"k", "M", "G", "T"}) {
    if (value < 999.5) break;
    value /= 1000.0;
    suffix = next;
  }
  char text[64];
  const int decimals = value < 9.995 && value != std::floor(value)   ? 2
                       : value < 99.95 && value != std::floor(value) ? 1
                                                                     : 0;
  std::snprintf(text, sizeof text, "%.*f%s", decimals, value, suffix);
  return text;
}

std::string duration_text(double seconds) {
  const auto whole = static_cast<long long>(std::clamp(std::ceil(seconds), 0.0, 3.6e8));
  char text[64];
  if (whole < 60) {
    std::snprintf(text, sizeof text, "%lld s", whole);
  } else if (whole < 3600) {
    std::snprintf(text, sizeof text, "%lld:%02lld min", whole / 60, whole % 60);
  } else {
    std::snprintf(text, sizeof text, "%lld:%02lld h", whole / 3600, whole / 60 % 60);
  }
  return text;
}

struct Task {
  std::string name, unit;
  std::uint64_t total = 0, done = 0;
  double began_s = 0.0, shown_s = 0.0;
};

// "120 scans (12 %), 40 scans/s, 22 s left"
std::string status(const Task& task, double now_s) {
  std::string text = std::to_string(task.done) + " " + task.unit;
  if (task.total > 0) {
    const double part = std::min(1.0, static_cast<double>(task.done) / static_cast<double>(task.total));
    text += " (" + std::to_string(static_cast<int>(100.0 * part)) + " %)";
  }
  const double elapsed_s = now_s - task.began_s;
  if (task.done == 0 || elapsed_s <= 0.0) return text;
  const double rate = static_cast<double>(task.done) / elapsed_s;
  text += ", " + short_number(rate) + " " + task.unit + "/s";
  if (task.total > task.done)
    text += ", " + duration_text(static_cast<double>(task.total - task.done) / rate) + " left";
  return text;
}

class LineProgress final : public Progress {
 public:
  explicit LineProgress(ProgressOutput output) : output_(std::move(output)) {}
  ~LineProgress() override {
    if (output_.live) output_.show_live({});
  }

  int begin(std::string_view name, std::uint64_t total, std::string_view unit) override {
    const std::lock_guard lock(mutex_);
    const double now_s = output_.seconds();
    Task& task = tasks_[next_];
    task = {std::string(name), std::string(unit), total, 0, now_s, now_s};
    if (output_.live) {
      show_live(now_s, true);
    } else {
      output_.write_line(task.name + ": begins" +
                         (total > 0 ? ", " + std::to_string(total) + " " + task.unit : std::string()));
    }
    return next_++;
  }

  void advance(int id, std::uint64_t done) override {
    const std::lock_guard lock(mutex_);
    Task& task = known(id);
    task.done = done;
    const double now_s = output_.seconds();
    if (output_.live) {
      show_live(now_s, false);
    } else if (now_s - task.shown_s >= kPlainPeriod_s) {
      task.shown_s = now_s;
      output_.write_line(task.name + ": " + status(task, now_s));
    }
  }

  void end(int id) override {
    const std::lock_guard lock(mutex_);
    const Task task = known(id);
    tasks_.erase(id);
    const double now_s = output_.seconds();
    output_.write_line(task.name + ": done, " + status({task.name, task.unit, 0, task.done, task.began_s, 0.0}, now_s) +
                       ", " + duration_text(now_s - task.began_s));
    if (output_.live) show_live(now_s, true);
  }

  void say(std::string_view line) override {
    const std::lock_guard lock(mutex_);
    output_.write_line(line);
  }

 private:
  Task& known(int id) {
    const auto found = tasks_.find(id);
    MAPWEAVE_EXPECT(found != tasks_.end(), "no such task, or it has ended");
    return found->second;
  }

  void show_live(double now_s, bool at_once) {
    if (!at_once && now_s - live_s_ < kLivePeriod_s) return;
    live_s_ = now_s;
    std::string line;
    for (const auto& [id, task] : tasks_) line += (line.empty() ? "" : " | ") + task.name + ": " + status(task, now_s);
    output_.show_live(line);
  }

  ProgressOutput output_;
  std::mutex mutex_;
  std::map<int, Task> tasks_;
  int next_ = 0;
  double live_s_ = 0.0;
};

class SilentProgress final : public Progress {
 public:
  int begin(std::string_view, std::uint64_t, std::string_view) override { return 0; }
  void advance(int, std::uint64_t) override {}
  void end(int) override {}
  void say(std::string_view) override {}
};

// A live line must not wrap, or it could not be rewritten. Cuts between UTF-8 letters.
std::string_view fitting(std::string_view line, std::size_t columns) {
  if (line.size() < columns) return line;
  std::size_t length = columns > 0 ? columns - 1 : 0;
  while (length > 0 && (static_cast<unsigned char>(line[length]) & 0xC0) == 0x80) --length;
  return line.substr(0, length);
}

}  // namespace

std::unique_ptr<Progress> make_progress(ProgressOutput output) {
  return std::make_unique<LineProgress>(std::move(output));
}

std::unique_ptr<Progress> make_silent_progress() { return std::make_unique<SilentProgress>(); }

std::unique_ptr<Progress> make_terminal_progress() {
  if (!console::shows_progress()) return make_silent_progress();
  ProgressOutput output;
  output.live = console::is_terminal();
  output.write_line = console::write_line;
  output.show_live = [](std::string_view line) {
    console::show_live(fitting(line, static_cast<std::size_t>(console::columns())));
  };
  output.seconds = [] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
  };
  return make_progress(std::move(output));
}

}  // namespace mapweave
