#pragma once
// Ctrl-C and SIGTERM for programs that run until they are asked to end: they end in order, and nothing throws.

#include <chrono>

namespace mapweave::app {

// To be made before any thread: from then on the signals wait until they are asked for. Threads and child processes
// made later are asked for none.
class StopSignals {
 public:
  StopSignals();
  // Whether one came, within so long.
  bool wait(std::chrono::milliseconds patience);
  // The last one that came was SIGTERM, as of a service manager: the program goes on when it is started again, so that
  // it must not end its part of the work.
  bool asks_for_a_pause() const;

 private:
  int last_ = 0;
};

}  // namespace mapweave::app
