#pragma once
// Progress through a log, by the bytes of its file; and the place where Ctrl-C is heard.

#include <mapweave/core/interrupt.h>
#include <mapweave/core/progress.h>
#include <mapweave/rawlog/observation_stream.h>

#include <string>

namespace mapweave::rawlog {

class Task {
 public:
  Task(Progress& progress, const std::string& name, const ObservationStream& stream)
      : progress_(progress), stream_(stream), number_(progress.begin(name, stream.bytes_total() / kKilobyte, "kB")) {}
  ~Task() { progress_.end(number_); }
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;
  // After each record. Throws Error kInterrupted.
  void step() {
    if (++records_ % 256 != 0) return;
    throw_if_interrupted();
    progress_.advance(number_, stream_.bytes_read() / kKilobyte);
  }

 private:
  static constexpr std::uint64_t kKilobyte = 1000;
  Progress& progress_;
  const ObservationStream& stream_;
  int number_;
  std::uint64_t records_ = 0;
};

}  // namespace mapweave::rawlog
