#pragma once
// A robot's log, read record by record by the task that maps it. Not thread-safe.

#include "unit_notes.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/progress.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/runtime/metrics.h>

#include <atomic>
#include <memory>
#include <optional>

namespace mapweave::runtime {

class RobotLog {
 public:
  explicit RobotLog(const PlannedRobot& robot) : units(robot), robot_(robot.id) {}

  // From its first record on. Throws Error.
  void begin(std::unique_ptr<rawlog::ObservationStream> log, Progress& progress) {
    log_ = std::move(log);
    task_.emplace(progress, "robot " + robot_.str(), log_->bytes_total() / kKilobyte, "kB");
    next = log_->next();
  }

  // Gives records up to a stamp to use(record), which answers whether another one is wanted. Throws Interrupted, also
  // where it is to give up, and what use() and the log throw.
  template <class Use>
  void advance(std::optional<Stamp> until, const std::atomic<bool>& give_up, Use&& use) {
    while (next && (!until || next->stamp < *until)) {
      throw_if_interrupted();
      if (give_up) throw Interrupted("robot " + robot_.str() + ": given up, because another robot failed");
      units.add(*next);
      const bool goes_on = use(*next);
      task_->advance(log_->bytes_read() / kKilobyte);
      if (goes_on) next = log_->next();
      if (!next) units.finish();
    }
  }

  // Whatever goes wrong in it ends the log; an interruption is thrown.
  template <class Work>
  void guarded(Work&& do_it) {
    const double before_s = thread_cpu_seconds();
    try {
      do_it();
    } catch (const Error& error) {
      trouble = error;
      next.reset();
    }
    cpu_seconds += thread_cpu_seconds() - before_s;
  }

  void close() {
    task_.reset();
    log_.reset();
  }

  UnitNotes units;
  std::optional<rawlog::Record> next;  // none: it has ended
  std::optional<Error> trouble;
  double cpu_seconds = 0.0;  // of what was guarded

 private:
  RobotId robot_;
  std::unique_ptr<rawlog::ObservationStream> log_;
  std::optional<ProgressTask> task_;
};

}  // namespace mapweave::runtime
