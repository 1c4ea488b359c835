#pragma once
// Progress through a log, by the bytes of its file; and the place where Ctrl-C is noticed.

#include <mapweave/core/interrupt.h>
#include <mapweave/core/progress.h>
#include <mapweave/rawlog/observation_stream.h>

#include <string>

namespace mapweave::rawlog {

class Task {
 public:
  Task(Progress& progress, const std::string& name, const ObservationStream& stream)
      : stream_(stream), task_(progress, name, stream.bytes_total() / kKilobyte, "kB") {}
  // After each record. Throws Interrupted.
  void step() {
    if (++records_ % 256 != 0) return;
    throw_if_interrupted();
    task_.advance(stream_.bytes_read() / kKilobyte);
  }

 private:
  const ObservationStream& stream_;
  ProgressTask task_;
  std::uint64_t records_ = 0;
};

}  // namespace mapweave::rawlog
