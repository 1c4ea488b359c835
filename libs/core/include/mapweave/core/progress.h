#pragma once
// Progress of long work, for people: rate and time left on a terminal, a plain line now and then elsewhere, on stderr.
// Never touches results.

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace mapweave {

// Thread-safe. Several tasks may run at once (one per robot).
class Progress {
 public:
  virtual ~Progress() = default;
  // total 0: unknown. unit: "scans", "pairs", "MB".
  virtual int begin(std::string_view task, std::uint64_t total, std::string_view unit) = 0;
  virtual void advance(int task, std::uint64_t done) = 0;  // done so far, not since
  virtual void end(int task) = 0;
  virtual void say(std::string_view line) = 0;  // a line that stays
};

// Through a file, by its bytes: what is shown is whole "kB".
inline constexpr std::uint64_t kKilobyte = 1000;

// One task, ended however it is left.
class ProgressTask {
 public:
  ProgressTask(Progress& progress, std::string_view task, std::uint64_t total, std::string_view unit)
      : progress_(progress), task_(progress.begin(task, total, unit)) {}
  ~ProgressTask() { progress_.end(task_); }
  ProgressTask(const ProgressTask&) = delete;
  ProgressTask& operator=(const ProgressTask&) = delete;
  void advance(std::uint64_t done) { progress_.advance(task_, done); }

 private:
  Progress& progress_;
  int task_;
};

std::unique_ptr<Progress> make_silent_progress();
std::unique_ptr<Progress> make_terminal_progress();  // stderr; looks whether it is a terminal

}  // namespace mapweave
